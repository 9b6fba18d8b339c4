"""What leaves a result: its parameters as TOML or CSV, its model as one function of state, input and conditions."""

from __future__ import annotations

import csv
import io
import json
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import casadi as ca
import xarray as xr

from mofit.errors import InputError, Issue, did_you_mean, raise_errors
from mofit.models import (
    BlackBoxSystem,
    Channel,
    Law,
    Model,
    System,
    as_laws,
    build_system,
    find_effect,
    find_model,
    with_effects,
    with_laws,
)
from mofit.results.reading import fixed_values, summary
from mofit.results.simulation_counts import simulations
from mofit.runtime.toml import toml_value

#: numbers of a parameter, in the order of the columns: MAP estimate, posterior mean and sd, 5, 50 and 95 % quantiles
_NUMBERS = ("value", "mean", "sd", "q05", "q50", "q95")
_ORIGIN = ("title", "model", "campaign_title", "campaign_source", "campaign_hash", "mofit_version", "created", "seed")


def parameters_csv(tree: xr.DataTree) -> str:
    """One row per mode and parameter, best mode first.

    Columns: ``mode``, ``probability`` (of the mode), ``parameter``, ``value`` (MAP estimate), ``mean``, ``sd``,
    ``q05``, ``q50``, ``q95`` (posterior), ``unit`` and ``verdict``. A parameter that was fixed has a value
    only, and the verdict ``fixed``.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(("mode", "probability", "parameter", *_NUMBERS, "unit", "verdict"))
    for mode, entries in _modes(tree):
        for name, entry in entries.items():
            numbers = ("" if entry[key] is None else repr(entry[key]) for key in _NUMBERS)
            writer.writerow((mode["id"], _probability(mode), name, *numbers, entry["unit"], entry["verdict"]))
    return text.getvalue()


def parameters_toml(tree: xr.DataTree) -> str:
    """A table ``[modes.m1.parameters.NAME]`` per mode and parameter, best mode first.

    Keys as the columns of `parameters_csv`; a number that is not known is left out.
    """
    lines = [f"{key} = {toml_value(tree.attrs[key])}" for key in _ORIGIN if key in tree.attrs]
    lines.append(f"converged = {'true' if tree.attrs['converged'] else 'false'}")
    for mode, entries in _modes(tree):
        errors = ", ".join(f"{toml_value(test)} = {e!r}" for test, e in mode["nrmsd"].items() if e is not None)
        lines += ["", f"[modes.{mode['id']}]", f"probability = {_probability(mode)}", f"nrmsd = {{ {errors} }}"]
        for name, entry in entries.items():
            lines += ["", f"[modes.{mode['id']}.parameters.{name}]"]
            lines += [f"{key} = {entry[key]!r}" for key in _NUMBERS if entry[key] is not None]
            lines += [f"unit = {toml_value(entry['unit'])}", f"verdict = {toml_value(entry['verdict'])}"]
    return "\n".join([*lines, ""])


def _modes(tree: xr.DataTree) -> Iterator[tuple[dict[str, Any], dict[str, Any]]]:
    """Every mode of the summary with the entries of its parameters, then those of the fixed ones."""
    known = tree["fixed"].data_vars if "fixed" in tree.children else {}
    fixed = {}
    for name, value in fixed_values(tree).items():
        unit = str(known[name].attrs["units"]) if name in known else "SI"
        fixed[name] = {**dict.fromkeys(_NUMBERS), "value": value, "unit": unit, "verdict": "fixed"}
    for mode in summary(tree, Path())["modes"]:
        yield mode, {**mode["parameters"], **fixed}


def _probability(mode: Mapping[str, Any]) -> str:
    return "nan" if mode["probability"] is None else repr(mode["probability"])


def model_of_run(tree: xr.DataTree, model: Model | str | None = None, effects: Sequence[str] = ()) -> Model:
    """The model that a run identified.

    Parameters
    ----------
    tree
        A ``mofit.result/2`` tree.
    model, effects
        As they were given to ``mofit identify``, or the model itself without its effects; by default the shipped ones
        of the run's names.

    Raises
    ------
    InputError
        If it is no shipped model and none is given, or if its equations are not those that the run used.
    """
    name, *added = str(tree.attrs["model"]).split("+")
    base = model if isinstance(model, Model) else find_model(model or name)
    found = with_effects(base, *(find_effect(effect) for effect in (effects or added)))
    found = with_laws(found, laws_of_run(tree))
    used = json.loads(tree.attrs["configuration"]).get("equations")
    if build_system(found).hash() != used:
        what = f"its equations are not those that the run identified ('{tree.attrs['model']}')"
        raise InputError.of(f"model '{found.name}'", what, "Give --model and --effect as they were, or identify anew")
    return found


def laws_of_run(tree: xr.DataTree) -> tuple[Law, ...]:
    """The laws that the parameters of a run follow over conditions."""
    return as_laws(json.loads(tree.attrs["configuration"]).get("parameter_laws", ()))


def require_equations(tree: xr.DataTree) -> None:
    """Refuse to write the model of a run that identified a user's simulator.

    Raises
    ------
    InputError
        If it has no equations.
    """
    if simulations(tree) is not None:
        raise _without_equations(str(tree.attrs["model"]))


def system_with_equations(model: Model) -> System:
    """The system of a model.

    Raises
    ------
    InputError
        If it has no equations.
    """
    system = build_system(model)
    if isinstance(system, BlackBoxSystem):
        raise _without_equations(model.name)
    return system


def _without_equations(name: str) -> InputError:
    what = "it is a simulator of your own: mofit knows no equations of it to write"
    return InputError.of(f"model '{name}'", what, "Export its parameters (--to toml, --to csv), and run it with them")


def identified_function(tree: xr.DataTree, model: Model, mode: str = "m1") -> ca.Function:
    r"""The model at the MAP estimate of a mode.

    .. math::
        (x, u, c) \mapsto (\dot x, y, x_0)

    with states :math:`x`, inputs :math:`u`, conditions :math:`c`, outputs :math:`y`, all in SI units and in the order
    in which the model declares them; :math:`x_0` is the state to start from at the first sample of the inputs.

    Raises
    ------
    InputError
        If the run has no such mode, or no value for a parameter.
    """
    modes = tree["modes"].children
    if mode not in modes:
        raise InputError.of(f"--mode {mode}", "the run has no such mode", did_you_mean(mode, modes))
    found = modes[mode].to_dataset(inherit=False)["value"]
    values = {**fixed_values(tree), **{str(n): float(found.sel(parameter=n)) for n in found["parameter"].values}}
    system = system_with_equations(model)
    raise_errors(
        Issue(f"parameter '{name}'", "the run has no value for it", "Identify anew with this model")
        for name in system.parameters
        if name not in values
    )
    p = ca.DM([values[name] for name in system.parameters])
    x, u, c = (
        ca.SX.sym(name, len(names))
        for name, names in (("x", system.states), ("u", system.inputs), ("c", system.conditions))
    )
    outputs = [system.rhs(x, u, p, c), system.out(x, u, p, c), system.initial(u, p, c)]
    return ca.Function(c_identifier(model.name), [x, u, c], outputs, ["x", "u", "c"], ["xdot", "y", "x0"])


def c_source(function: ca.Function, model: Model, origin: Mapping[str, str]) -> str:
    """C source (C99, needs only ``math.h``) of the function, with a plain C interface.

    The file's last function takes and fills arrays of ``double``: ``NAME(x, u, c, xdot, y, x0)``. Pointers to outputs
    that are not wanted may be 0. It keeps no state and is safe to call from several threads.

    Parameters
    ----------
    function
        From `identified_function`.
    model
        The model, for the comment at the top: names, units and order of everything.
    origin
        Provenance of the numbers, for the comment.
    """
    name = function.name()
    inputs = function.sx_in()
    inner = ca.Function(f"{name}_casadi", inputs, function.call(inputs))
    generator = ca.CodeGenerator(f"{name}.c", {"with_header": False, "casadi_int": "int", "verbose": False})
    generator.add(inner)
    sizes = [max(1, n) for n in (inner.sz_arg(), inner.sz_res(), inner.sz_iw(), inner.sz_w())]
    face = f"""
/* 0 when done */
int {name}(const double* x, const double* u, const double* c, double* xdot, double* y, double* x0) {{
  const casadi_real* arg[{sizes[0]}] = {{0}};
  casadi_real* res[{sizes[1]}] = {{0}};
  casadi_int iw[{sizes[2]}];
  casadi_real w[{sizes[3]}];
  arg[0] = x;
  arg[1] = u;
  arg[2] = c;
  res[0] = xdot;
  res[1] = y;
  res[2] = x0;
  return {name}_casadi(arg, res, iw, w, 0);
}}
"""
    return "\n".join(["/*", *_comment(name, model, origin), "*/", str(generator.dump()), face])


def _comment(name: str, model: Model, origin: Mapping[str, str]) -> list[str]:
    """Text in which no comment can end."""
    lines = [f"{name}: {model.title or model.name}, identified by mofit", ""]
    lines += [f"{key}: {value}" for key, value in origin.items()]
    lines += ["", "All values in SI units. Inputs of the function:"]
    lines += ["  x, states:", *_listed(model.states), "  u, inputs:", *_listed(model.inputs), "  c, conditions:"]
    for k, condition in enumerate(model.conditions):
        usual = "" if condition.default is None else f"; usually {condition.default:g}"
        lines.append(f"    [{k}] {condition.name} [{condition.unit}] {condition.description}{usual}")
    lines += ["Outputs: xdot (time derivatives of x), y, and x0 (x to start from, from the first sample of u):"]
    lines += ["  y, outputs:", *_listed(model.outputs)]
    return [f" * {line}".replace("*/", "* /").replace("\n", " ").rstrip() for line in lines]


def _listed(channels: Sequence[Channel]) -> list[str]:
    return [
        f"    [{k}] {channel.name} [{channel.unit}] {channel.description}"
        + (f"; the time derivative of {channel.derivative_of}" if channel.derivative_of else "")
        for k, channel in enumerate(channels)
    ]


def c_identifier(name: str) -> str:
    """A name that C and CasADi take."""
    plain = re.sub(r"_+", "_", re.sub(r"[^0-9A-Za-z]", "_", name)).strip("_")
    return plain if plain[:1].isalpha() else f"model_{plain}"
