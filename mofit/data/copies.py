"""Tests that are the same record under two names, whole or cut at one end."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from mofit._typing import FloatArray
from mofit.data.campaign import Campaign, Measurement
from mofit.errors import Issue

#: difference of two copies, as a share of the range: text files keep so many digits at least
_ROUNDING = 2e-4
#: share of the range that differs from sample to sample, at most, for a record without noise
_SMALLEST = 1e-12


def copy_issues(campaign: Campaign) -> list[Issue]:
    """An issue for every two tests that hold the same samples of an output, rounded or cut."""
    found = []
    for one, other in combinations(campaign.measurements, 2):
        common = [name for name in one.outputs if name in other.outputs]
        shift = next((s for name in common if (s := _shift(one, other, name)) is not None), None)
        if shift is None:
            continue
        where = f"groups '{one.name}' and '{other.name}'"
        what = "hold the same output, sample by sample"
        if shift:
            what += f", shifted by {abs(shift)} samples"
        hint = "Leave one out: a copy counts twice in the identification, and the spread comes out too small"
        found.append(Issue(where, what, hint, "warning"))
    return found


def _shift(one: Measurement, other: Measurement, name: str) -> int | None:
    """Samples by which an output of one test comes later than the same in the other; None if they are no copies."""
    a, b = one.outputs[name], other.outputs[name]
    count = min(len(a), len(b))
    for shift in {0, len(a) - len(b)}:
        # the same begin, or the same end
        if _same(a[max(shift, 0) :][:count], b[max(-shift, 0) :][:count]):
            return shift
    return None


def _same(a: FloatArray, b: FloatArray) -> bool:
    """Whether two records differ by rounding only, which is far less than each differs from sample to sample."""
    count = min(len(a), len(b))
    a, b = a[:count], b[:count]
    size = float(np.ptp(a))
    # a few samples tell nearly all pairs apart
    few = slice(None, None, max(count // 64, 1))
    if not size or np.max(np.abs(a[few] - b[few])) > _ROUNDING * size:
        return False
    difference = float(np.sqrt(np.mean(np.square((a - b) / size))))
    # third differences hold the noise of a smooth record, which two measurements do not share
    noise = float(np.sqrt(np.mean(np.square(np.diff(a / size, 3))) / 20))
    return bool(np.max(np.abs(a - b)) <= _ROUNDING * size and difference <= max(0.5 * noise, _SMALLEST))
