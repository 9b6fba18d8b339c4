"""What every test must satisfy before anything is computed from it, and the longest part of a record that does."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from mofit._typing import FloatArray
from mofit.errors import Issue
from mofit.quantities import PERIODIC_EXCITATIONS, SINGLE_EXCITATIONS, UNDRIVEN_EXCITATIONS

#: departure of a time stamp from the uniform grid that counts as rounding, in sampling steps
GRID_TOLERANCE = 0.05
#: distance of two time stamps, in median sampling steps, above which one is missing between them
MISSING = 1.5
#: the same where stamps jitter, so that jitter is not taken for gaps
MISSING_IN_JITTER = 5.0
#: fewest samples from which period and noise can be found
FEWEST_SAMPLES = 8
#: sizes that no unit makes, and beyond which squares overflow or vanish
LARGEST, SMALLEST = 1e100, 1e-100
#: a test this much shorter than its labelled period still counts as one (rigs run off their label)
LABEL_TOLERANCE = 0.05


def time_issues(where: str, time: FloatArray) -> list[Issue]:
    """Everything that makes a time axis unusable: too short, not finite, not increasing, gaps, not uniform."""
    where = f"{where}, variable 'time'"
    if time.ndim != 1 or len(time) < FEWEST_SAMPLES:
        return [Issue(where, f"{time.size} samples", f"Give a record of at least {FEWEST_SAMPLES} samples")]
    if issues := finite_issues(where, time) or magnitude_issues(where, time):
        return issues
    steps = np.diff(time)
    if issues := _order_issues(where, time, steps):
        return issues
    step = float(np.median(steps))
    cure = f"resample = '{usual_rate(time):.4g} Hz' in the map"
    jitters = float(np.median(np.abs(steps - step))) > GRID_TOLERANCE * step
    if (gaps := np.flatnonzero(steps > (MISSING_IN_JITTER if jitters else MISSING) * step)).size:
        at = gaps[0]
        what = f"{gaps.size} gap(s), the first after {time[at]:.6g} s: {steps[at]:.3g} s instead of {step:.3g} s"
        hint = f"Import the parts between the gaps with {cure}, or the longest of them with gaps = 'longest'"
        return [Issue(where, what, hint)]
    index = np.arange(len(time))
    off = np.abs(time - np.polyval(np.polyfit(index, time, 1), index)) / step
    at = int(np.argmax(off))
    if off[at] > GRID_TOLERANCE:
        what = (
            f"not uniform: stamp {at}, {time[at]:.6g} s, is {off[at]:.2g} sampling steps of {step:.3g} s off the grid"
        )
        return [Issue(where, what, f"Import with {cure}, or give the true sample_rate instead of the stamps")]
    return []


def _order_issues(where: str, time: FloatArray, steps: FloatArray) -> list[Issue]:
    """Stamps that go back, or else that repeat; ``steps`` (n - 1,) are the differences of ``time`` (n,), in s."""
    if (back := np.flatnonzero(steps < 0)).size:
        at = back[0]
        what = f"goes back after sample {at}: {time[at]:.6g} s, then {time[at + 1]:.6g} s ({back.size}x)"
        return [Issue(where, what, "Sort the samples, or cut the record there with rows = [first, last]")]
    if (same := np.flatnonzero(steps == 0)).size:
        at = same[0]
        what = f"does not increase after sample {at}: {time[at]:.6g} s is repeated ({same.size}x)"
        if same.size > len(steps) / 2:  # a clock of whole seconds
            return [Issue(where, what, "It is too coarse for these samples: give the sample_rate, or another column")]
        hint = f"Import with resample = '{usual_rate(time):.4g} Hz' in the map, which drops repeated stamps"
        return [Issue(where, what, hint)]
    return []


def _missing_channel_hint(role: str) -> str:
    hint = f"Add one, or set role = '{role}' on it"
    return f"{hint}; a free decay has none: procedure = 'free'" if role == "input" else hint


def usual_rate(time: FloatArray) -> float:
    """Rate in Hz of most samples of a record with stamps in s, shape (n,); 0 where all are alike; may be infinite."""
    steps = np.diff(time)
    return float(1 / np.median(steps[steps > 0])) if np.any(steps > 0) else 0.0


def finite_issues(where: str, values: FloatArray) -> list[Issue]:
    """An issue that counts the samples that are NaN or infinite, if any."""
    bad = np.flatnonzero(~np.isfinite(values))
    if not bad.size:
        return []
    what = f"{bad.size} of {values.size} samples are NaN or infinite, the first at index {bad[0]}"
    return [
        Issue(where, what, "Look there for a cell that is no number, or cut the record; mofit does not invent samples")
    ]


def experiment_issues(
    where: str, kind: str, time: FloatArray, channels: Mapping[str, Mapping[str, FloatArray]], frequency: float | None
) -> list[Issue]:
    """Everything that makes a test unusable.

    ``time`` is in s, shape (n,); ``channels`` by name, shape (n,) each, are under ``"input"`` and ``"output"``;
    ``frequency`` is that of the label, in Hz.
    """
    issues = time_issues(where, time)
    for group in channels.values():
        for name, values in group.items():
            if len(values) != len(time):
                message = f"{len(values)} samples, but {len(time)} time stamps"
                issues.append(Issue(f"{where}, channel '{name}'", message, "Take columns of one table"))
    if not issues:
        issues += whole_period_issues(where, kind, time, frequency)
    issues += [
        Issue(where, f"no {role} channel", _missing_channel_hint(role))
        for role, group in channels.items()
        if not group and not (role == "input" and kind in UNDRIVEN_EXCITATIONS)
    ]
    return issues + channel_issues(where, kind, channels)


def channel_issues(where: str, kind: str, channels: Mapping[str, Mapping[str, FloatArray]]) -> list[Issue]:
    """Samples that are not finite, and channels that never move; channels are under ``"input"`` and ``"output"``."""
    issues = []
    for role, group in channels.items():
        for name, values in group.items():
            place = f"{where}, variable '{name}'"
            bad = finite_issues(place, values) or magnitude_issues(place, values)
            issues += bad
            if bad or not values.size or np.ptp(values) > 1e-12 * np.max(np.abs(values)):
                continue
            # a step may begin before the record, and a free system need not be driven
            mild = role == "input" and kind in (*SINGLE_EXCITATIONS, *UNDRIVEN_EXCITATIONS)
            what = f"the {role} is constant ({values[0]:.6g})"
            hint = "Check the sensor and the column; leave the test out if nothing moved"
            issues.append(Issue(place, what, hint, "warning" if mild else "error"))
    return issues


def magnitude_issues(where: str, values: FloatArray) -> list[Issue]:
    """Values so large, or so small together, that they are no measurement in any unit."""
    largest = float(np.max(np.abs(values), initial=0.0))
    if largest > LARGEST:
        at = int(np.argmax(np.abs(values)))
        what = f"sample {at} is {values[at]:.3g}, larger than any measurement"
        return [Issue(where, what, "Look there for a mark of missing values, and check the unit")]
    if 0 < largest < SMALLEST:
        return [Issue(where, f"no sample is larger than {largest:.3g}", "Check the unit and the scale of the column")]
    return []


def whole_period_issues(where: str, kind: str, time: FloatArray, frequency: float | None) -> list[Issue]:
    """A periodic test that is shorter than the period of its label, or a label that is no frequency."""
    if kind not in PERIODIC_EXCITATIONS or frequency is None:
        return []
    if not (np.isfinite(frequency) and frequency > 0):
        what = f"frequency is {frequency:g} Hz"
        return [Issue(f"{where}, attribute 'frequency'", what, "Give the frequency in Hz, above 0")]
    periods = (time[-1] - time[0]) * len(time) / (len(time) - 1) * frequency
    if periods >= 1 - LABEL_TOLERANCE:
        return []
    what = f"no whole period: {periods:.2g} periods of {frequency:g} Hz in the record"
    return [Issue(where, what, "Record a whole period, better three; or correct the frequency or the unit of the time")]


def longest_stretch(time: FloatArray, signals: Iterable[FloatArray]) -> tuple[slice, int]:
    """The longest stretch of a record without a gap, and the number of gaps in the whole record.

    A gap is a run of samples at which the time (n,) or a signal (n,) is not finite, or a missing time stamp between two
    samples. Gaps at the ends count. The stretch is empty if no sample is finite.
    """
    finite = np.isfinite(time) & np.all([np.isfinite(signal) for signal in signals], axis=0)
    steps = np.diff(time)
    together = finite[1:] & finite[:-1]
    median = np.median(steps[together]) if together.any() else np.inf
    missing = together & (steps > MISSING * median)
    joined = together & ~missing
    starts = np.flatnonzero(finite & ~np.concatenate([[False], joined]))
    ends = np.flatnonzero(finite & ~np.concatenate([joined, [False]])) + 1
    gaps = int(np.count_nonzero(np.diff(np.concatenate([[True], finite])) & ~finite) + np.count_nonzero(missing))
    if not len(starts):
        return slice(0, 0), gaps
    longest = int(np.argmax(ends - starts))
    return slice(int(starts[longest]), int(ends[longest])), gaps
