"""A plan made ready: its models, every number in SI units, every issue in one list."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ParamSpec, TypeVar

import numpy as np

from mofit.data import Campaign, Experiment, Measurement, read_campaign
from mofit.data.names import channel_name_issues, name_issues, shown, title_issues
from mofit.errors import InputError, Issue, did_you_mean, raise_errors
from mofit.models import Channel, Effect, Model, build_system, find_effect, find_model, incompatibility, with_effects
from mofit.models.model import TIME, derivations
from mofit.quantities import CONDITIONS
from mofit.simulation.requirements import TIME_CONDITIONS
from mofit.simulation.virtual_rig.plan import EffectPlan, NoisePlan, Plan, TestPlan
from mofit.simulation.virtual_rig.signals import excitation, sample_count
from mofit.units import Quantity, parse_quantity

P = ParamSpec("P")
T = TypeVar("T")

#: Samples of all tests together that fit into the memory of a small machine, with some ten numbers for each.
MOST_SAMPLES = 20_000_000

_UNITS = {"sample_rate": "Hz", "frequency": "Hz", "last_frequency": "Hz", "duration": "s", "delay": "s"}


@dataclass(frozen=True)
class TestSetup:
    """One test: the model that responds to it, its numbers and its own conditions, in SI units."""

    plan: TestPlan
    model: Model
    settings: Mapping[str, float]
    conditions: Mapping[str, float]
    record: Measurement | None = None
    """The measured test whose inputs are taken."""

    @property
    def input_units(self) -> dict[str, str]:
        """Units of the inputs by name: the one that the rig moves, or all of a record that the model needs."""
        if self.record is None:
            return {self.excited.name: self.excited.unit}
        units = {channel.name: channel.unit for channel in self.model.inputs}
        return {name: units.get(name, self.record.units.get(name, "1")) for name in _sources(self.model)}

    @property
    def samples(self) -> float:
        """Number of samples."""
        return sample_count(self.plan.kind, self.settings) if self.record is None else len(self.record.time)

    @property
    def excited(self) -> Channel:
        """The input that the rig moves; other inputs are its derivatives."""
        return _excited(self.model)

    def experiment(
        self, rng: np.random.Generator, conditions: Mapping[str, float], start_time: float | None = None
    ) -> Experiment:
        """The test with its input signal; its own conditions override the common ones."""
        if self.record is not None:
            return replace(
                self.record.experiment,
                name=self.plan.name,
                kind=self.plan.kind,
                inputs={name: self.record.channel(name) for name in self.input_units},
                conditions={**conditions, **self.conditions},
                start_time=start_time,
            )
        signal = excitation(self.plan.kind, self.settings, self.plan.lines, rng)
        return Experiment(
            name=self.plan.name,
            kind=self.plan.kind,
            time=signal.time,
            inputs={self.excited.name: signal.values},
            conditions={**conditions, **self.conditions},
            frequency=signal.frequency,
            amplitude=self.settings["amplitude"],
            start_time=start_time,
            interpolation=signal.interpolation,
        )


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
    """Make a plan ready; ``where`` names it in errors. Parameters that are left out are nominal.

    Raises
    ------
    InputError
        With every issue: unknown names, values of the wrong unit, missing conditions.
    """
    check = _Check(where)
    # at once, not when the campaign is written
    check.issues += title_issues(f"{where}, title", plan.title)
    check.issues += name_issues(f"{where}, attributes", "attribute", plan.attributes)
    for test in plan.tests:
        place = f"{where}, test '{shown(test.name)}'"
        check.issues += name_issues(place, "test", [test.name])
        check.issues += channel_name_issues(place, (), {**plan.conditions, **test.conditions})
    model = check.attempt(find_model, plan.model)
    effects = [check.attempt(find_effect, entry.name) for entry in plan.effects]
    raise_errors(check.issues)  # the rest is about the model and its effects
    assert model is not None
    joining = [(effect, entry) for effect, entry in zip(effects, plan.effects, strict=True) if effect is not None]
    build_system(with_effects(model, *(effect for effect, _ in joining)))
    conditions, units = check.conditions("", plan.conditions, model)
    values = check.values("parameters", model, plan.parameters)
    for effect, entry in joining:
        values |= check.values(f"effect '{effect.name}'", effect, entry.parameters)
    tests = tuple(check.test(test, _responding(model, joining, test.kind), conditions) for test in plan.tests)
    noise, pause = check.noise(plan.noise, tests), check.number("pause", plan.pause, "s")
    raise_errors(check.issues)
    units = {**check.units, **units}
    _require_memory(where, tests)
    return Setup(values, conditions, units, noise, pause, tests)


def _require_memory(where: str, tests: Sequence[TestSetup]) -> None:
    counts = {test.plan.name: test.samples for test in tests}
    total, longest = sum(counts.values()), max(counts, key=lambda name: counts[name])
    if not total <= MOST_SAMPLES:
        message = f"its tests have {total:.3g} samples, test '{longest}' alone {counts[longest]:.3g}"
        hint = f"At most {MOST_SAMPLES:.0e} fit: lower the sample rate, or the durations (--budget of a design)"
        raise InputError.of(where, message, hint)


def _excited(model: Model) -> Channel:
    return next(channel for channel in model.inputs if channel.derivative_of is None)


def _sources(model: Model) -> list[str]:
    """Channels that a model needs; some inputs are derivatives of them."""
    names = dict.fromkeys(source for source, _ in derivations(model.inputs).values())
    return [name for name in names if name != TIME.name]


def _responding(model: Model, effects: Sequence[tuple[Effect, EffectPlan]], kind: str) -> Model:
    """The model that responds to a test of this kind, with the effects that join it and can act on it."""
    stages = [stage for stage in model.stages if kind in stage.excitations and not stage.settled]
    base = find_model(stages[0].model) if stages else model
    joining = (effect for effect, entry in effects if not entry.kinds or kind in entry.kinds)
    return with_effects(base, *(effect for effect in joining if incompatibility(effect, base) is None))


class _Check:
    """Turns the entries of a plan into SI units and collects what is wrong with them."""

    def __init__(self, where: str) -> None:
        self.where = where
        self.issues: list[Issue] = []
        self.files: dict[str, Campaign | None] = {}
        #: units of conditions that come with records
        self.units: dict[str, str] = {}

    def add(self, place: str, message: str, hint: str) -> None:
        self.issues.append(Issue(f"{self.where}, {place}", message, hint))

    def attempt(self, function: Callable[P, T], *args: P.args, **options: P.kwargs) -> T | None:
        """The function's result, or None with its issues collected."""
        try:
            return function(*args, **options)
        except InputError as error:
            for issue in error.issues:
                self.add(issue.where, issue.message, issue.hint)
            return None

    def number(self, place: str, value: Quantity, unit: str) -> float:
        """A finite quantity; nan if it is none."""
        found = self.attempt(parse_quantity, place, value, unit)
        if found is None:
            return np.nan
        if not np.isfinite(found[0]):
            self.add(place, f"{value} is not finite", "Give a finite number")
        return found[0]

    def values(self, place: str, owner: Model | Effect, given: Mapping[str, Quantity]) -> dict[str, float]:
        """Value of every parameter of a model or effect."""
        values = {parameter.name: parameter.nominal for parameter in owner.parameters}
        units = {parameter.name: parameter.unit for parameter in owner.parameters}
        for name, value in given.items():
            if name in units:
                values[name] = self.number(f"{place}, {name}", value, units[name])
            else:
                self.add(place, f"unknown parameter '{name}'", did_you_mean(name, units))
        return values

    def conditions(
        self, place: str, given: Mapping[str, Quantity], model: Model
    ) -> tuple[dict[str, float], dict[str, str]]:
        """Conditions and their units; a name that is not known brings its own unit."""
        known = {name: known.unit for name, known in CONDITIONS.items()} | {c.name: c.unit for c in model.conditions}
        found = {
            name: self.attempt(parse_quantity, f"{place}condition '{name}'", value, known.get(name))
            for name, value in given.items()
        }
        kept = {name: entry for name, entry in found.items() if entry is not None}
        return {name: value for name, (value, _) in kept.items()}, {name: unit for name, (_, unit) in kept.items()}

    def test(self, test: TestPlan, model: Model, common: Mapping[str, float]) -> TestSetup:
        place = f"test '{test.name}'"
        own, _ = self.conditions(f"{place}, ", test.conditions, model)
        record = self.record(place, test, model)
        if record is not None:  # the plan's own conditions take precedence
            own = {**{k: v for k, v in record.experiment.conditions.items() if k not in common}, **own}
        for condition in model.conditions:
            if condition.default is None and condition.name not in {*common, *own, *TIME_CONDITIONS}:
                needed = f"condition '{condition.name}' in {condition.unit}"
                self.add(place, f"model '{model.name}' needs {needed}", "Add it under [conditions]")
        unit = _excited(model).unit
        settings = {} if test.periods is None else {"periods": test.periods}
        for key, target in {**_UNITS, "amplitude": unit, "ramp_rate": f"{unit}/s"}.items():
            value = getattr(test, key)
            if value is not None:
                settings[key] = self.number(f"{place}, {key}", value, target)
                if key not in ("amplitude", "delay") and settings[key] <= 0:
                    self.add(f"{place}, {key}", f"{value} is not above 0", "Give a positive number")
        return TestSetup(test, model, settings, own, record)

    def record(self, place: str, test: TestPlan, model: Model) -> Measurement | None:
        """The measured test whose inputs a test takes; None without one, or with its issues collected."""
        if test.record is None or test.test is None:
            return None
        if test.record not in self.files:
            self.files[test.record] = self.attempt(read_campaign, test.record)
        campaign = self.files[test.record]
        found = None if campaign is None else self.attempt(campaign.__getitem__, test.test)
        if campaign is None or found is None:
            return None
        self.units |= campaign.units
        missing = [name for name in _sources(model) if name not in found.experiment.inputs]
        for name in missing:
            have = ", ".join(found.experiment.inputs) or "none"
            what = f"model '{model.name}' needs the input '{name}'; test '{found.name}' of the record has {have}"
            self.add(place, what, "Name another record or test")
        return None if missing else found

    def noise(self, given: Mapping[str, NoisePlan], tests: Sequence[TestSetup]) -> dict[str, dict[str, float]]:
        """Noise settings by channel."""
        channels = [c for test in tests for c in (*test.model.inputs, *test.model.outputs)]
        units = {channel.name: channel.unit for channel in channels if not channel.derivative_of}
        found = {}
        for name, entry in given.items():
            if name not in units:
                self.add("noise", f"no channel '{name}'", did_you_mean(name, units))
                continue
            found[name] = entry.model_dump()
            for key in ("sd", "coloured_sd"):
                found[name][key] = self.number(f"noise.{name}, {key}", found[name][key], units[name])
        return found
