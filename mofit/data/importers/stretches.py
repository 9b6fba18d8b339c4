"""The stretches of a record that become tests: all of it, the longest without gaps, or every one, resampled."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from mofit._typing import FloatArray
from mofit.data.campaign import default_interpolation
from mofit.data.importers.import_map import TestMap
from mofit.data.importers.record import Record
from mofit.data.names import shown
from mofit.data.validation import LABEL_TOLERANCE, longest_stretch
from mofit.errors import InputError
from mofit.quantities import PERIODIC_EXCITATIONS

if TYPE_CHECKING:
    from mofit.data.importers.resampling import Part, Resampled
    from mofit.data.importers.uniform_grid import Signal


@dataclass(frozen=True, eq=False)
class Stretch:
    """A part of a record, the number of gaps in the whole record, and how it was resampled, in words."""

    record: Record
    gaps: int = 0
    history: str = ""


def stretches(test: TestMap, record: Record) -> list[Stretch]:
    """The stretches that become tests, at least one.

    Raises
    ------
    InputError
        If the record cannot be resampled, or channels have times of their own and it is not.
    """
    if record.numbers["resample"] is not None:
        return _resampled(test, record)
    if record.times:
        name, hint = next(iter(record.times)), "Add resample = '… Hz', the rate that all channels shall have"
        raise InputError.of(f"test '{shown(test.name)}', channel '{name}'", "has a time of its own", hint)
    if test.gaps != "longest":
        return [Stretch(record)]
    recorded = {name: values for name, values in record.signals.items() if len(values) == len(record.time)}
    kept, gaps = longest_stretch(record.time, recorded.values())
    finite = record.time[np.isfinite(record.time)]
    begin = float(record.time[kept.start] - finite[0]) if kept.start < kept.stop else 0.0
    cut = {name: values[kept] for name, values in recorded.items()}
    return [Stretch(_part(record, record.time[kept], cut, begin), gaps)]


def _resampled(test: TestMap, record: Record) -> list[Stretch]:
    """Every stretch without gaps, or the longest one, on the grid of the new rate."""
    from mofit.data.importers.resampling import resampled  # scipy.signal is heavy, and most imports need none

    where, numbers = f"test '{shown(test.name)}'", record.numbers
    shortest = 0.0
    if test.procedure in PERIODIC_EXCITATIONS and (numbers["frequency"] or 0) > 0:
        shortest = (1 - LABEL_TOLERANCE) / float(numbers["frequency"] or 1)
    linear = (test.interpolation or default_interpolation(test.procedure)) != "cubic"
    rate = float(numbers["resample"] or 0)
    found = resampled(where, _signals(where, record), rate, linear, numbers["max_gap"], shortest)
    gaps = len(found.parts) + len(found.short) - 1
    if gaps and test.gaps == "refuse":
        end = min(part.end for part in [*found.parts, *found.short])
        message, hint = f"{gaps} gap(s), the first after {end:.6g} s", "Without gaps = 'refuse' every stretch is a test"
        raise InputError.of(where, message, hint)
    parts = list(found.parts)
    if test.gaps == "longest":
        parts = [max(parts, key=lambda part: part.samples)]
    origin = min(part.start for part in [*found.parts, *found.short])
    return [
        Stretch(
            _part(record, np.arange(part.samples) / rate, part.values, part.start - origin),
            gaps,
            _history(found, parts, part),
        )
        for part in parts
    ]


def _signals(where: str, record: Record) -> dict[str, Signal]:
    """Channels and sensed conditions with their stamps."""
    from mofit.data.importers.uniform_grid import Signal

    if not record.signals:
        raise InputError.of(where, "no channel", "Add an output channel")
    signals = {}
    for name, values in record.signals.items():
        time = record.times.get(name, record.time)
        if len(time) != len(values):
            message = f"{len(values)} samples, but {len(time)} time stamps"
            hint = "Give the column its own time = { column = … }, or its own sample_rate"
            raise InputError.of(f"{where}, channel '{name}'", message, hint)
        signals[name] = Signal(time, values)
    return signals


def _history(found: Resampled, kept: Sequence[Part], part: Part) -> str:
    """How a part came about: resampling, its place in the record, and what was dropped."""
    words = [found.history]
    if len(found.parts) + len(found.short) > 1:
        words.append(f"the record from {_span(part)}")
    for why, left in (
        ("too short", found.short),
        ("not the longest", [other for other in found.parts if other not in kept]),
    ):
        if left:
            words.append(f"dropped as {why}: {', '.join(map(_span, left))}")
    return "; ".join(words)


def _span(part: Part) -> str:
    return f"{part.start:.6g} to {part.end:.6g} s"


def _part(record: Record, time: FloatArray, values: Mapping[str, FloatArray], begin: float) -> Record:
    """A part of a record that begins ``begin`` s after it; ``values`` replace its signals."""
    numbers = dict(record.numbers)
    if numbers["start_time"] is not None:
        numbers["start_time"] += begin
    if numbers["transient"] is not None:
        numbers["transient"] = max(numbers["transient"] - begin, 0.0)
    channels = {
        role: {name: values[name] for name in group if name in values} for role, group in record.channels.items()
    }
    sensed = {name: values[name] for name in record.sensed if name in values}
    return replace(record, time=time, channels=channels, sensed=sensed, times={}, numbers=numbers)
