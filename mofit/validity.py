"""What every test must satisfy before anything is computed from it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from mofit.errors import Fault
from mofit.labels import PERIODIC_KINDS

Array = NDArray[np.float64]

#: departure of a time stamp from the uniform grid that is taken for rounding, in sampling steps
GRID_TOLERANCE = 0.05
#: fewest samples that a test can be judged by
FEWEST_SAMPLES = 8
#: a test this much shorter than its labelled period still counts as one (rigs run off their label)
LABEL_TOLERANCE = 0.05


def time_faults(where: str, time: Array) -> list[Fault]:
    """Everything that makes a time axis unusable: too short, not finite, not increasing, gaps, not uniform."""
    where = f"{where}, variable 'time'"
    if time.ndim != 1 or len(time) < FEWEST_SAMPLES:
        return [Fault(where, f"{time.size} samples", f"Give a record of at least {FEWEST_SAMPLES} samples")]
    if faults := finite_faults(where, time):
        return faults
    steps = np.diff(time)
    if (backward := np.flatnonzero(steps <= 0)).size:
        at = backward[0]
        what = f"does not increase after sample {at}: {time[at]:.6g} s, then {time[at + 1]:.6g} s ({backward.size}x)"
        return [Fault(where, what, "Sort the samples and remove repeated ones, or cut the record there")]
    step = float(np.median(steps))
    if (gaps := np.flatnonzero(steps > 1.5 * step)).size:
        at = gaps[0]
        what = f"{gaps.size} gap(s), the first after {time[at]:.6g} s: {steps[at]:.3g} s instead of {step:.3g} s"
        cure = "Measure again, cut the record into two tests there, or import its longest stretch (gaps = 'longest')"
        return [Fault(where, what, cure)]
    index = np.arange(len(time))
    off = np.max(np.abs(time - np.polyval(np.polyfit(index, time, 1), index))) / step
    if off > GRID_TOLERANCE:
        what = f"not uniform: a time stamp is {off:.2g} sampling steps off the grid"
        return [Fault(where, what, "Resample to a constant rate, or give the true sample rate instead of the stamps")]
    return []


def finite_faults(where: str, values: Array) -> list[Fault]:
    """A fault that counts the samples that are NaN or infinite, if any."""
    bad = np.flatnonzero(~np.isfinite(values))
    if not bad.size:
        return []
    what = f"{bad.size} of {values.size} samples are NaN or infinite, the first at index {bad[0]}"
    return [Fault(where, what, "Repair or cut the record; mofit does not invent samples")]


def role_faults(where: str, inputs: Mapping[str, Array], outputs: Mapping[str, Array]) -> list[Fault]:
    """A test without an input, or without an output."""
    return [
        Fault(where, f"no {role} channel", f"Add one, or set role = '{role}' on it")
        for role, group in (("input", inputs), ("output", outputs))
        if not group
    ]


def channel_faults(where: str, kind: str, inputs: Mapping[str, Array], outputs: Mapping[str, Array]) -> list[Fault]:
    """Samples that are not finite, and channels that never move."""
    faults = []
    for role, group in (("input", inputs), ("output", outputs)):
        for name, values in group.items():
            place = f"{where}, variable '{name}'"
            bad = finite_faults(place, values)
            faults += bad
            if bad or not values.size or np.ptp(values) > 1e-12 * np.max(np.abs(values)):
                continue
            # a step may begin before the record, and a free system need not be driven
            mild = role == "input" and kind in ("step", "free")
            what = f"the {role} is constant ({values[0]:.6g})"
            cure = "Check the sensor and the column; leave the test out if nothing moved"
            faults.append(Fault(place, what, cure, "warning" if mild else "error"))
    return faults


def whole_period_faults(where: str, kind: str, time: Array, frequency: float | None) -> list[Fault]:
    """A periodic test that is shorter than the period of its label, or a label that is no frequency."""
    if kind not in PERIODIC_KINDS or frequency is None:
        return []
    if not (np.isfinite(frequency) and frequency > 0):
        what = f"frequency is {frequency:g} Hz"
        return [Fault(f"{where}, attribute 'frequency'", what, "Give the frequency in Hz, above 0")]
    periods = (time[-1] - time[0]) * len(time) / (len(time) - 1) * frequency
    if periods >= 1 - LABEL_TOLERANCE:
        return []
    what = f"no whole period: {periods:.2g} periods of {frequency:g} Hz in the record"
    return [Fault(where, what, "Record at least one whole period, better three; or correct the frequency")]
