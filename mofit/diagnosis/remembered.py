"""A hypothesis in a fit: what was computed at a point is not computed again."""

from __future__ import annotations

import numpy as np

from mofit._typing import FloatArray
from mofit.diagnosis.hypothesis import Hypothesis


class Remembered:
    """A hypothesis with its values at all points so far, and with its rows at the lowest.

    A descent begins where another one has looked, and what it ends with is asked for in full.
    """

    def __init__(self, hypothesis: Hypothesis) -> None:
        self.hypothesis = hypothesis
        self._known: dict[bytes, tuple[float, FloatArray, FloatArray]] = {}
        self._lowest, self._there = np.inf, b""
        self._rows: tuple[FloatArray, FloatArray] | None = None

    def evaluate(self, u: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Negative log posterior (K,) up to a constant, gradient (K, d) and Gauss–Newton Hessian (K, d, d)."""
        places = [point.tobytes() for point in u]
        fresh = u[[place not in self._known for place in places]]
        before = 0
        for part in self.hypothesis.linear_parts(fresh):
            values, gradients, hessians = part.normal_equations()
            for number, found in enumerate(zip(values, gradients, hessians, strict=True)):
                place = fresh[before + number].tobytes()
                self._known[place] = found
                if found[0] < self._lowest:
                    self._lowest, self._there = found[0], place
                    self._rows = part.residual[number].copy(), part.jacobian[number].copy(order="K")
            before += len(values)
        value, gradient, hessian = zip(*(self._known[place] for place in places), strict=True)
        return np.array(value), np.array(gradient), np.array(hessian)

    def linear(self, point: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Residual (m + p,) and Jacobian (m + p, d) of `Hypothesis.linear` at a point (d,)."""
        if self._rows is not None and point.tobytes() == self._there:
            return self._rows
        here = self.hypothesis.linear(point[None])
        return here.residual[0], here.jacobian[0]
