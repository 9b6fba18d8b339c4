"""Combinations of parameters: which act only together, and what of them the data determine."""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from mofit._typing import FloatArray
from mofit.parameters import ParameterSpace

#: Verdict on a parameter that acts only together with others: how wide its own posterior is, its range decides.
TOGETHER = "only in combination"
#: Standard deviation along a direction, in box widths, from which the data do not determine it: nearly that of the
#: prior, 0.29.
UNDETERMINED = 0.2
#: Share of a direction below which a parameter has no part in it.
PART = 0.03
#: Relative error up to which an exponent or a weight is a simple number.
SIMPLE = 0.03


def combined(
    space: ParameterSpace, point: FloatArray, hessian: FloatArray, path: FloatArray | None = None
) -> list[tuple[list[str], str]]:
    r"""Sets of parameters that are undetermined only one by one, and what is determined of each.

    Eigenvectors of the Hessian whose standard deviation :math:`\lambda^{-1/2}` reaches the width of the box are
    directions that the data do not see. Parameters that share such a direction act together: one direction of two
    parameters leaves one combination, a product of powers if the relative changes are in a simple ratio, a sum if the
    changes are.

    Parameters
    ----------
    space
        The d parameters.
    point
        The minimum (d,), unit coordinates.
    hessian
        Of the negative log posterior there (d, d); the range of a parameter has no part in it.
    path
        Points along the valley through the minimum, if it bends, shape (K, d). On log scales, that of a product does
        not.
    """
    if path is not None and (along := _along(space, path)):
        return [along]
    values, vectors = np.linalg.eigh((hessian + hessian.T) / 2)
    flat = vectors[:, values < UNDETERMINED**-2]
    alone = np.abs(flat).max(axis=1, initial=0.0) > 0 if flat.size else np.zeros(len(space), dtype=bool)
    if not alone.any():
        return []
    projector = flat @ flat.T
    parts = (np.abs(projector) > PART**2) & (np.sqrt(np.diag(projector))[:, None] > PART)
    found = []
    for members in _groups(parts & parts.T):
        if len(members) < 2:
            continue
        names = [space.names[k] for k in members]
        count = round(float(np.trace(projector[np.ix_(members, members)])))
        what = f"the data determine {len(members) - count} of their {len(members)} combinations"
        if len(members) - count < 1:
            continue
        if len(members) == 2:
            own = np.linalg.eigh(projector[np.ix_(members, members)])[1][:, -1]
            if simple := _simple(space, point, members, own, bends=False):
                what = f"only {simple} is determined"
        found.append((names, what))
    return found


def _along(space: ParameterSpace, path: FloatArray) -> tuple[list[str], str] | None:
    """The parameters that change along a path, and what is determined of them; None if it is a single one."""
    members = [int(k) for k in np.flatnonzero(np.ptp(path, axis=0) > UNDETERMINED)]
    if len(members) < 2:
        return None
    names = [space.names[k] for k in members]
    steps = np.diff(path, axis=0)[:, members]
    bend = int(np.argmax(np.min(np.abs(steps), axis=1) / np.linalg.norm(steps, axis=1)))  # where all change
    if len(members) == 2 and (simple := _simple(space, path[bend : bend + 2].mean(axis=0), members, steps[bend], True)):
        return names, f"only {simple} is determined"
    return names, f"the data determine {len(members) - 1} of their {len(members)} combinations"


def _groups(linked: np.ndarray) -> list[list[int]]:
    """Connected sets of a symmetric relation."""
    left, groups = set(range(len(linked))), []
    while left:
        group, waiting = [], [min(left)]
        while waiting:
            k = waiting.pop()
            if k in left:
                left.remove(k)
                group.append(k)
                waiting += [int(j) for j in np.flatnonzero(linked[k])]
        groups.append(sorted(group))
    return groups


def _simple(space: ParameterSpace, point: FloatArray, members: list[int], direction: FloatArray, bends: bool) -> str:
    """``a*b``, ``a/b^2``, ``a + b``: what is constant along a direction of two parameters; empty if nothing simple."""
    values = space.from_unit(point)
    change = direction * space.derivative(values)[members]
    first, second = (space.names[k] for k in members)
    own, found = values[members], []
    if np.all(own != 0):
        relative = change / own
        if ratio := _ratio(relative[1], -relative[0]):  # first^p second^q with p r1 + q r2 = 0
            p, q = ratio.numerator, ratio.denominator
            found.append(f"{_power(first, abs(p))}{'*' if p * q > 0 else '/'}{_power(second, abs(q))}")
    if space.units[members[0]] == space.units[members[1]] and (ratio := _ratio(change[1], -change[0])):
        p, q = ratio.numerator, ratio.denominator
        found.append(f"{_times(first, abs(p))} {'+' if p * q > 0 else '-'} {_times(second, abs(q))}")
    return found[-1 if bends else 0] if found else ""  # where the values are equal, a sum looks like a product


def _ratio(above: float, below: float) -> Fraction | None:
    """The ratio, if it is one of small numbers."""
    if below == 0 or above == 0:
        return None
    near = Fraction(above / below).limit_denominator(3)
    return near if near != 0 and abs(near) <= 3 and abs(float(near) / (above / below) - 1) < SIMPLE else None


def _power(name: str, exponent: int) -> str:
    return name if exponent == 1 else f"{name}^{exponent}"


def _times(name: str, factor: int) -> str:
    return name if factor == 1 else f"{factor} {name}"
