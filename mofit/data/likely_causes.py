"""Why a label, a size or a sample may be off: units, sampling, a factor that people know."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from mofit.data.campaign import Measurement
from mofit.errors import Issue

#: rigs run off their label by a few per cent; from here on something is wrong
FAR_OFF = 0.1
#: how near a factor must be to a known one
_NEAR = 0.05
#: found frequency over labelled one, and what makes such a factor
_FACTORS = (
    (1e-3, "as if its time were in ms, but read as s"),
    (1e3, "as if the label were in kHz, or the time in s, but read as ms"),
    (1e-6, "as if its time were in µs, but read as s"),
    (60.0, "as if its time were in minutes, but read as s"),
    (1 / 60.0, "as if the label were per minute, or the time in s, but read as minutes"),
    (3600.0, "as if its time were in hours, but read as s"),
    (1 / (2 * math.pi), "as if the label were in rad/s"),
    (2 * math.pi, "as if the label were divided by 2π twice"),
)
#: SI magnitude that a bench does not reach, and what it is then
_UNLIKELY = {
    "displacement": (1.0, "m", "millimetres were read as metres"),
    "lateral_displacement": (1.0, "m", "millimetres were read as metres"),
    "longitudinal_displacement": (1.0, "m", "millimetres were read as metres"),
    "slip_ratio": (2.0, "1", "per cent were read as a ratio"),
    "slip_angle": (math.pi / 2, "rad", "degrees were read as radians"),
}
#: ratio of a channel's range to that usual in the campaign, above which a unit is likelier than a setting
_OTHER_UNIT = 500.0


def frequency_cause(label: float, found: float, rate: float) -> tuple[str, str]:
    """What is likely to be wrong with a label (Hz) that is not the frequency found at a sampling rate (Hz), and a hint.

    Nothing for a rig that is a little off its label.
    """
    if abs(found / label - 1) <= FAR_OFF:
        return "", "Nothing to do: the true frequency is used; correct the label if you like"
    alias = abs(label - rate * round(label / rate))
    if label > 0.5 * rate and abs(alias / found - 1) < _NEAR:
        cause = f"at {rate:.4g} samples per second {label:.4g} Hz look like {alias:.4g} Hz (aliasing)"
        return cause, "Sample at more than twice the frequency, better 20 times: this record cannot tell them apart"
    for factor, cause in _FACTORS:
        if abs(found / label / factor - 1) < _NEAR:
            return cause, "Check the unit of the time and of the label; the data are used as they are"
    cause = "the label, the sampling rate or the unit of the time is wrong"
    return cause, "Check them, and whether it is the file of this test; the data are used as they are"


def unlikely_sizes(measurements: Sequence[Measurement]) -> Iterator[Issue]:
    """Channels that move farther than a bench does, as of another unit."""
    for name, own in _ranges(measurements).items():
        limit, unit, cause = _UNLIKELY.get(name, (math.inf, "", ""))
        if large := [test for test, size in own.items() if size > 2 * limit]:
            message = f"moves by ± {max(own[test] for test in large) / 2:.3g} {unit}, as if {cause}"
            yield _issue(large, name, message, "Check the unit of the column or of the variable")


def far_sizes(measurements: Sequence[Measurement]) -> Iterator[Issue]:
    """Channels whose range is far from that usual in the campaign, whatever the tests are."""
    for name, own in _ranges(measurements).items():
        usual = float(np.median(list(own.values())))
        for test, size in own.items():
            ratio = max(size / usual, usual / size) if size and usual else 0.0
            if len(own) >= 3 and ratio > _OTHER_UNIT:
                message = f"its range is {size:.3g}, in the other tests about {usual:.3g}, as if in another unit"
                yield _issue([test], name, message, "Check the unit, and the record for marks of missing values")


def _ranges(measurements: Sequence[Measurement]) -> dict[str, dict[str, float]]:
    """Range of every channel in every test."""
    ranges: dict[str, dict[str, float]] = {}
    for measurement in measurements:
        for name, values in {**measurement.experiment.inputs, **measurement.outputs}.items():
            ranges.setdefault(name, {})[measurement.name] = float(np.ptp(values))
    return ranges


def _issue(tests: Sequence[str], channel: str, message: str, hint: str) -> Issue:
    where = f"group{'s' if len(tests) > 1 else ''} {', '.join(map(repr, tests))}, variable '{channel}'"
    return Issue(where, message, hint, "warning")
