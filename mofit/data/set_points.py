"""Set points: values of a condition that were meant to be one, as 19.9, 20.0 and 20.1 °C."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mofit._typing import FloatArray
from mofit.data.campaign import Campaign
from mofit.data.join import SPECIMEN
from mofit.errors import Issue, raise_errors

#: Largest span of a set point, as a share of the condition's range, and of the distance to the next set point: what
#: lies so near is a scatter, not another condition.
OF_RANGE, OF_DISTANCE = 0.02, 0.1


def set_points(values: ArrayLike, width: float | None = None) -> NDArray[np.intp]:
    """Which set point each value belongs to, numbered in ascending order.

    Neighbours are joined as long as every set point spans at most 2 % of the whole range and a tenth of the distance
    between set points, also on a log scale where all values are positive: 1, 2 and 1000 stay three.

    Parameters
    ----------
    values
        Of a condition, one per test, (n,).
    width
        Neighbours that differ by no more are joined, whatever the others are; 0 keeps all apart.
    """
    known, place = np.unique(np.asarray(values, dtype=float), return_inverse=True)
    gaps = np.diff(known)
    if width is not None:
        return _numbers(gaps > width)[place]
    apart = np.ones(len(gaps), dtype=bool)
    for limit in np.unique(gaps)[:-1]:
        tried = gaps > limit
        if _scatter(known, tried) and (known[0] <= 0 or _scatter(np.log(known), tried)):
            apart = tried
    return _numbers(apart)[place]


def _numbers(apart: NDArray[np.bool_]) -> NDArray[np.intp]:
    return np.concatenate([[0], np.cumsum(apart)]).astype(np.intp)


def _scatter(known: FloatArray, apart: NDArray[np.bool_]) -> bool:
    """Whether what is not apart is a scatter about set points."""
    first, last = known[np.concatenate([[True], apart])], known[np.concatenate([apart, [True]])]
    span, distance = np.max(last - first), np.min(first[1:] - last[:-1])
    return bool(span <= OF_RANGE * (known[-1] - known[0]) and span <= OF_DISTANCE * distance)


def at_set_points(
    campaign: Campaign, over: Sequence[str], widths: Mapping[str, float]
) -> tuple[Campaign, tuple[str, ...]]:
    """The campaign with the tests of a set point under the mean of their values, and sentences that say which.

    Parameters
    ----------
    campaign
        Its tests; those that do not state a condition are left as they are.
    over
        The conditions. Specimens are numbered, and have no set points.
    widths
        Of the set points by condition, in SI units, see `set_points`.

    Raises
    ------
    InputError
        If a width is no condition's, or negative.
    """
    issues = []
    for name, width in widths.items():
        where = f"--set-point {name}={width:g}"
        if name not in over:
            issues.append(Issue(where, "is no condition of --over", f"--over names {', '.join(over) or 'none'}"))
        if not width >= 0:
            issues.append(Issue(where, "is negative", "Give the largest difference in SI units, 0 or more"))
    raise_errors(issues)
    notes = []
    for name in over:
        stated = [k for k, m in enumerate(campaign.measurements) if name in m.experiment.conditions]
        if name == SPECIMEN or not stated:
            continue
        values = np.array([campaign.measurements[k].experiment.conditions[name] for k in stated])
        number = set_points(values, widths.get(name))
        for own in (number == one for one in range(number.max() + 1)):
            different, mean = np.unique(values[own]), float(values[own].mean())
            if len(different) > 1:
                notes.append(_note(name, different, mean))
                campaign = _moved(campaign, set(np.array(stated)[own].tolist()), name, mean)
    return campaign, tuple(notes)


def _moved(campaign: Campaign, tests: set[int], name: str, value: float) -> Campaign:
    """With another value of a condition in some tests."""
    measurements = list(campaign.measurements)
    for k in tests:
        test = measurements[k].experiment
        moved = replace(test, conditions={**test.conditions, name: value})
        measurements[k] = replace(measurements[k], experiment=moved)
    return replace(campaign, measurements=tuple(measurements))


def _note(name: str, values: FloatArray, mean: float) -> str:
    shown = [f"{value:.6g}" for value in values]
    if len(shown) > 4:
        shown = [*shown[:2], "…", shown[-1]]
    apart = f"--set-point {name}=0 keeps them apart"
    return f"{name}: {', '.join(shown)} count as one set point, {mean:.6g} ({apart})."
