"""Verdicts in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from mofit.identifiability.comparison import Carried
from mofit.identifiability.confirm import Limits
from mofit.identifiability.verdicts import COMBINATION, IDENTIFIABLE, ONE_SIDED, relative_size
from mofit.parameters import ParameterSpace

Array = NDArray[np.float64]

#: Share of a parameter's precision below which a test carries next to nothing of it.
NOTHING = 0.01
#: Share of what the tests know that those which are named as carrying it have together.
MOST = 0.6


def sentence(
    name: str,
    verdict: str,
    relative: float,
    limits: Limits | None,
    partners: Sequence[str],
    covariance: Array,
    values: Array,
    space: ParameterSpace,
) -> str:
    """Why a parameter has its verdict.

    Parameters
    ----------
    name
        The parameter.
    verdict
        Its verdict.
    relative
        Standard deviation over the magnitude of the value.
    limits
        Of its profile.
    partners
        What makes up for it.
    covariance
        In the unit cube with the bounds, (d, d).
    values
        The stated values, (d,).
    space
        All parameters.
    """
    if verdict == IDENTIFIABLE:
        return f"{name} is identifiable: expected standard deviation {share(relative)}."
    if verdict == COMBINATION:
        text = f"{name} is known only in a combination with {listed(partners)}"
        trade = exchange(name, partners[0], covariance, values, space) if partners else ""
        return f"{text}{': ' + trade if trade else ''} (alone ±{share(relative)})."
    if verdict == ONE_SIDED and limits is not None:
        own, place = space[name], space.index(name)
        low = np.isfinite(limits.low)
        unit = space.to_unit(values)
        unit[place] = limits.low if low else limits.high
        bound, kind = space.from_unit(unit)[place], "lower" if low else "upper"
        return f"{name} has a {kind} limit only, about {bound:.3g} {own.unit}; the other side is open to its bound."
    if limits is not None and limits.closed == 2:
        return (
            f"{name} is not identifiable: all other parameters known, it would still be spread by ±{share(relative)}."
        )
    return f"{name} is not identifiable: within its bounds the data hardly depend on it."


def exchange(name: str, partner: str, covariance: Array, values: Array, space: ParameterSpace) -> str:
    """How a partner makes up for a change: ``d_M +10 % looks like d_y −4 %``."""
    i, j = space.index(name), space.index(partner)
    sizes = relative_size(space, values[None])[0]
    if values[i] == 0 or values[j] == 0:
        return ""
    change = 10 * covariance[j, i] / covariance[i, i] * sizes[i] / sizes[j]
    return f"{name} +10 % is made up for by {partner} {'+' if change > 0 else '−'}{abs(change):.2g} %"


def carried_by(carried: Carried, place: int, name: str) -> str:
    """Which tests carry a parameter, and which carry next to nothing of it."""
    order = np.argsort(-carried.share[:, place], kind="stable")
    shares = carried.share[order, place]
    names = [carried.tests[i] for i in order]
    most = int(np.searchsorted(np.cumsum(shares), MOST * shares.sum())) + 1
    parts = [f"{test} ({share(own)})" for test, own in zip(names[:most], shares, strict=False)]
    text = f"{name} in '{carried.procedure}' is carried by {listed(parts)}"
    known = float(carried.calibration[place])
    for source, own in (("calibration", known), ("the bounds alone", 1 - shares.sum() - known)):
        if own > 1 - MOST:
            text += f"; {share(own)} of what is known comes from {source}"
    none = [test for test, own in zip(names, shares, strict=True) if own < NOTHING]
    return text + (f"; next to nothing comes from {listed(none)}." if none else ".")


def flagged(name: str, verdicts: Mapping[str, int]) -> str:
    """That a verdict is local."""
    total = sum(verdicts.values())
    parts = [f"{word} at {count}" for word, count in verdicts.items()]
    return f"{name}: the verdict depends on the values: {listed(parts)} of {total} parameter sets."


def share(value: float) -> str:
    """A ratio in per cent."""
    return f"{100 * value:.2g} %" if value < 0.995 else f"{100 * value:.0f} %"


def listed(items: Sequence[str]) -> str:
    """``a, b and c``."""
    return " and ".join([", ".join(items[:-1]), items[-1]]) if len(items) > 1 else "".join(items)
