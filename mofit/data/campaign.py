"""A campaign: the tests of one specimen, in SI units, in memory."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from mofit._typing import FloatArray
from mofit.data.names import channel_name_issues, name_issues, shown, title_issues
from mofit.errors import InputError, Issue, did_you_mean, raise_errors, repeated
from mofit.quantities import EXCITATION_KINDS, INTERPOLATIONS, SINGLE_EXCITATIONS, known_unit


@dataclass(frozen=True, eq=False)
class Experiment:
    """The definition of a test: its excitation and conditions, without any measured output.

    Raises
    ------
    InputError
        For an unknown ``kind`` or ``interpolation``.
    """

    name: str
    """Name of the test, unique in its campaign."""
    kind: str
    """One of `mofit.quantities.EXCITATION_KINDS`."""
    time: FloatArray
    """Uniform time grid, shape (n,), in s."""
    inputs: Mapping[str, FloatArray]
    """Input channels over ``time``, shape (n,) each, in SI units; none in a free decay."""
    conditions: Mapping[str, float] = field(default_factory=dict)
    """Constants of the test (load, speed …) in SI units; those of the campaign included."""
    frequency: float | None = None
    amplitude: float | None = None
    """The label of a periodic test: Hz, and the input's unit. True values are found from the data."""
    start_time: float | None = None
    """Time since the campaign began, in s."""
    interpolation: str = ""
    """How inputs run between samples: ``"cubic"``, ``"linear"`` or ``"hold"``; by default linear for a step or ramp."""
    transient: float | None = None
    """Time at the start that is not used, in s, where the test states it; else it is found from the data."""

    def __post_init__(self) -> None:
        if not self.interpolation:
            object.__setattr__(self, "interpolation", default_interpolation(self.kind))
        where = f"test '{self.name}'"
        raise_errors(
            Issue(where, f"unknown {what} '{value}'", did_you_mean(value, known))
            for what, value, known in (
                ("procedure", self.kind, EXCITATION_KINDS),
                ("interpolation", self.interpolation, INTERPOLATIONS),
            )
            if value not in known
        )

    @property
    def step(self) -> float:
        """Sampling interval in s."""
        return self.length / (len(self.time) - 1)

    @property
    def length(self) -> float:
        """Time from the first to the last sample in s."""
        return float(self.time[-1] - self.time[0])


@dataclass(frozen=True, eq=False)
class Measurement:
    """An experiment and the outputs measured in it, shape (n,) each, in SI units.

    ``units`` names the SI unit of every channel, inputs and outputs. ``gaps`` counts those of the record that the test
    was cut from, and ``history`` tells how the record was resampled.
    """

    experiment: Experiment
    outputs: Mapping[str, FloatArray]
    units: Mapping[str, str]
    gaps: int = 0
    history: str = ""

    @property
    def name(self) -> str:
        """Name of the test."""
        return self.experiment.name

    @property
    def kind(self) -> str:
        """Kind of the excitation."""
        return self.experiment.kind

    @property
    def time(self) -> FloatArray:
        """Time grid, shape (n,), in s."""
        return self.experiment.time

    def under(self, conditions: Mapping[str, float]) -> Measurement:
        """The measurement with these conditions where it has none of its own."""
        own = {**conditions, **self.experiment.conditions}
        if own == self.experiment.conditions:
            return self  # the same object: its signal analysis is cached
        return replace(self, experiment=replace(self.experiment, conditions=own))

    def channel(self, name: str) -> FloatArray:
        """An input or output by name, shape (n,).

        Raises
        ------
        InputError
            If the test has no such channel.
        """
        for group in (self.experiment.inputs, self.outputs):
            if name in group:
                return group[name]
        known = [*self.experiment.inputs, *self.outputs]
        raise InputError.of(f"test '{self.name}'", f"no channel '{name}'", did_you_mean(name, known))


@dataclass(frozen=True, eq=False)
class Campaign:
    """The measurements of one specimen.

    Raises
    ------
    InputError
        If ``source`` is another word, a test name is used twice, or a title or a name is none that files can hold, as
        with a ``/`` in it.
    """

    title: str
    """What was tested."""
    source: str
    """``"measured"`` or ``"simulated"``."""
    conditions: Mapping[str, float]
    """Constants that hold for all tests, in SI units; a test's own take precedence."""
    measurements: tuple[Measurement, ...]
    """The tests, in order; they get the campaign's conditions merged in."""
    attributes: Mapping[str, Any] = field(default_factory=dict)
    """Free text, stored in the file."""
    units: Mapping[str, str] = field(default_factory=dict)
    """SI unit of conditions that `mofit.quantities` does not know."""

    def __post_init__(self) -> None:
        where = f"campaign '{self.title}'"
        issues = [
            Issue(where, f"the test name '{name}' is used twice", "Rename one of them") for name in repeated(self.tests)
        ]
        if self.source not in ("measured", "simulated"):
            issues.append(Issue(where, f"source is '{self.source}'", "Set it to 'measured' or 'simulated'"))
        raise_errors([*issues, *self._name_issues()])
        merged = tuple(measurement.under(self.conditions) for measurement in self.measurements)
        object.__setattr__(self, "measurements", merged)

    def _name_issues(self) -> list[Issue]:
        """Title and names that neither a file nor a result can hold."""
        issues = title_issues("root, attribute 'title'", self.title)
        issues += channel_name_issues("root", (), self.conditions)
        issues += name_issues("root", "attribute", map(str, self.attributes))
        for one in self.measurements:
            where, channels = f"group '{shown(one.name)}'", [*one.experiment.inputs, *one.outputs]
            issues += name_issues(where, "test", [one.name])
            issues += channel_name_issues(where, channels, one.experiment.conditions)
        return issues

    def __getitem__(self, name: str) -> Measurement:
        return self.select([name]).measurements[0]

    @property
    def tests(self) -> tuple[str, ...]:
        """Names of the tests, in order."""
        return tuple(measurement.name for measurement in self.measurements)

    def select(self, names: Iterable[str]) -> Campaign:
        """The campaign of the named tests only, in the order given.

        Raises
        ------
        InputError
            With every name that is not a test.
        """
        names = list(names)
        by_name = {measurement.name: measurement for measurement in self.measurements}
        raise_errors(
            Issue(f"campaign '{self.title}'", f"no test '{name}'", did_you_mean(name, by_name))
            for name in names
            if name not in by_name
        )
        return replace(self, measurements=tuple(by_name[name] for name in names))

    def hash(self) -> str:
        """Hash (hexadecimal) of everything that a result depends on: all but ``attributes``."""
        digest = hashlib.sha256(_canonical([self.title, self.source, sorted(self.conditions.items())]))
        for measurement in self.measurements:
            experiment = measurement.experiment
            conditions = sorted(experiment.conditions.items())
            about = [
                [experiment.name, experiment.kind, experiment.interpolation, conditions],
                [experiment.frequency, experiment.amplitude, experiment.start_time, experiment.transient],
                [sorted(experiment.inputs), sorted(measurement.outputs), sorted(measurement.units.items())],
            ]
            digest.update(_canonical(about))
            channels = [experiment.time]
            channels += [group[name] for group in (experiment.inputs, measurement.outputs) for name in sorted(group)]
            for values in channels:
                digest.update(np.ascontiguousarray(values, dtype="<f8").tobytes())
        return digest.hexdigest()


def default_interpolation(kind: str) -> str:
    """How inputs of a kind of test run between samples where the test does not say it."""
    return "linear" if kind in SINGLE_EXCITATIONS else "cubic"


def overview(measurement: Measurement) -> dict[str, Any]:
    """The content of a test as plain data.

    Returns
    -------
    dict
        ``test``, ``procedure``, ``samples``, ``seconds`` (s), ``rate`` (Hz), ``gaps`` (of the record that the test was
        cut from), ``history`` (how it was resampled), ``channels`` by name with ``role``, ``unit`` and ``range``, and
        ``conditions`` (SI).
    """
    experiment, time = measurement.experiment, measurement.time
    groups = (("input", experiment.inputs), ("output", measurement.outputs))
    return {
        "test": measurement.name,
        "procedure": measurement.kind,
        "samples": len(time),
        "seconds": float(time[-1] - time[0]),
        "rate": 1 / experiment.step,
        "gaps": measurement.gaps,
        "history": measurement.history,
        "channels": {
            name: {
                "role": role,
                "unit": measurement.units.get(name, known_unit(name) or "1"),
                "range": [float(values.min()), float(values.max())],
            }
            for role, group in groups
            for name, values in group.items()
        },
        "conditions": dict(experiment.conditions),
    }


def _canonical(value: object) -> bytes:
    return json.dumps(value, default=float).encode()
