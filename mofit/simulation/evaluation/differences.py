r"""Steps of finite differences for a simulator whose numbers are noisy: a solver's tolerance is its noise.

A forward difference with step h in the unit coordinate of a parameter errs by :math:`h |f''| / 2 + 2 \varepsilon / h`,
least at :math:`h = 2 \sqrt{\varepsilon / |f''|}`. The noise :math:`\varepsilon` comes from differences of third order
along a short line (ECnoise), the curvature :math:`f''` from one wide second difference.

References
----------
Moré and Wild, "Estimating computational noise", SIAM J. Sci. Comput. 33 (2011); "Estimating derivatives of noisy
simulations", ACM Trans. Math. Softw. 38 (2012).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from mofit._typing import FloatArray
from mofit.parameters import Parameter, ParameterSpace

#: Points of the short line and their distance, in box widths: where step sequences of a solver differ already.
LINE, SPACING = 7, 1e-4
#: Step of the second difference, and the least and the largest step, in box widths.
WIDE, LEAST, LARGEST = 1e-2, 1e-5, 2e-2
#: Step where the simulator is not asked at all, and where it fails around the point.
EXACT, FALLBACK = 1e-4, 1e-3
_ORDER = 3
#: Relative error of a forward difference from which a central one pays, where slopes are asked for and not a descent.
FINE = 2e-3

Respond = Callable[[FloatArray], FloatArray]
"""Parameter sets (K, np) to outputs (K, m), each relative to its range; nan where it fails."""


class Step(NamedTuple):
    """Of the differences by one parameter."""

    size: float
    """In its unit coordinate."""
    error: float
    """Expected relative error of a forward difference."""


def moved(parameter: Parameter, values: FloatArray, step: float) -> FloatArray:
    """Values of a parameter, moved by a step of its unit coordinate."""
    if parameter.scale == "log":
        return np.asarray(values * (parameter.upper / parameter.lower) ** step)
    return np.asarray(values + step * (parameter.upper - parameter.lower))


def possible(parameter: Parameter, values: FloatArray) -> bool:
    """Whether no value is beyond the limits of a parameter."""
    low, high = parameter.possible
    return bool(np.all((values >= low) & (values <= high)))


def nodes(parameter: Parameter, value: float, step: float, central: bool) -> tuple[float, ...]:
    """Offsets, in the unit coordinate, of one or two points beside a value, within the limits."""
    ways: Sequence[tuple[float, ...]] = ((1.0, -1.0), (-1.0, -2.0), (1.0, 2.0)) if central else ((1.0,), (-1.0,))
    for way in ways:
        offsets = tuple(step * one for one in way)
        if all(possible(parameter, moved(parameter, np.array(value), one)) for one in offsets):
            return offsets
    return tuple(step * one for one in ways[0])


def slope(here: FloatArray, beside: Sequence[FloatArray], offsets: Sequence[float]) -> FloatArray:
    r"""Derivative by the unit coordinate from values at 0 and at one or two offsets: of the parabola through them."""
    if len(offsets) == 1:
        return np.asarray((beside[0] - here) / offsets[0])
    (a, b), (first, second) = offsets, beside
    return np.asarray(((first - here) * b / a - (second - here) * a / b) / (b - a))


def noise_level(line: FloatArray) -> float:
    r"""Noise of values along a line of equal steps, (LINE, m), root mean square over the columns.

    .. math:: \varepsilon^2 = \frac{(k!)^2}{(2k)!} \, \overline{(\Delta^k f)^2}, \quad k = 3
    """
    share = math.factorial(_ORDER) ** 2 / math.factorial(2 * _ORDER)
    return float(np.sqrt(share * np.mean(np.diff(line, n=_ORDER, axis=0) ** 2)))


def find_steps(
    respond: Respond,
    space: ParameterSpace,
    p: FloatArray,
    names: Sequence[str],
    reaching: frozenset[str],
    part: Respond | None = None,
) -> dict[str, Step]:
    """Steps of the named parameters, at one set p (np,) in the order of the space.

    Parameters
    ----------
    respond
        Simulates.
    space, p
        All parameters, and where.
    names, reaching
        Whose steps are wanted, and which parameters change what the simulator sees: only those have noise.
    part
        Simulates part of the outputs, enough to see the noise; by default all. What a parameter does may differ from
        test to test, the noise of a solver does not.
    """
    wanted = [name for name in names if name in reaching]
    steps = {name: Step(EXACT, 0.0) for name in names if name not in reaching}
    if not wanted:
        return steps
    columns = [space.index(name) for name in wanted]
    line = np.tile(p, (LINE, 1))
    for k, column in enumerate(columns):
        one = space.parameters[column]
        (toward, *_) = nodes(one, p[column], LINE * SPACING, central=False)
        share = np.cos(1.0 + 2.0 * k) ** 2 + 0.1  # no two parameters are moved alike
        line[:, column] = [moved(one, p[column], share * toward * i / LINE) for i in range(LINE)]
    wide, offsets = [], []
    for column in columns:
        one = space.parameters[column]
        offsets.append(nodes(one, p[column], WIDE, central=True))
        for offset in offsets[-1]:
            wide.append(p.copy())
            wide[-1][column] = moved(one, p[column], offset)
    noise = noise_level((part or respond)(line))
    values = respond(np.concatenate([p[None], np.array(wide)]))
    for k, name in enumerate(wanted):
        first, second = values[1 + 2 * k], values[2 + 2 * k]
        a, b = offsets[k]
        bend = 2 * ((first - values[0]) / a - (second - values[0]) / b) / (a - b)
        rate = slope(values[0], (first, second), (a, b))
        curvature, size = (float(np.sqrt(np.mean(one**2))) for one in (bend, rate))
        steps[name] = _best(noise, curvature, size)
    return steps


def _best(noise: float, curvature: float, size: float) -> Step:
    """The step for noise, curvature and slope relative to the range of the outputs."""
    if not np.isfinite([noise, curvature, size]).all():
        return Step(FALLBACK, 1.0)
    step = float(np.clip(2 * np.sqrt(max(noise, 1e-16) / max(curvature, 1e-12)), LEAST, LARGEST))
    error = step * curvature / 2 + 2 * noise / step
    return Step(step, error / max(size, np.finfo(float).tiny))
