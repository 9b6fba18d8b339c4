"""The evaluations of a search: every point it evaluates, counted against its budget."""

from __future__ import annotations

import numpy as np

from mofit._typing import FloatArray
from mofit.optimize.global_search import Gradients, Indices, Objectives


class EvaluationLog:
    """Evaluates points in batches and keeps them all.

    Parameters
    ----------
    objectives, gradients
        The functions.
    dimension
        Number of coordinates d.
    budget
        Most evaluations.
    gradient_cost
        What a value with its gradient counts; a value counts one.
    """

    def __init__(
        self, objectives: Objectives, gradients: Gradients, dimension: int, budget: int, gradient_cost: int = 1
    ) -> None:
        self._objectives, self._gradients = objectives, gradients
        self.budget, self._gradient_cost = budget, gradient_cost
        self._points: list[FloatArray] = [np.empty((0, dimension))]
        self._values: list[FloatArray] = []
        self.used = 0
        self.with_gradient = 0
        self.reserved = 0
        """Evaluations that are kept for later."""

    @property
    def left(self) -> int:
        """Evaluations that the budget still allows, the reserved ones left out."""
        return max(0, self.budget - self.reserved - self.used - (self._gradient_cost - 1) * self.with_gradient)

    @property
    def gradients_left(self) -> int:
        """Values with gradient that the budget still allows."""
        return self.left // self._gradient_cost

    @property
    def points(self) -> FloatArray:
        """All points so far, shape (n, d)."""
        self._points = [np.concatenate(self._points)]
        return self._points[0]

    @property
    def values(self) -> FloatArray:
        """Their objective vectors, shape (n, T)."""
        self._values = [np.concatenate(self._values)]
        return self._values[0]

    def evaluate(self, points: FloatArray) -> tuple[Indices, FloatArray]:
        """Rows and objective vectors of as many of the points as the budget allows."""
        points = points[: self.left]
        return self._kept(points, np.asarray(self._objectives(points), dtype=float))

    def differentiate(self, points: FloatArray) -> tuple[Indices, FloatArray, FloatArray]:
        """Rows, objective vectors and gradients of as many of the points as the budget allows."""
        points = points[: self.gradients_left]
        values, slopes = self._gradients(points)
        self.with_gradient += len(points)
        return *self._kept(points, np.asarray(values, dtype=float)), np.asarray(slopes, dtype=float)

    def _kept(self, points: FloatArray, values: FloatArray) -> tuple[Indices, FloatArray]:
        if values.ndim != 2 or len(values) != len(points):
            raise ValueError(f"objectives must return ({len(points)}, T), got {values.shape}")
        rows = self.used + np.arange(len(points))
        self._points.append(points)
        self._values.append(values)
        self.used += len(points)
        return rows, values
