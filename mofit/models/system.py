"""From a model to CasADi functions of vectors: the form that is compiled."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import casadi as ca

from mofit.errors import InputError, Issue, did_you_mean, raise_errors, repeated
from mofit.models.black_box import Simulator
from mofit.models.black_box_system import BlackBoxSystem
from mofit.models.effect import Effect
from mofit.models.extended_model import ExtendedModel, base_and_effects, rate_of
from mofit.models.lookup_tables import written_out
from mofit.models.model import Applied, Apply, Equations, Model, Symbols
from mofit.models.own_names import as_written
from mofit.models.users_code import users_code
from mofit.models.vector_form import System
from mofit.parameters import ParameterSpace


def build_system(model: Model) -> System:
    """Evaluate the model's equations on symbols.

    Raises
    ------
    InputError
        If equations raise, lack a derivative or an output, name an unknown one, or use a symbol the
        model does not declare.
    """
    where = f"model '{model.name}'"
    groups = {
        "x": tuple(state.name for state in model.states),
        "u": tuple(channel.name for channel in model.inputs),
        "p": tuple(parameter.name for parameter in model.parameters),
        "c": tuple(condition.name for condition in model.conditions),
    }
    names = [name for group in groups.values() for name in group]
    raise_errors(Issue(where, f"the name '{name}' is declared twice", "Rename one of them") for name in repeated(names))
    base = {name: ca.SX.sym(name) for name in names}
    effects = model.effects if isinstance(model, ExtendedModel) else ()
    applied = [(_guarded(effect), target) for effect, target in effects]
    rates = {channel.derivative_of: channel.name for channel in model.inputs if channel.derivative_of}
    symbols = Symbols(base, groups["u"], applied, rates)
    equations = _evaluated(where, model, symbols)
    simulator = base_and_effects(model)[0]
    simulated = [*equations.outputs.values()] if isinstance(simulator, Simulator) else []
    outputs = {name: symbols.quantity(name, _sx(where, name, value)) for name, value in equations.outputs.items()}
    # an effect on an input that no equation uses still has states
    for name in groups["u"]:
        getattr(symbols, name)
    own = {
        name: symbols.quantity(rate_of(name), _sx(where, name, value)) for name, value in equations.derivatives.items()
    }
    derivatives = {**own, **symbols.derivatives}
    initial = {**equations.initial, **symbols.initial}
    output_names = tuple(channel.name for channel in model.outputs)
    raise_errors(
        [Issue(where, f"an effect acts on '{name}', which the equations never announce", "Check the effect's target")
         for name in symbols.unannounced]
        + _compare(where, "derivative", derivatives, groups["x"])
        + _compare(where, "output", outputs, output_names)
        + [Issue(where, f"initial value of unknown state '{name}'", did_you_mean(name, groups["x"]))
           for name in initial if name not in groups["x"]]
    )  # fmt: skip
    x, u, p, c = (ca.SX(ca.vertcat(*(base[name] for name in group))) for group in groups.values())
    xdot = _column(where, derivatives, groups["x"])
    y = _column(where, outputs, output_names)
    x0 = _resolved(_column(where, {name: initial.get(name, ca.SX(0)) for name in groups["x"]}, groups["x"]), x)
    others = {"u": ca.SX(ca.vertcat(u, *simulated)), "p": p, "c": c}
    try:
        found = System(
            states=groups["x"],
            inputs=groups["u"],
            parameters=groups["p"],
            conditions=groups["c"],
            outputs=output_names,
            rhs=_function(where, "rhs", {"x": x, **others}, "xdot", xdot),
            out=_function(where, "out", {"x": x, **others}, "y", y),
            initial=_function(where, "initial", others, "x0", x0),
        )
        if isinstance(simulator, Simulator):
            return _around(simulator, found, symbols, {"x": x, **others}, model)
        return found
    except RuntimeError as error:
        message = f"the equations use a symbol that is not the model's own ({str(error).strip().splitlines()[-1]})"
        raise InputError.of(where, message, "Use only s.<declared name>") from error


def _around(
    simulator: Simulator, filters: System, symbols: Symbols, arguments: dict[str, ca.SX], model: Model
) -> BlackBoxSystem:
    """A simulator with the filters that effects are around it."""
    groups = (simulator.inputs, simulator.parameters, simulator.conditions)
    seen = ca.SX(ca.vertcat(*(getattr(symbols, one.name) for group in groups for one in group)))
    function = _function(f"model '{model.name}'", "seen", arguments, "seen", seen)
    found = BlackBoxSystem(**vars(filters), box=simulator, seen=function, space=ParameterSpace(model.parameters))
    found.check()
    return found


def _function(where: str, name: str, inputs: dict[str, ca.SX], result: str, expression: ca.SX) -> ca.Function:
    """A function of operations alone."""
    names = (list(inputs), [result])
    found = ca.Function(name, list(inputs.values()), [expression], *names)
    if all(found.instruction_id(k) != ca.OP_CALL for k in range(found.n_instructions())):
        return found
    return ca.Function(name, list(inputs.values()), [written_out(where, expression)], *names)


def _evaluated(where: str, model: Model, symbols: Symbols) -> Equations:
    """The model's equations, if they are usable."""
    base, _ = base_and_effects(model)
    with users_code(where, "equations()", "Correct the model's equations", _file(base.equations)):
        equations = model.equations(symbols)
    if not isinstance(equations, Equations):
        raise InputError.of(
            where, f"equations() returned {type(equations).__name__}", "Return Equations(outputs=…, derivatives=…)"
        )
    return equations


def _guarded(effect: Effect) -> Apply:
    """The effect's function, with the line where it fails."""

    def apply(symbols: Symbols, value: ca.SX) -> Applied:
        with users_code(f"effect '{effect.name}'", "apply()", "Correct the effect", _file(as_written(effect).apply)):
            return effect.apply(symbols, value)

    return apply


def _file(function: Callable[..., Any]) -> str:
    """Where a function is written."""
    code = getattr(function, "__code__", None)
    return code.co_filename if code else ""


def _resolved(x0: ca.SX, x: ca.SX) -> ca.SX:
    """Initial values without states: one may build on another, an effect's on the model's or the reverse."""
    for _ in range(x.numel().bit_length() + 1):  # every round doubles the depth that is resolved
        if ca.depends_on(x0, x):
            x0 = ca.SX(ca.substitute(x0, x, x0))
    if ca.depends_on(x0, x):
        # an effect feeds a state back onto the model's input, so that rest is implicit: iterated from zero
        x0 = ca.SX(ca.substitute(x0, x, ca.SX.zeros(x.shape)))
    return x0


def _sx(where: str, name: str, value: Any) -> ca.SX:
    try:
        return ca.SX(value)
    except (NotImplementedError, TypeError) as error:
        message = f"'{name}' is a {type(value).__name__}, not a CasADi SX expression"
        raise InputError.of(where, message, "Build it from s.<name>") from error


def _column(where: str, values: Mapping[str, Any], order: tuple[str, ...]) -> ca.SX:
    return ca.SX(ca.vertcat(*(_sx(where, name, values[name]) for name in order)))


def _compare(where: str, kind: str, given: Mapping[str, Any], declared: tuple[str, ...]) -> list[Issue]:
    """Issues of what is declared and not given, and of what is given and not declared."""
    hint = f"Add it to the {kind}s that equations() returns"
    missing = [Issue(where, f"no {kind} for '{name}'", hint) for name in declared if name not in given]
    unknown = [name for name in given if name not in declared]
    return missing + [Issue(where, f"{kind} for unknown '{name}'", did_you_mean(name, declared)) for name in unknown]
