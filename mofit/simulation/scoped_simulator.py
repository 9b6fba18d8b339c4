r"""A simulator whose scoped parameters take their best values: it depends on those of the campaign alone.

Variable projection: at shared parameters s the values l of every group of tests minimise its weighted squares,
:math:`\hat l(s)`. A response then changes with s by

.. math:: \frac{d y}{d s} = \frac{\partial y}{\partial s} + \frac{\partial y}{\partial l} D, \qquad
          D = \frac{d \hat l}{d s} \approx -N_{ll}^{-1} N_{ls}

with the Gauss-Newton matrix N. N has the form of an arrow, so that the work grows linearly with the number of tests.

References
----------
Golub and Pereyra, "Separable nonlinear least squares: the variable projection method", Inverse Problems 19 (2003).
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mofit._typing import FloatArray
from mofit.models import System
from mofit.simulation.engines import engine_for
from mofit.simulation.experiment import ExperimentData, objective_pairs, objectives_of
from mofit.simulation.scoped_search import EXACT, ROUGH, ScopedSearch
from mofit.simulation.scopes import Scopes, Unknowns
from mofit.simulation.simulator import Simulator, unpacked
from mofit.simulation.step_probing import changes_stiffness
from mofit.simulation.step_selection import Box
from mofit.simulation.time_grid import StepChoice

#: results kept: cost and derivatives are often asked for at the same parameters
_REMEMBERED = 4
#: share of the mean curvature that a direction has at least
_FLAT = 1e-10


@dataclass(frozen=True)
class Best:
    """The best scoped values at N sets of shared parameters."""

    unknowns: Unknowns
    unit: FloatArray
    """In the unit cube of the scoped parameters, (N, G, m)."""
    values: FloatArray
    """All parameters by test, (N, T, np)."""
    cost: FloatArray
    """Weighted squares of every objective, (N, K)."""
    normal: FloatArray
    """Weighted Gauss-Newton matrix of the groups in unit coordinates, (N, G, m, m); 1 on the diagonal where unused."""

    def held(self) -> NDArray[np.bool_]:
        """Which values lie at an end of their range, (N, G, m)."""
        return (self.unit <= 0) | (self.unit >= 1)


class ScopedSimulator(Simulator):
    """Runs batches of parameter sets through tests, each test with the best values of the scoped parameters.

    Parameters
    ----------
    system, experiments, free, jobs, tolerance, box
        As for `Simulator`; the values of scoped parameters in sets and box are ignored.
    scopes
        The scoped parameters, none of which is among the free ones.
    weights
        Of the squares of every objective, (K,); 1 by default. They matter where tests or outputs share a value.
    """

    def __init__(
        self,
        system: System,
        experiments: Sequence[ExperimentData],
        free: Sequence[str],
        scopes: Scopes,
        *,
        jobs: int = 1,
        tolerance: float = 1e-6,
        box: Box,
        weights: FloatArray | None = None,
    ) -> None:
        names = scopes.space.names
        self.columns = np.array([system.parameters.index(name) for name in names], dtype=np.intp)
        self.scopes, self._weights = scopes, weights
        every = (*free, *names)
        super().__init__(system, experiments, every, jobs=jobs, tolerance=tolerance, box=self._whole(box))
        self.free = tuple(free)
        self._inner = engine_for(system, names, jobs, fixed_per_lane=True)
        self._stiff = changes_stiffness(system, names)
        self._search = ROUGH
        self._known: OrderedDict[bytes, Best] = OrderedDict()

    def _with(self, **changes: Any) -> ScopedSimulator:
        other = super()._with(**changes)
        assert isinstance(other, ScopedSimulator)
        other._known = OrderedDict()
        other._recent = OrderedDict()
        return other

    def select(self, index: Sequence[int]) -> ScopedSimulator:
        """The same on some of the tests."""
        weights = self._weights
        if weights is not None:
            weights = weights[objectives_of(self.experiments, index)]
        return self._with(experiments=tuple(self.experiments[i] for i in index), _weights=weights)

    def within(self, box: Box, tolerance: float | None = None) -> Simulator:
        """The same for sets in another box."""
        return super().within(self._whole(box), tolerance)

    def with_free(self, free: Sequence[str], box: Box, tolerance: float) -> Simulator:
        """The same tests with other free parameters."""
        return ScopedSimulator(
            self.system, self.experiments, free, self.scopes,
            jobs=self._jobs, tolerance=tolerance, box=box, weights=self._weights,
        )  # fmt: skip

    def weighted(self, weights: FloatArray) -> ScopedSimulator:
        """The same with other weights of the objectives (K,).

        They are known once the best parameters are; from there on the scoped values are solved for exactly.
        """
        return self._with(_weights=weights, _search=EXACT)

    def around(self, p: FloatArray) -> ScopedSimulator:
        """The same, looking for the scoped values near those that are best at one set (1, np)."""
        best = self.best(p)
        values = best.values[0][:, self.columns]
        return self._with(scopes=self.scopes.near([e.name for e in self.experiments], values), _search=EXACT)

    def without_tables(self) -> ScopedSimulator:
        """The same with none of the tables that speed up the next call."""
        return self._with(_scheduler=self._scheduler.without_tables(), _inner=self._inner.without_tables())

    def log_volume(self, p: ArrayLike) -> FloatArray:
        r"""What integrating over the scoped values adds to a negative log likelihood, (N,).

        :math:`\tfrac12 \sum_g \log \det N_g`, in unit coordinates (Laplace; exact where they enter linearly).
        """
        return np.asarray(0.5 * np.sum(np.linalg.slogdet(self.best(p).normal)[1], axis=1))

    @property
    def absorbed(self) -> int:
        """Number of scoped values that are fitted."""
        return int(self.scopes.unknowns([e.name for e in self.experiments]).used.sum())

    def best(self, p: ArrayLike) -> Best:
        """The best scoped values at parameter sets (N, np)."""
        p = self._checked(p)
        key = p.tobytes()
        found = self._known.get(key)
        if found is None:
            found = self._known[key] = self._found(p)
            while len(self._known) > _REMEMBERED:
                self._known.popitem(last=False)
        return found

    def slopes(self, p: ArrayLike) -> FloatArray:
        """Derivatives D of the scoped values of every test by the free parameters, (N, T, L, nf)."""
        best = self.best(p)
        return self._projected(best, *self._full(best)[1:])[0]

    def scoped_slopes(self, p: FloatArray) -> Iterator[FloatArray]:
        """Outputs at one set (1, np) and their derivatives by scoped parameters, (n, ny, 1 + L), test after test."""
        best = self.best(p)
        choices = self._choices(best.values)
        for test, experiment in enumerate(self.experiments):
            yield self._inner.stored([experiment], best.values[:, test], [choices[test]], True)[0][0]

    def one_by_one(self, p: ArrayLike, derivatives: bool) -> Iterator[FloatArray]:
        """Outputs of every test and, with ``derivatives``, their slopes, (N, n, ny, 1 + nf), one after the other."""
        best = self.best(p)
        slopes = self.slopes(p) if derivatives else None
        choices = self._choices(best.values)
        for test, experiment in enumerate(self.experiments):
            (values,) = self._scheduler.stored([experiment], best.values[:, test], [choices[test]], derivatives)
            if slopes is not None:
                count = len(self.free)
                own = values[..., 1 + count :]
                shared = values[..., 1 : 1 + count] + np.einsum("nkyl,nlf->nkyf", own, slopes[:, test])
                values = np.concatenate([values[..., :1], shared], axis=-1)
            yield values

    def one(self, test: int, p: ArrayLike) -> FloatArray:
        """Outputs of one test, by its index, (N, n, ny), with the scoped values that are best for all."""
        values = self.best(p).values
        alone, scheduler = self.select([test]), self._scheduler.without_tables()
        choices = alone._choices(values[:, [test]])
        return scheduler.stored(alone.experiments, values[:, test], choices, False)[0][..., 0]

    def _stored(self, p: ArrayLike, derivatives: bool) -> list[FloatArray]:
        return list(self.one_by_one(p, derivatives))

    def _reduced(self, p: ArrayLike, derivatives: bool) -> FloatArray:
        best = self.best(p)
        if not derivatives:
            return best.cost[..., None]
        cost, gradient, normal = self._full(best)
        return np.concatenate([cost[..., None], *self._projected(best, gradient, normal)[1:]], axis=-1)

    def _choices(self, p: FloatArray) -> list[StepChoice]:
        if p.ndim == 3 and not self._stiff:  # one test's values stand for all
            p = p[:, 0]
        return super()._choices(p)

    def _whole(self, box: Box) -> Box:
        """The box with the whole range of the scoped parameters."""
        lower, upper = (np.array(bound, dtype=float) for bound in box)
        lower[self.columns], upper[self.columns] = self.scopes.space.lower, self.scopes.space.upper
        return lower, upper

    def _full(self, best: Best) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Cost (N, K), gradient and matrix by free and scoped parameters together, the latter in unit coordinates."""
        sums = self._scheduler.reduced(self.experiments, best.values, self._choices(best.values), True)
        cost, gradient, normal = unpacked(self._of_objectives(sums), len(self.free) + len(self.columns))
        slope = np.ones((*gradient.shape[:2], gradient.shape[2]))
        slope[..., len(self.free) :] = self._unit_slopes(best.values)[:, self.objective_tests]
        return cost, gradient * slope, normal * slope[..., None] * slope[..., None, :]

    def _projected(self, best: Best, gradient: FloatArray, normal: FloatArray) -> tuple[FloatArray, ...]:
        """D in values of the scoped parameters (N, T, L, nf), gradient (N, K, nf), upper triangle of the matrix."""
        count, at = len(self.free), self.objective_tests
        weights = self._weights_of(len(at))[:, None, None]
        mixed = best.unknowns.summed_vectors(at, weights * normal[..., count:, :count])
        mixed[best.held()] = 0.0
        unit = best.unknowns.by_test(np.asarray(-np.linalg.solve(best.normal, mixed), dtype=float))  # (N, T, L, nf)
        own = unit[:, at]
        gradient = gradient[..., :count] + np.einsum("nklf,nkl->nkf", own, gradient[..., count:])
        cross = np.einsum("nkfl,nklg->nkfg", normal[..., :count, count:], own)
        inner = np.einsum("nklf,nklm,nkmg->nkfg", own, normal[..., count:, count:], own)
        total = normal[..., :count, :count] + cross + np.swapaxes(cross, -1, -2) + inner
        row, column = np.triu_indices(count)
        return unit * self._unit_slopes(best.values)[..., None], gradient, total[..., row, column]

    @property
    def objective_tests(self) -> NDArray[np.intp]:
        """Test of every objective."""
        return np.array([test for test, _ in objective_pairs(self.experiments)], dtype=np.intp)

    def _weights_of(self, count: int) -> FloatArray:
        return np.ones(count) if self._weights is None else self._weights

    def _unit_slopes(self, values: FloatArray) -> FloatArray:
        """Derivative of the scoped values by their unit coordinates, (N, T, L), at sets (N, T, np)."""
        return self.scopes.space.derivative(values[..., self.columns])

    def _with_scoped(self, p: FloatArray, values: FloatArray) -> FloatArray:
        """Sets (N, np) with scoped values (N, T, L), by test: (N, T, np)."""
        whole = np.repeat(p[:, None], len(self.experiments), axis=1)
        whole[..., self.columns] = values
        return whole

    def _found(self, p: FloatArray) -> Best:
        """Minimise the squares of every group at every set, all together."""

        def sums(rows: NDArray[np.int64], values: FloatArray, wanted: NDArray[np.bool_]) -> FloatArray:
            whole = self._with_scoped(p[rows], values)
            choices = self._choices(whole)
            if not wanted.all():
                choices = [
                    replace(choice, taken=np.where(wanted[:, test], choice.taken, -1))
                    for test, choice in enumerate(choices)
                ]
            return self._of_objectives(self._inner.reduced(self.experiments, whole, choices, True))

        search = ScopedSearch(self.scopes, self.experiments, sums, self._weights_of(len(self.objective_tests)), len(p))
        search.minimise(self._search)
        unit, cost = search.unit, search.cost
        values = self._with_scoped(p, self.scopes.space.from_unit(search.unknowns.by_test(unit)))
        return Best(search.unknowns, unit, values, cost, _solvable(search.normal, search.unknowns.used, unit))


def _solvable(normal: FloatArray, used: NDArray[np.bool_], unit: FloatArray) -> FloatArray:
    """Matrices (N, G, m, m) with 1 for what is unused or at an end of its range, and no direction quite flat."""
    free = used & (unit > 0) & (unit < 1)
    normal = np.where(free[..., None] & free[..., None, :], normal, 0.0)
    trace = np.trace(normal, axis1=-2, axis2=-1) / np.maximum(free.sum(axis=-1), 1)
    most = np.arange(normal.shape[-1])
    normal[..., most, most] += np.where(free, _FLAT * trace[..., None] + np.finfo(float).tiny, 1.0)
    return normal
