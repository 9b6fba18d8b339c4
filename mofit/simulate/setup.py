"""A plan made ready: models found, every number in SI units, every fault in one list."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TypeVar

import numpy as np

from mofit.drives import EVERY_TEST
from mofit.errors import Fault, InputError, did_you_mean, raise_errors
from mofit.labels import CONDITIONS
from mofit.library import find_effect, find_model
from mofit.model import Effect, Model, build_system, why_not, with_effects
from mofit.readers.map_file import Quantity, quantity
from mofit.simulate.plan import NoisePlan, Plan, TestPlan

T = TypeVar("T")

_UNITS = {"sample_rate": "Hz", "frequency": "Hz", "last_frequency": "Hz", "duration": "s", "delay": "s"}


@dataclass(frozen=True)
class TestSetup:
    """One test: what answers to it, its numbers and its own conditions, in SI units."""

    plan: TestPlan
    source: Model
    settings: Mapping[str, float]
    conditions: Mapping[str, float]


@dataclass(frozen=True)
class Setup:
    """A whole plan; ``values`` of all parameters, ``noise`` settings by channel, ``units`` of the conditions."""

    values: Mapping[str, float]
    conditions: Mapping[str, float]
    units: Mapping[str, str]
    noise: Mapping[str, Mapping[str, float]]
    pause: float
    tests: tuple[TestSetup, ...]


def set_up(plan: Plan, where: str) -> Setup:
    """Make a plan ready; ``where`` names it in errors.

    A parameter that the plan leaves out takes its nominal value.

    Raises
    ------
    InputError
        With every fault: unknown names, values of the wrong unit, missing conditions.
    """
    faults: list[Fault] = []
    model, effects = _models(plan, where, faults)
    conditions, units = _conditions(plan.conditions, model, where, faults)
    values = _values(f"{where}, parameters", model, plan.parameters, faults)
    for effect, entry in zip(effects, plan.effects, strict=True):
        values |= _values(f"{where}, effect '{effect.name}'", effect, entry.parameters, faults)
    limited = [(effect, entry.kinds) for effect, entry in zip(effects, plan.effects, strict=True)]
    tests = tuple(
        _test(test, model, limited, conditions, f"{where}, test '{test.name}'", faults) for test in plan.tests
    )
    setup = Setup(
        values=values,
        conditions=conditions,
        units=units,
        noise=_noise(plan.noise, tests, f"{where}, noise", faults),
        pause=_number(f"{where}, pause", plan.pause, "s", faults),
        tests=tests,
    )
    raise_errors(faults)
    return setup


def _models(plan: Plan, where: str, faults: list[Fault]) -> tuple[Model, tuple[Effect, ...]]:
    """The model and its effects, which must be known and fit before anything else can be checked."""
    model = _kept(partial(find_model, plan.model), where, faults)
    effects = [_kept(partial(find_effect, entry.name), where, faults) for entry in plan.effects]
    raise_errors(faults)
    assert model is not None
    known = tuple(effect for effect in effects if effect is not None)
    build_system(with_effects(model, *known))
    return model, known


def _kept(find: Callable[[], T], where: str, faults: list[Fault]) -> T | None:
    """What is found, or None with its faults kept."""
    try:
        return find()
    except InputError as error:
        faults += [Fault(f"{where}, {fault.where}", fault.what, fault.cure) for fault in error.faults]
        return None


def _values(where: str, owner: Model | Effect, given: Mapping[str, Quantity], faults: list[Fault]) -> dict[str, float]:
    """Value of every parameter of a model or effect: the plan's, else nominal."""
    values = {parameter.name: parameter.nominal for parameter in owner.parameters}
    units = {parameter.name: parameter.unit for parameter in owner.parameters}
    for name, value in given.items():
        if name in units:
            values[name] = _number(f"{where}, {name}", value, units[name], faults)
        else:
            faults.append(Fault(where, f"unknown parameter '{name}'", did_you_mean(name, units)))
    return values


def _conditions(
    given: Mapping[str, Quantity], model: Model, where: str, faults: list[Fault]
) -> tuple[dict[str, float], dict[str, str]]:
    """Conditions in SI units, and their units; a name nobody knows brings its own unit."""
    known = {name: label.unit for name, label in CONDITIONS.items()} | {c.name: c.unit for c in model.conditions}
    values, units = {}, {}
    for name, value in given.items():
        try:
            values[name], units[name] = quantity(f"{where}, condition '{name}'", value, known.get(name))
        except InputError as error:
            faults += error.faults
    return values, units


def _test(
    test: TestPlan,
    model: Model,
    effects: Sequence[tuple[Effect, tuple[str, ...]]],
    conditions: Mapping[str, float],
    where: str,
    faults: list[Fault],
) -> TestSetup:
    source = _source(model, [effect for effect, kinds in effects if not kinds or test.kind in kinds], test.kind)
    own, _ = _conditions(test.conditions, model, where, faults)
    faults += [
        Fault(where, f"model '{source.name}' needs condition '{c.name}' in {c.unit}", "Add it under [conditions]")
        for c in source.conditions
        if c.default is None and c.name not in {**conditions, **own} and c.name not in EVERY_TEST
    ]
    unit = next(channel.unit for channel in source.inputs if channel.derivative_of is None)
    units = {**_UNITS, "amplitude": unit, "ramp_rate": f"{unit}/s"}
    settings = {} if test.periods is None else {"periods": test.periods}
    for key, target in units.items():
        value = getattr(test, key)
        if value is not None:
            settings[key] = _number(f"{where}, {key}", value, target, faults)
            if key not in ("amplitude", "delay") and settings[key] <= 0:
                faults.append(Fault(f"{where}, {key}", f"{value} is not above 0", "Give a positive number"))
    return TestSetup(test, source, settings, own)


def _source(model: Model, effects: Sequence[Effect], kind: str) -> Model:
    """What answers to a test of this kind, with the effects that can act on it."""
    stages = [stage for stage in model.stages if kind in stage.procedures and not stage.settled]
    base = find_model(stages[0].model) if stages else model
    return with_effects(base, *(effect for effect in effects if why_not(effect, base) is None))


def _noise(
    given: Mapping[str, NoisePlan], tests: tuple[TestSetup, ...], where: str, faults: list[Fault]
) -> dict[str, dict[str, float]]:
    """Noise settings by channel, in SI units."""
    channels = [c for test in tests for c in (*test.source.inputs, *test.source.outputs)]
    units = {channel.name: channel.unit for channel in channels if not channel.derivative_of}
    found = {}
    for name, entry in given.items():
        if name not in units:
            faults.append(Fault(where, f"no channel '{name}'", did_you_mean(name, units)))
            continue
        in_unit = {key: _number(f"{where}.{name}, {key}", getattr(entry, key), units[name], faults)
                   for key in ("sd", "coloured_sd")}  # fmt: skip
        found[name] = {**entry.model_dump(), **in_unit}
    return found


def _number(where: str, value: Quantity, unit: str, faults: list[Fault]) -> float:
    """A finite quantity in SI units; nan, and a fault kept, if it is none."""
    try:
        number, _ = quantity(where, value, unit)
    except InputError as error:
        faults += error.faults
        return np.nan
    if not np.isfinite(number):
        faults.append(Fault(where, f"{value} is not finite", "Give a finite number"))
    return number
