"""From a model to CasADi functions of vectors: the form that the kernel compiles."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from hashlib import sha256
from typing import Any

import casadi as ca

from mofit.errors import Fault, InputError, MofitError, did_you_mean, raise_errors
from mofit.model.extended import ExtendedModel
from mofit.model.model import Equations, Model
from mofit.model.symbols import Symbols


@dataclass(frozen=True)
class System:
    """A model in vector form. Vectors are ordered as the name tuples.

    Parameters
    ----------
    states, inputs, parameters, conditions, outputs, quantities
        Names.
    rhs
        ``(x, u, p, c) -> xdot``
    out
        ``(x, u, p, c) -> y``
    initial
        ``(u, p, c) -> x0`` with the first sample of the inputs.
    named
        ``(x, u, p, c) -> values of the named quantities``
    """

    states: tuple[str, ...]
    inputs: tuple[str, ...]
    parameters: tuple[str, ...]
    conditions: tuple[str, ...]
    outputs: tuple[str, ...]
    quantities: tuple[str, ...]
    rhs: ca.Function
    out: ca.Function
    initial: ca.Function
    named: ca.Function

    def hash(self) -> str:
        """Hash of the equations: another one for any change that can change a number."""
        graphs = "".join(function.serialize() for function in (self.rhs, self.out, self.initial))
        return sha256(graphs.encode()).hexdigest()[:16]


def build_system(model: Model) -> System:
    """Evaluate the model's equations on symbols.

    Raises
    ------
    InputError
        If equations raise, lack a rate or an output, name an unknown one, or use a symbol the
        model does not declare.
    """
    groups = {
        "x": tuple(state.name for state in model.states),
        "u": tuple(channel.name for channel in model.inputs),
        "p": tuple(parameter.name for parameter in model.parameters),
        "c": tuple(condition.name for condition in model.conditions),
    }
    where = f"model '{model.name}'"
    names = [name for group in groups.values() for name in group]
    raise_errors(
        Fault(where, f"the name '{name}' is declared twice", "Rename one of them")
        for name in sorted({name for name in names if names.count(name) > 1})
    )
    base = {name: ca.SX.sym(name) for name in names}
    effects = model.hooks if isinstance(model, ExtendedModel) else ()
    symbols = Symbols(base, groups["u"], effects)
    try:
        equations = model.equations(symbols)
    except MofitError:
        raise
    except Exception as error:
        raise InputError.of(
            where, f"equations() raised {type(error).__name__}: {error}", "Mend the model's equations"
        ) from error
    if not isinstance(equations, Equations):
        raise InputError.of(
            where, f"equations() returned {type(equations).__name__}", "Return Equations(outputs=…, rates=…)"
        )
    return _assemble(where, model, groups, base, symbols, equations)


def _assemble(
    where: str,
    model: Model,
    groups: dict[str, tuple[str, ...]],
    base: dict[str, ca.SX],
    symbols: Symbols,
    equations: Equations,
) -> System:
    output_names = tuple(channel.name for channel in model.outputs)
    outputs = {name: symbols.quantity(name, _sx(where, name, value)) for name, value in equations.outputs.items()}
    # an effect on an input that no equation uses still owns states
    for name in groups["u"]:
        getattr(symbols, name)
    rates = {**equations.rates, **symbols.rates}
    initial = {**equations.initial, **symbols.initial}
    unmet = sorted({target for _, target in symbols._effects} - set(symbols.quantities))
    raise_errors(
        [Fault(where, f"an effect acts on '{name}', which the equations never announce", "Check the effect's target")
         for name in unmet]
        + _compare(where, "rate", rates, groups["x"])
        + _compare(where, "output", outputs, output_names)
        + [Fault(where, f"initial value of unknown state '{name}'", did_you_mean(name, groups["x"]))
           for name in initial if name not in groups["x"]]
    )  # fmt: skip
    vectors = {key: ca.vertcat(*(base[name] for name in group)) for key, group in groups.items()}
    x, u, p, c = (ca.SX(vectors[key]) for key in "xupc")
    xdot = _column(where, rates, groups["x"])
    y = _column(where, outputs, output_names)
    x0 = _column(where, {name: initial.get(name, ca.SX(0)) for name in groups["x"]}, groups["x"])
    for _ in range(len(groups["x"]).bit_length() + 1):
        # an initial value may build on another one: an effect's state starts from the model's, or the reverse
        # (every round doubles the depth that is resolved)
        if ca.depends_on(x0, x):
            x0 = ca.SX(ca.substitute(x0, x, x0))
    if ca.depends_on(x0, x):
        # an effect feeds a state back onto the model's input, so that rest is implicit: iterated from zero
        x0 = ca.SX(ca.substitute(x0, x, ca.SX.zeros(x.shape)))
    quantities = tuple(symbols.quantities)
    named = _column(where, symbols.quantities, quantities)
    try:
        return System(
            states=groups["x"],
            inputs=groups["u"],
            parameters=groups["p"],
            conditions=groups["c"],
            outputs=output_names,
            quantities=quantities,
            rhs=ca.Function("rhs", [x, u, p, c], [xdot], ["x", "u", "p", "c"], ["xdot"]),
            out=ca.Function("out", [x, u, p, c], [y], ["x", "u", "p", "c"], ["y"]),
            initial=ca.Function("initial", [u, p, c], [x0], ["u", "p", "c"], ["x0"]),
            named=ca.Function("named", [x, u, p, c], [named], ["x", "u", "p", "c"], ["q"]),
        )
    except RuntimeError as error:
        reason = str(error).strip().splitlines()[-1]
        raise InputError.of(
            where, f"the equations use a symbol that is not the model's own ({reason})", "Use only s.<declared name>"
        ) from error


def _sx(where: str, name: str, value: Any) -> ca.SX:
    try:
        return ca.SX(value)
    except (NotImplementedError, TypeError) as error:
        raise InputError.of(
            where, f"'{name}' is a {type(value).__name__}, not a CasADi SX expression", "Build it from s.<name>"
        ) from error


def _column(where: str, values: Mapping[str, Any], order: tuple[str, ...]) -> ca.SX:
    return ca.SX(ca.vertcat(*(_sx(where, name, values[name]) for name in order)))


def _compare(where: str, kind: str, given: Mapping[str, Any], declared: tuple[str, ...]) -> list[Fault]:
    missing = [
        Fault(where, f"no {kind} for '{name}'", f"Add it to the {kind}s that equations() returns")
        for name in declared
        if name not in given
    ]
    unknown = [
        Fault(where, f"{kind} for unknown '{name}'", did_you_mean(name, declared))
        for name in given
        if name not in declared
    ]
    return missing + unknown
