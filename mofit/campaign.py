"""A campaign: the tests of one specimen, in SI units, in memory."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mofit.errors import Fault, InputError, did_you_mean, raise_errors
from mofit.labels import HOLDS, KINDS, known_unit

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Procedure:
    """One way to excite a system; needs no measured output.

    Parameters
    ----------
    name
        Name of the test, unique in its campaign.
    kind
        One of `mofit.labels.KINDS`.
    time
        Uniform time grid, shape (n,), in s.
    inputs
        Input channels over ``time``, shape (n,) each, in SI units.
    conditions
        Constants of the test (load, speed …) in SI units; those of the campaign included.
    frequency, amplitude
        The label of a periodic test: Hz, and the input's unit. The truth is found from the data.
    start_time
        Time since the campaign began, in s.
    hold
        How inputs run between samples: ``"cubic"`` or ``"linear"``; by default linear for a step.
    transient
        Time at the start that is not to be judged, in s, where the test states it; else it is
        found from the data.

    Raises
    ------
    InputError
        For an unknown ``kind`` or ``hold``.
    """

    name: str
    kind: str
    time: Array
    inputs: Mapping[str, Array]
    conditions: Mapping[str, float] = field(default_factory=dict)
    frequency: float | None = None
    amplitude: float | None = None
    start_time: float | None = None
    hold: str = ""
    transient: float | None = None

    def __post_init__(self) -> None:
        if not self.hold:
            object.__setattr__(self, "hold", "linear" if self.kind == "step" else "cubic")
        where = f"test '{self.name}'"
        raise_errors(
            Fault(where, f"unknown {what} '{value}'", did_you_mean(value, known))
            for what, value, known in (("procedure", self.kind, KINDS), ("hold", self.hold, HOLDS))
            if value not in known
        )

    @property
    def step(self) -> float:
        """Sampling interval in s."""
        return float((self.time[-1] - self.time[0]) / (len(self.time) - 1))


@dataclass(frozen=True, eq=False)
class Measurement:
    """A procedure and the outputs measured in it, shape (n,) each, in SI units.

    ``units`` names the SI unit of every channel, inputs and outputs. ``gaps`` counts those of the record that the test
    is the longest whole stretch of.
    """

    procedure: Procedure
    outputs: Mapping[str, Array]
    units: Mapping[str, str]
    gaps: int = 0

    @property
    def name(self) -> str:
        """Name of the test."""
        return self.procedure.name

    @property
    def kind(self) -> str:
        """Kind of the procedure."""
        return self.procedure.kind

    @property
    def time(self) -> Array:
        """Time grid, shape (n,), in s."""
        return self.procedure.time

    def under(self, conditions: Mapping[str, float]) -> Measurement:
        """The measurement with these conditions where it has none of its own."""
        own = {**conditions, **self.procedure.conditions}
        if own == self.procedure.conditions:
            return self  # the same object: what was found out about it is remembered
        return replace(self, procedure=replace(self.procedure, conditions=own))

    def channel(self, name: str) -> Array:
        """An input or output by name, shape (n,).

        Raises
        ------
        InputError
            If the test has no such channel.
        """
        for group in (self.procedure.inputs, self.outputs):
            if name in group:
                return group[name]
        known = [*self.procedure.inputs, *self.outputs]
        raise InputError.of(f"test '{self.name}'", f"no channel '{name}'", did_you_mean(name, known))


@dataclass(frozen=True, eq=False)
class Campaign:
    """The measurements of one specimen.

    Parameters
    ----------
    title
        What was tested.
    source
        ``"measured"`` or ``"simulated"``.
    conditions
        Constants that hold for all tests, in SI units; a test's own take precedence.
    measurements
        The tests, in order; they get the campaign's conditions merged in.
    attributes
        Free text that travels with the file.
    units
        SI unit of conditions that `mofit.labels` does not know.

    Raises
    ------
    InputError
        If ``source`` is another word, or a test name is used twice.
    """

    title: str
    source: str
    conditions: Mapping[str, float]
    measurements: tuple[Measurement, ...]
    attributes: Mapping[str, Any] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        where = f"campaign '{self.title}'"
        faults = [
            Fault(where, f"the test name '{name}' is used twice", "Rename one of them")
            for name in sorted({name for name in self.tests if self.tests.count(name) > 1})
        ]
        if self.source not in ("measured", "simulated"):
            faults.append(Fault(where, f"source is '{self.source}'", "Say 'measured' or 'simulated'"))
        raise_errors(faults)
        merged = tuple(measurement.under(self.conditions) for measurement in self.measurements)
        object.__setattr__(self, "measurements", merged)

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
            Fault(f"campaign '{self.title}'", f"no test '{name}'", did_you_mean(name, by_name))
            for name in names
            if name not in by_name
        )
        return replace(self, measurements=tuple(by_name[name] for name in names))

    def hash(self) -> str:
        """Hash (hexadecimal) of all that a result depends on; ``attributes`` are left out."""
        digest = hashlib.sha256(_canonical([self.title, self.source, sorted(self.conditions.items())]))
        for measurement in self.measurements:
            procedure = measurement.procedure
            digest.update(
                _canonical(
                    [
                        [procedure.name, procedure.kind, procedure.hold, sorted(procedure.conditions.items())],
                        [procedure.frequency, procedure.amplitude, procedure.start_time, procedure.transient],
                        [sorted(procedure.inputs), sorted(measurement.outputs), sorted(measurement.units.items())],
                    ]
                )
            )
            channels = [procedure.time]
            channels += [group[name] for group in (procedure.inputs, measurement.outputs) for name in sorted(group)]
            for values in channels:
                digest.update(np.ascontiguousarray(values, dtype="<f8").tobytes())
        return digest.hexdigest()


def overview(measurement: Measurement) -> dict[str, Any]:
    """What a test holds, as plain data.

    Returns
    -------
    dict
        ``test``, ``procedure``, ``samples``, ``seconds`` (s), ``rate`` (Hz), ``gaps`` (of the record that the test was
        cut from; none is left in it), ``channels`` by name with ``role``, ``unit`` and ``range``, and ``conditions``
        (SI).
    """
    procedure, time = measurement.procedure, measurement.time
    groups = (("input", procedure.inputs), ("output", measurement.outputs))
    return {
        "test": measurement.name,
        "procedure": measurement.kind,
        "samples": len(time),
        "seconds": float(time[-1] - time[0]),
        "rate": 1 / procedure.step,
        "gaps": measurement.gaps,
        "channels": {
            name: {
                "role": role,
                "unit": measurement.units.get(name, known_unit(name) or "1"),
                "range": [float(values.min()), float(values.max())],
            }
            for role, group in groups
            for name, values in group.items()
        },
        "conditions": dict(procedure.conditions),
    }


def _canonical(value: object) -> bytes:
    return json.dumps(value, default=float).encode()
