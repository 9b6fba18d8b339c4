"""Batches of parameter sets through all tests: outputs, cost, Gauss-Newton terms, sensitivities."""

from __future__ import annotations

import copy
from collections import OrderedDict
from collections.abc import Iterator, Sequence
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mofit._typing import FloatArray
from mofit.errors import InputError, Issue, did_you_mean, raise_errors
from mofit.models import System
from mofit.simulation.engines import engine_for, steps_for
from mofit.simulation.experiment import ExperimentData, objective_pairs
from mofit.simulation.integrators import RK4
from mofit.simulation.step_probing import StepProbe
from mofit.simulation.step_selection import Box, StepRule, StepSelection
from mofit.simulation.time_grid import StepChoice, StepLevel

#: Bytes of results that are remembered.
_RECENT_BYTES = 3e7
#: Tests, steps and sets, with the outputs and slopes of every test; the longest unused first.
_Recent = OrderedDict[tuple[tuple[ExperimentData, ...], int, tuple[int, ...], bytes], list[FloatArray]]


class Simulator:
    """Runs batches of parameter sets through tests.

    Parameters
    ----------
    system
        The model in vector form.
    experiments
        The tests.
    free
        Names of the parameters that results are differentiated by (default: all).
    jobs
        Number of threads. Results are the same, bit for bit, for any number.
    tolerance
        Allowed error of the integration relative to the range of the outputs.
    box
        Bounds (lower, upper) of all parameters, in which sets will lie. A rule then chooses the method and its number
        of steps; it is calibrated once, at first use. Without a box both are measured for each set, which takes
        several times as long as the results themselves.
    steps
        Fixed number of Runge-Kutta steps per sampling interval instead.
    fixed_per_lane
        Whether tables hold nothing of the parameters that are not free: faster where these change from call to call.
        Results are the same, bit for bit.

    Raises
    ------
    InputError
        If a test does not fit the system, or a free parameter is unknown.
    """

    def __init__(
        self,
        system: System,
        experiments: Sequence[ExperimentData],
        free: Sequence[str] | None = None,
        *,
        jobs: int = 1,
        tolerance: float = 1e-6,
        box: Box | None = None,
        steps: int | None = None,
        fixed_per_lane: bool = False,
    ) -> None:
        self.system, self.experiments, self.tolerance = system, tuple(experiments), tolerance
        self.free = tuple(system.parameters if free is None else free)
        unknown = [name for name in self.free if name not in system.parameters]
        raise_errors(
            [Issue(f"parameter '{name}'", "unknown name", did_you_mean(name, system.parameters)) for name in unknown]
            + [issue for experiment in self.experiments for issue in experiment.issues(system)]
            + self._box_issues(box)
        )
        #: Fixed number of Runge-Kutta steps per sampling interval; None if they are chosen.
        self.steps = steps_for(system, steps)
        self._jobs = jobs
        self._scheduler = engine_for(system, self.free, jobs, fixed_per_lane=fixed_per_lane)
        # compiled when first needed, shared by all that `within` makes
        tests, names = self.experiments, self.free
        self._probe = cache(lambda: StepProbe(system, tests, names, jobs))
        self._selection = StepSelection(self._probe, box, tolerance)
        self._recent: _Recent = OrderedDict()

    def _with(self, **changes: Any) -> Simulator:
        other = copy.copy(self)
        vars(other).update(changes)
        return other

    def select(self, index: Sequence[int]) -> Simulator:
        """The same on some of the tests; compiled code and calibration are shared."""
        return self._with(experiments=tuple(self.experiments[i] for i in index))

    def within(self, box: Box, tolerance: float | None = None) -> Simulator:
        """The same for sets in another box (or to another tolerance), e.g. around a minimum; code is shared.

        A small box takes fewer steps: its rule need not cover the stiffest corner of a large one.
        """
        raise_errors(self._box_issues(box))
        tolerance = self.tolerance if tolerance is None else tolerance
        return self._with(tolerance=tolerance, _selection=StepSelection(self._probe, box, tolerance))

    def with_free(self, free: Sequence[str], box: Box, tolerance: float) -> Simulator:
        """The same tests with other free parameters."""
        return Simulator(self.system, self.experiments, free, jobs=self._jobs, tolerance=tolerance, box=box)

    def with_steps(self, steps: int) -> Simulator:
        """The same with a fixed number of Runge-Kutta steps per sampling interval; code is shared."""
        return self._with(steps=steps_for(self.system, steps))

    def with_experiments(self, experiments: Sequence[ExperimentData]) -> Simulator:
        """The same on other tests; code is shared.

        Unless the number of steps is fixed, each must come from one of the former tests (`ExperimentData.changed`),
        whose step levels it keeps.
        """
        raise_errors(issue for experiment in experiments for issue in experiment.issues(self.system))
        return self._with(experiments=tuple(experiments))

    def weighted(self, weights: FloatArray) -> Simulator:
        """The same for other weights of the objectives (K,), which decide where some share a scoped parameter."""
        return self

    def around(self, p: FloatArray) -> Simulator:
        """The same for sets around one, (1, np): its scoped parameters are looked for near those of that one."""
        return self

    def log_volume(self, p: FloatArray) -> FloatArray:
        """What integrating over scoped parameters adds to a negative log likelihood at sets (N, np), (N,)."""
        return np.zeros(len(p))

    @property
    def absorbed(self) -> int:
        """Number of values of scoped parameters that are fitted along."""
        return 0

    def without_tables(self) -> Simulator:
        """The same with nothing of what speeds up the next call, tables and results: frees memory; code is shared."""
        return self._with(_scheduler=self._scheduler.without_tables(), _recent=OrderedDict())

    @property
    def rules(self) -> list[StepRule]:
        """How each test is integrated, by stiffness; empty without a ``box``."""
        if self.steps:
            return [StepRule((StepLevel(RK4, self.steps),))] * len(self.experiments)
        return self._selection.rules(self.experiments)

    def simulate(self, p: ArrayLike) -> list[FloatArray]:
        """Outputs of every test, each (N, n, ny), for parameter sets ``p`` of shape (N, np)."""
        return [values[..., 0] for values in self._stored(p, derivatives=False)]

    def sensitivities(self, p: ArrayLike) -> list[tuple[FloatArray, FloatArray]]:
        """Outputs (N, n, ny) and their derivatives by the free parameters (N, n, ny, nf), of every test.

        With a fixed number of steps each test may have its own sets: ``p`` is (N, T, np). Then results are not to be
        changed: the last ones are given again.
        """
        return [(values[..., 0], values[..., 1:]) for values in self.outputs_with_slopes(p)]

    def outputs_with_slopes(self, p: ArrayLike) -> list[FloatArray]:
        """The `sensitivities` of every test in one array, the outputs first, (N, n, ny, 1 + nf).

        Where a minimum is judged, they are asked for again and again: the last ones are kept.
        """
        p = self._checked(p)
        if not self.steps:
            return self._stored(p, derivatives=True)
        key = (self.experiments, self.steps, p.shape, p.tobytes())
        found = self._recent.pop(key, None) or self._among_recent(p) or self._stored(p, derivatives=True)
        for values in found:
            values.flags.writeable = False
        self._recent[key] = found
        while sum(values.nbytes for kept in self._recent.values() for values in kept) > _RECENT_BYTES:
            self._recent.popitem(last=False)
        return found

    def _among_recent(self, p: FloatArray) -> list[FloatArray] | None:
        """The results of a single set that was one of several: of a minimum, among the trial points of a descent."""
        if len(p) > 1:
            return None
        single = p.tobytes()
        for (experiments, steps, shape, sets), found in reversed(self._recent.items()):
            if (experiments, steps, shape[1:]) == (self.experiments, self.steps, p.shape[1:]):
                for number in range(shape[0]):
                    if sets[number * len(single) : (number + 1) * len(single)] == single:
                        return [values[number : number + 1].copy(order="K") for values in found]
        return None

    def cost(self, p: ArrayLike) -> FloatArray:
        r"""Weighted squares :math:`\sum_k w_{ky} (y_{ky} - m_{ky})^2` per set and objective, (N, T); nan: failed.

        The objectives are the pairs of a test and an output of `objective_pairs`: with one output one per test.
        """
        return self._reduced(p, derivatives=False)[..., 0]

    def gauss_newton(self, p: ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray]:
        r"""Cost (N, T), :math:`J^T W r` (N, T, nf) and :math:`J^T W J` (N, T, nf, nf), with J = dy/dfree."""
        return unpacked(self._reduced(p, derivatives=True), len(self.free))

    def _box_issues(self, box: Box | None) -> list[Issue]:
        names = self.system.parameters
        return [
            Issue(f"box, {which} bounds", f"shape {np.shape(bound)}, not ({len(names)},)", f"Bound {', '.join(names)}")
            for which, bound in zip(("lower", "upper"), box or (), strict=False)
            if np.shape(bound) != (len(names),)
        ]

    def one_by_one(self, p: ArrayLike, derivatives: bool) -> Iterator[FloatArray]:
        """Outputs and, with ``derivatives``, their slopes, (N, n, ny, 1 + nf), of one test after the other.

        Those of all tests together can be large.
        """
        for test in range(len(self.experiments)):
            yield self.select([test])._stored(p, derivatives).pop()  # a list would hold them until the next

    def one(self, test: int, p: ArrayLike) -> FloatArray:
        """Outputs of one test, by its index, (N, n, ny), as in `simulate`; no table is kept for it."""
        return self.select([test]).without_tables().simulate(p)[0]

    def _stored(self, p: ArrayLike, derivatives: bool) -> list[FloatArray]:
        p = self._checked(p)
        return self._scheduler.stored(self.experiments, p, self._choices(p), derivatives)

    def _reduced(self, p: ArrayLike, derivatives: bool) -> FloatArray:
        p = self._checked(p)
        return self._of_objectives(self._scheduler.reduced(self.experiments, p, self._choices(p), derivatives))

    def _of_objectives(self, sums: FloatArray) -> FloatArray:
        """Sums (N, T, ny, terms) as those of the objectives, (N, K, terms); nan where a simulation failed."""
        sets, tests, outputs, terms = sums.shape
        places = [test * outputs + output for test, output in objective_pairs(self.experiments)]
        sums = np.take(sums.reshape(sets, tests * outputs, terms), places, axis=1)  # in C order, as the sums were
        sums[~np.isfinite(sums[..., 0])] = np.nan
        return sums

    def _choices(self, p: FloatArray) -> list[StepChoice]:
        """How each test is integrated at parameter sets (N, np)."""
        if self.steps or not len(p):
            return [StepChoice.everywhere(StepLevel(RK4, self.steps or 1), len(p))] * len(self.experiments)
        return self._selection.choices(p, self.experiments)

    def _checked(self, p: ArrayLike) -> FloatArray:
        p = np.ascontiguousarray(np.atleast_2d(np.asarray(p, dtype=float)))
        by_test = p.ndim == 3 and self.steps and p.shape[1] == len(self.experiments)
        if not (p.ndim == 2 or by_test) or p.shape[-1] != len(self.system.parameters):
            raise InputError.of(
                "parameter sets",
                f"shape {p.shape} does not end in {len(self.system.parameters)}",
                f"Give one column per parameter: {', '.join(self.system.parameters)}",
            )
        return p


def unpacked(sums: FloatArray, count: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Cost (N, K), gradient (N, K, count) and matrix (N, K, count, count) from the sums of a kernel."""
    normal = np.empty((*sums.shape[:2], count, count))
    row, column = np.triu_indices(count)
    normal[..., row, column] = normal[..., column, row] = sums[..., 1 + count :]
    return sums[..., 0], sums[..., 1 : 1 + count], normal
