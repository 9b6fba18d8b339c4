"""The search for the best values of the scoped parameters, all groups of tests and all sets together."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from mofit._typing import FloatArray
from mofit.optimize import RefineSettings
from mofit.optimize.levenberg_marquardt import minimise_each
from mofit.simulation.experiment import ExperimentData, objective_pairs
from mofit.simulation.scopes import Scopes
from mofit.simulation.simulator import unpacked

#: rows, values, wanted tests to the sums of the objectives, see `ScopedSearch`
Sums: TypeAlias = Callable[[NDArray[np.int64], FloatArray, NDArray[np.bool_]], FloatArray]
#: starts of the scoped values where nothing is known of them; a power of two keeps Sobol points balanced
STARTS = 4
#: Newton's step at once: most scoped parameters enter linearly
EXACT = RefineSettings(damping=1e-9, longest_step=1.0, merge=None)
#: far from the best parameters roughly is enough
ROUGH = replace(EXACT, decrease_tolerance=1e-3, gradient_tolerance=1e-2, max_iterations=10)


class ScopedSearch:
    """The minimisation of every group's squares: a row is a set and a group, in this order.

    Parameters
    ----------
    scopes, experiments
        The scoped parameters, L, and the tests.
    sums
        Cost, gradient and upper triangle by the scoped parameters of every objective, (R, K, terms), from their values
        in rows (R,) of ``p`` and tests, (R, T, L), and which tests of each row are wanted, (R, T).
    weights
        Of the squares of every objective, (K,).
    count
        Number of sets of shared parameters.
    """

    def __init__(
        self, scopes: Scopes, experiments: Sequence[ExperimentData], sums: Sums, weights: FloatArray, count: int
    ) -> None:
        self.space, self.sums, self.weights = scopes.space, sums, weights
        names, pairs = [e.name for e in experiments], objective_pairs(experiments)
        self.tests = np.array([test for test, _ in pairs], dtype=np.intp)
        self.unknowns = scopes.unknowns(names)
        groups, most = self.unknowns.used.shape
        self.starts = self._starts(scopes, names)
        #: the best so far of every row
        self.value = np.full((count, groups), np.inf)
        self.unit = np.tile(self.starts[0], (count, 1, 1))
        self.normal = np.zeros((count, groups, most, most))
        self.cost = np.full((count, len(pairs)), np.nan)
        samples = [np.count_nonzero(experiments[test].weights[:, output]) for test, output in pairs]
        self.samples = self.unknowns.summed(self.tests, np.array([samples], dtype=float))[0]

    def minimise(self, settings: RefineSettings) -> None:
        """Descend from the best of the starts."""
        rows = np.arange(self.value.size)
        for start in self.starts if len(self.starts) > 1 else ():
            self.evaluate(np.tile(start, (len(self.value), 1, 1)).reshape(-1, start.shape[-1]), rows)
        minimise_each(self.evaluate, self.unit.reshape(-1, self.unit.shape[-1]).copy(), settings)

    def _starts(self, scopes: Scopes, names: Sequence[str]) -> FloatArray:
        """Where the search may begin, (S, G, m)."""
        space = scopes.space
        if scopes.known is not None:
            return self.unknowns.by_group(space.to_unit(np.stack([scopes.known[name] for name in names])))[None]
        from scipy.stats import qmc  # late: its import takes half a second

        points = qmc.Sobol(len(space), scramble=False).random(STARTS)
        points[0] = space.to_unit(space.nominal)
        return np.stack([self.unknowns.by_group(np.tile(point, (len(names), 1))) for point in points])

    def evaluate(self, points: FloatArray, rows: NDArray[np.int64]) -> tuple[FloatArray, FloatArray, FloatArray]:
        r"""Value :math:`\tfrac n2 \log Q` of groups, gradient and Hessian, at points (M, m) of rows (M,)."""
        unknowns, tests = self.unknowns, self.tests
        sets, group = np.divmod(rows, len(unknowns.used))
        active, place = np.unique(sets, return_inverse=True)
        unit = np.full((len(active), *unknowns.used.shape), 0.5)
        unit[place, group] = points
        wanted = np.zeros((len(active), len(unknowns.used)), dtype=bool)
        wanted[place, group] = True
        values = self.space.from_unit(unknowns.by_test(unit))
        sums = self.sums(active, values, wanted[:, unknowns.group])
        cost, gradient, normal = unpacked(sums, len(self.space))
        slope = self.space.derivative(values)[:, tests]
        weights = self.weights[:, None] * slope
        squares = unknowns.summed(tests, self.weights * cost)
        slopes = unknowns.summed_vectors(tests, weights * gradient)
        matrix = unknowns.summed_matrices(tests, weights[..., None] * normal * slope[..., None, :])
        positive = np.maximum(squares, np.finfo(float).tiny)
        scale = self.samples / positive
        value = np.where(np.isfinite(squares), 0.5 * self.samples * np.log(positive), np.nan)
        self._keep(active, wanted, unit, value, cost, matrix)
        return (
            value[place, group],
            (scale[..., None] * slopes)[place, group],
            (scale[..., None, None] * matrix)[place, group],
        )

    def _keep(
        self, active: NDArray[np.int64], wanted: NDArray[np.bool_], unit: FloatArray, value: FloatArray,
        cost: FloatArray, matrix: FloatArray,
    ) -> None:  # fmt: skip
        """Remember what is better than before."""
        better = wanted & (value < self.value[active])
        row, group = np.nonzero(better)
        self.value[active[row], group] = value[row, group]
        self.unit[active[row], group] = unit[row, group]
        self.normal[active[row], group] = matrix[row, group]
        row, k = np.nonzero(better[:, self.unknowns.group[self.tests]])
        self.cost[active[row], k] = cost[row, k]
