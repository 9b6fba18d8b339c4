"""Start values of an FMU: what the run says of parameters and conditions, each with a few words on where from."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import xarray as xr

from mofit.errors import InputError, Issue, did_you_mean, raise_errors
from mofit.models import Condition, Model
from mofit.parameters import Parameter
from mofit.results.reading import fixed_values

#: half width of the 90 % interval of a Gaussian, in standard deviations
_NINETY = 1.6449


@dataclass(frozen=True)
class Start:
    """A start value in SI units, and where it comes from."""

    value: float
    origin: str


def chosen_test(tree: xr.DataTree, test: str | None) -> str | None:
    """The test that a user names, if the run has it."""
    known = [str(name) for name in tree.coords["test"].values] if "test" in tree.coords else []
    if test is not None and test not in known:
        raise InputError.of(f"--test {test}", "the run has no such test", did_you_mean(test, known))
    return test


def parameter_starts(tree: xr.DataTree, model: Model, mode: str = "m1", test: str | None = None) -> dict[str, Start]:
    """Of every parameter the posterior mean of a mode; the MAP estimate where the mode was not sampled.

    A parameter with a value per test or condition has that of the ``test``, or the mean over all, as a prediction of a
    record without output takes it.

    Raises
    ------
    InputError
        If the run has no such mode or test, or no value for a parameter.
    """
    modes = tree["modes"].children
    if mode not in modes:
        raise InputError.of(f"--mode {mode}", "the run has no such mode", did_you_mean(mode, modes))
    chosen_test(tree, test)
    known = {name: Start(value, "fixed in the identification") for name, value in fixed_values(tree).items()}
    known |= _identified(modes[mode].to_dataset(inherit=False), model)
    if "scoped" in modes[mode].children:
        known |= _scoped(modes[mode]["scoped"].dataset, test)
    raise_errors(
        Issue(f"parameter '{p.name}'", "the run has no value for it", "Identify anew with this model")
        for p in model.parameters
        if p.name not in known
    )
    return {p.name: known[p.name] for p in model.parameters}


def _identified(found: xr.Dataset, model: Model) -> dict[str, Start]:
    limits = {p.name: p.possible for p in model.parameters}
    starts = {}
    for name in map(str, found["parameter"].values):
        at = found.sel(parameter=name).data_vars
        own = {str(key): values.item() for key, values in at.items() if not values.dims}
        if math.isfinite(own.get("mean", math.nan)):
            low, high, value, what = own["q05"], own["q95"], own["mean"], "posterior mean"
            verdict = f", {own['verdict']}" if "verdict" in own else ""
        else:
            value, sd = own["value"], own.get("laplace_sd", math.nan)
            low, high = np.clip([value - _NINETY * sd, value + _NINETY * sd], *limits.get(name, (-np.inf, np.inf)))
            what, verdict = "MAP estimate", ", not sampled"
        interval = f", 90 % interval {low:.6g} to {high:.6g}" if math.isfinite(low) and math.isfinite(high) else ""
        starts[name] = Start(float(value), f"{what}{interval}{verdict}")
    return starts


def _scoped(found: xr.Dataset, test: str | None) -> dict[str, Start]:
    """Values per test or condition: that of the test, or the mean over what there are different ones of."""
    starts = {}
    for name in map(str, found["parameter_scoped"].values):
        own = found.sel(parameter_scoped=name)
        if test is not None:
            cell = own.sel(test=test)
            value, sd = float(cell["value"]), float(cell["sd"])
            low, high = value - _NINETY * sd, value + _NINETY * sd
            origin = f"value of {cell['label'].item()}, 90 % interval {low:.6g} to {high:.6g}"
        else:
            each = dict(zip(own["label"].values.tolist(), own["value"].values.tolist(), strict=True))
            values = np.array(list(each.values()))
            value = float(values.mean())
            origin = f"mean of {len(values)} values, {values.min():.6g} to {values.max():.6g}: it differs between tests"
        starts[name] = Start(value, origin)
    return starts


def condition_starts(tree: xr.DataTree, model: Model, test: str | None = None) -> dict[str, Start]:
    """Of every condition the value that all tests share, or that of the ``test``; else the model's default.

    Raises
    ------
    InputError
        If a condition differs between the tests and none is named, or is neither in the run nor has a default.
    """
    chosen_test(tree, test)
    return {condition.name: _condition(_of_tests(tree, condition), condition, test) for condition in model.conditions}


def _of_tests(tree: xr.DataTree, condition: Condition) -> Mapping[str, float]:
    """Values of a condition by test; none in a run that does not state them."""
    node = tree.children.get("conditions")
    if node is None or condition.name not in node.dataset["condition"].values:
        return {}
    values = node.dataset["value"].sel(condition=condition.name)
    return dict(zip(map(str, values["test"].values), values.values.tolist(), strict=True))


def _condition(known: Mapping[str, float], condition: Condition, test: str | None) -> Start:
    where = f"condition '{condition.name}'"
    if test is not None and test in known:
        return Start(known[test], f"value of {test}")
    values = np.array(list(known.values()))
    if len(values) and np.allclose(values, values[0], rtol=1e-9, atol=0.0):
        return Start(float(values[0]), "common to the tests")
    if len(values):
        message = f"differs between the tests, {values.min():g} to {values.max():g} {condition.unit}"
        raise InputError.of(where, message, "Name with --test the one whose values the FMU is to start with")
    if condition.default is None:
        raise InputError.of(where, "the run does not state it", "Identify anew: results hold the conditions now")
    return Start(condition.default, "default of the model")


def limits_of(parameter: Parameter, start: float) -> tuple[float | None, float | None]:
    """Finite limits that are possible at all, where the start value keeps them."""
    low, high = parameter.possible
    return (
        low if math.isfinite(low) and low <= start else None,
        high if math.isfinite(high) and start <= high else None,
    )
