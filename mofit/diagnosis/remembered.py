"""A hypothesis in a fit: what was computed at a point is not computed again."""

from __future__ import annotations

import numpy as np

from mofit._typing import FloatArray
from mofit.diagnosis.hypothesis import Hypothesis
from mofit.runtime.parallel import shared_map
from mofit.runtime.team import current

#: Rows of all points together from which a team shares the points: of fewer, sending takes longer.
_SHARED = 20_000

#: Negative log posterior up to a constant, gradient (d,) and Gauss–Newton Hessian (d, d) at a point.
_Found = tuple[float, FloatArray, FloatArray]


class Remembered:
    """A hypothesis with its values at all points so far, and with its rows at the lowest that was computed here.

    A descent begins where another one has looked, and what it ends with is asked for in full.
    """

    def __init__(self, hypothesis: Hypothesis) -> None:
        self.hypothesis = hypothesis
        self._known: dict[bytes, _Found] = {}
        self._lowest, self._there = np.inf, b""
        self._rows: tuple[FloatArray, FloatArray] | None = None

    def evaluate(self, u: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Negative log posterior (K,) up to a constant, gradient (K, d) and Gauss–Newton Hessian (K, d, d)."""
        places = [point.tobytes() for point in u]
        fresh = u[[place not in self._known for place in places]]
        self._known |= zip([point.tobytes() for point in fresh], self._computed(fresh), strict=True)
        value, gradient, hessian = zip(*(self._known[place] for place in places), strict=True)
        return np.array(value), np.array(gradient), np.array(hessian)

    def _computed(self, points: FloatArray) -> list[_Found]:
        """At all points; a team shares them."""
        if current() is None or len(points) < 2:
            return self._computed_here(points)
        observed = self.hypothesis.observed
        if len(points) * len(observed.measured) < _SHARED:
            return self._computed_here(points)
        parts = np.array_split(points, min(len(points), observed.processes))
        return [one for part in shared_map(self._computed_here, parts, lambda part: str(len(part))) for one in part]

    def _computed_here(self, points: FloatArray) -> list[_Found]:
        found = list[_Found]()
        for part in self.hypothesis.linear_parts(points):
            for number, one in enumerate(zip(*part.normal_equations(), strict=True)):
                if one[0] < self._lowest:
                    self._lowest, self._there = one[0], points[len(found)].tobytes()
                    self._rows = part.residual[number].copy(), part.jacobian[number].copy(order="K")
                found.append(one)
        return found

    def linear(self, point: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Residual (m + p,) and Jacobian (m + p, d) of `Hypothesis.linear` at a point (d,)."""
        if self._rows is not None and point.tobytes() == self._there:
            return self._rows
        here = self.hypothesis.linear(point[None])
        return here.residual[0], here.jacobian[0]
