"""How finely a sample of parameter sets must be integrated, measured, and how fast their equations can change."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from mofit._typing import FloatArray
from mofit.models import System
from mofit.simulation.compiler.evaluate import evaluate
from mofit.simulation.compiler.program import Program, trace
from mofit.simulation.experiment import ExperimentData
from mofit.simulation.integrators import RK4, RODAS4, Scheme
from mofit.simulation.scheduler import Scheduler
from mofit.simulation.time_grid import StepChoice, StepLevel

#: the norm is taken of the Jacobian's power 2 ** this
_SQUARINGS = 4


@dataclass(frozen=True)
class StepSettings:
    """How step levels are chosen and parameter sets are probed for it."""

    explicit: tuple[int, ...] = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64)
    """Runge-Kutta steps per sampling interval on offer; work grows by about 1.4 from one to the next."""
    implicit: tuple[int, ...] = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32)
    """Steps of the L-stable method on offer. The last is for where every level resolves some sets, but none all."""
    few: int = 6
    """Up to so many explicit steps the L-stable method is not tried."""
    unresolved: int = 2
    """Implicit steps for sets that no level integrates to the tolerance: fast oscillations with little damping."""
    safety: float = 1.2
    """Factor on the number of steps that the sample needed."""
    ahead: int = 5
    """A level must be enough for so many of the sample's sets beyond a set, and for all up to `stiffer`."""
    stiffer: float = 1.5
    """Factor on the stiffness."""
    beyond: float = 1.2
    """How far beyond the stiffest of the sample its level is trusted."""
    points: int = 64
    """Sobol points of a calibration."""
    corners: int = 64
    """Most corners of the box of a calibration."""
    wide: float = 30.0
    """A box is sampled logarithmically in parameters whose bounds differ by this factor."""
    samples: int = 2000
    """Length of the part of a long test that is integrated, the one in which its inputs move most."""
    probes: int = 24
    """States at which the stiffness is taken."""
    unstable: float = 6.0
    """An explicit step longer than this over the stiffness is unstable (RK4: 2.8; the stiffness is an upper bound)."""
    share: float = 0.25
    """Share of the tolerance by which outputs may change when the steps are doubled."""
    orders: tuple[float, float] = (2.7, 6.0)
    """Observed orders of convergence between which the error is interpolated. A lower one is a sign of kinks, a higher
    one of instability with half as many steps, or of kinks where such steps are stable."""
    kinks: float = 0.9
    """How many steps kinks ask for is chance, not a property of the parameters: this quantile over a box is taken."""
    diverged: float = 100.0
    """A set whose states grow beyond so many times the median diverges."""

    def cheapest(self, explicit: float, implicit: float, otherwise: int) -> StepLevel:
        """The level with least work of those that suffice, else so many implicit steps.

        Needed steps may be infinite, or nan where not tried.
        """
        offers = [
            StepLevel(scheme, next(steps for steps in offered if steps >= needed * self.safety))
            for scheme, offered, needed in ((RK4, self.explicit, explicit), (RODAS4, self.implicit, implicit))
            if needed * self.safety <= offered[-1]
        ]
        return min(offers, key=lambda level: level.cost, default=StepLevel(RODAS4, otherwise))


class Stiffness:
    r"""Fastest rate of the equations at a parameter set, 1/s.

    The largest over the probes of :math:`\|J^{16}\|_\infty^{1/16}`, :math:`J = \partial f / \partial x`. It lies little
    above the spectral radius, whatever the units of the states. The probes are columns of states x, inputs u and
    conditions c.
    """

    def __init__(self, system: System, x: FloatArray, u: FloatArray, c: FloatArray) -> None:
        self.program = _norm_of_power(system)
        self.x, self.u, self.c = x, u, c

    def __call__(self, p: FloatArray) -> FloatArray:
        """Of parameter sets (N, np), shape (N,)."""
        count, probes = len(p), self.x.shape[1]
        x, u, c = (np.tile(block, (1, count)) for block in (self.x, self.u, self.c))
        rates = evaluate(self.program, [x, u, np.repeat(p.T, probes, axis=1), c])
        return np.asarray(np.max(rates[0].reshape(count, probes), axis=1))


def _norm_of_power(system: System) -> Program:
    x, u, p, c = system.rhs.sx_in()
    power = ca.jacobian(system.rhs(x, u, p, c), x)
    for _ in range(_SQUARINGS):
        power = power @ power
    size = ca.SX(0)
    for row in range(len(system.states)):
        size = ca.fmax(size, ca.sum2(ca.fabs(power[row, :])))
    for _ in range(_SQUARINGS):
        size = ca.sqrt(size)
    return trace(ca.Function("stiffness", [x, u, p, c], [ca.densify(size)]))


def changes_stiffness(system: System, names: Sequence[str]) -> bool:
    """Whether parameters enter the Jacobian of the states, which decides on the integration steps."""
    x, u, p, c = system.rhs.sx_in()
    own = ca.vertcat(*(p[system.parameters.index(name)] for name in names))
    return bool(len(system.states)) and bool(ca.depends_on(ca.jacobian(system.rhs(x, u, p, c), x), own))


class StepProbe:
    """Integrates the tests with more and more steps; parameters as for `Simulator`.

    ``origins`` are the tests, or what they were made from (`ExperimentData.origin`).
    """

    settings = StepSettings()

    def __init__(self, system: System, experiments: Sequence[ExperimentData], free: Sequence[str], jobs: int) -> None:
        self.system = system
        self.origins = [experiment.origin or experiment for experiment in experiments]
        self._excerpts = [self._excerpt(experiment) for experiment in experiments]
        # the states are outputs, too
        x, u, p, c = system.rhs.sx_in()
        out = ca.Function("out", [x, u, p, c], [ca.vertcat(system.out(x, u, p, c), x)], ["x", "u", "p", "c"], ["y"])
        extended = replace(system, outputs=system.outputs + system.states, out=out)
        self._scheduler = Scheduler(extended, free, jobs, one_loop=True)

    def stiffness(self, p: FloatArray) -> Stiffness:
        """The stiffness, probed at states that these parameter sets visit."""
        choice = StepChoice.everywhere(StepLevel(RODAS4, 2), len(p))
        tests = range(len(self._excerpts))
        visited = self._stored(tests, p, choice, slice(len(self.system.outputs), None))
        bounded = [self._bounded(states) for states in visited[: self.settings.probes]]
        rng = np.random.default_rng(0)
        columns = []
        for test in (probe % len(self._excerpts) for probe in range(self.settings.probes)):
            if len(bounded[test]):
                experiment = self._excerpts[test]
                row, sample = rng.choice(bounded[test]), rng.integers(experiment.samples)
                columns.append((visited[test][row, sample], experiment.inputs[sample], experiment.conditions))
        first = self._excerpts[0]
        columns = columns or [(np.zeros(len(self.system.states)), first.inputs[0], first.conditions)]
        x, u, c = (np.stack(parts, axis=1).astype(float) for parts in zip(*columns, strict=True))
        return Stiffness(self.system, x, u, c)

    def needed(
        self,
        p: FloatArray,
        scheme: Scheme,
        most: int,
        tolerance: float,
        rate: FloatArray | None = None,
        skip: NDArray[np.bool_] | None = None,
    ) -> tuple[FloatArray, NDArray[np.bool_]]:
        """Steps per sampling interval that each parameter set needs on each test, and where kinks ask for them, (N, T).

        Not rounded; infinite if ``most`` are too few, nan where ``skip`` is set. With the stiffness ``rate`` unstable
        steps are not tried.
        """
        shape = len(p), len(self._excerpts)
        tried = np.ones(shape, dtype=bool) if skip is None else ~skip
        # one test after the other: outputs and tables of all are large
        found = [self._needed(test, p, scheme, most, tolerance, rate, tried[:, test]) for test in range(shape[1])]
        result, kinked = (np.stack(columns, axis=1) for columns in zip(*found, strict=True))
        return result, kinked

    def _needed(
        self,
        test: int,
        p: FloatArray,
        scheme: Scheme,
        most: int,
        tolerance: float,
        rate: FloatArray | None,
        active: NDArray[np.bool_],
    ) -> tuple[FloatArray, NDArray[np.bool_]]:
        """The same on one test, (N,) each, for the sets that are ``active``."""
        allowed, length = self.settings.share * tolerance, self._excerpts[test].step
        result, kinked = np.where(active, np.inf, np.nan), np.zeros(len(p), dtype=bool)
        coarse, last, steps = self._outputs(test, p, StepLevel(scheme, 1), active), np.full(len(p), np.inf), 1
        while steps <= most and active.any():
            unstable = False if rate is None else rate * length / (2 * steps) > self.settings.unstable
            fine = self._outputs(test, p, StepLevel(scheme, 2 * steps), active & ~np.asarray(unstable))
            change = _change(coarse, fine)
            enough = active & (change <= allowed)
            order = _order(steps, change, last)
            with np.errstate(over="ignore"):  # steps that diverge
                relative = change / allowed
            result[enough] = self._interpolated(steps, order, relative)[enough]
            stable = False if rate is None else rate * length / steps < 1
            kinked[active] = ((order < self.settings.orders[0]) | stable & (order > self.settings.orders[1]))[active]
            active = active & ~enough
            coarse, last, steps = fine, change, 2 * steps
        return result, kinked

    def _outputs(self, test: int, p: FloatArray, level: StepLevel, active: NDArray[np.bool_]) -> FloatArray:
        choice = StepChoice((level,), np.where(active, 0, -1))
        return self._stored([test], p, choice, slice(len(self.system.outputs)))[0]

    def _stored(self, tests: Sequence[int], p: FloatArray, choice: StepChoice, kept: slice) -> list[FloatArray]:
        """Outputs of some tests; the tables of so many steps are large, and each is needed once."""
        excerpts, scheduler = [self._excerpts[test] for test in tests], self._scheduler.without_tables()
        stored = scheduler.stored(excerpts, p, [choice] * len(tests), derivatives=False, kept=kept)
        return [values[..., 0] for values in stored]

    def _bounded(self, states: FloatArray) -> NDArray[np.intp]:
        """Parameter sets whose states (N, n, nx) neither fail nor diverge."""
        size = np.max(np.abs(states), axis=1)
        finite = np.all(np.isfinite(size), axis=1)
        if not finite.any():
            return np.empty(0, dtype=np.intp)
        limit = self.settings.diverged * np.median(size[finite], axis=0)
        return np.flatnonzero(finite & np.all(size <= limit, axis=1))

    def _interpolated(self, steps: int, order: FloatArray, change: FloatArray) -> FloatArray:
        """Number of steps at which the change, given relative to what is allowed, would be 1.

        Where steps cross kinks, convergence is slow and erratic; near the limit of stability it is sudden. There the
        number is not reduced.
        """
        lowest, highest = self.settings.orders
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            usual = (order > lowest) & (order < highest)
            needed = np.where(usual, steps * change ** (1 / np.clip(order, lowest, 4.0)), steps)
        return np.clip(np.nan_to_num(needed, nan=steps), 0.5 * steps if steps > 1 else 0.1, steps)

    def _excerpt(self, experiment: ExperimentData) -> ExperimentData:
        """The part of a long test in which its inputs move most, without the lead."""
        length, inputs = self.settings.samples, experiment.inputs[experiment.lead :]
        experiment = replace(experiment, inputs=inputs, lead=0, origin=None) if experiment.lead else experiment
        if experiment.samples <= length:
            return experiment
        starts = np.linspace(0, experiment.samples - length, 50).astype(int)
        moves = [np.sum(np.ptp(experiment.inputs[start : start + length], axis=0)) for start in starts]
        part = slice(starts[int(np.argmax(moves))], starts[int(np.argmax(moves))] + length)
        data = {name: getattr(experiment, name)[part] for name in ("inputs", "measured", "weights")}
        return replace(experiment, origin=None, **data)


def _order(steps: int, change: FloatArray, last: FloatArray) -> FloatArray:
    """Observed order of convergence, from the change at ``steps`` and at half as many; four with one step."""
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        return np.full(change.shape, 4.0) if steps == 1 else np.nan_to_num(np.log2(last / change), nan=4.0)


def _change(coarse: FloatArray, fine: FloatArray) -> FloatArray:
    """Largest difference relative to the output's range, of every parameter set; infinite if there is none."""
    with np.errstate(invalid="ignore", over="ignore"):
        # the change of an output that hardly moves is relative to its size
        size = np.maximum(np.ptp(fine, axis=1), 1e-9 * np.max(np.abs(fine), axis=1))
        difference = np.max(np.abs(coarse - fine), axis=1)
        relative = np.max(difference / np.where(size > 0, size, 1.0), axis=1)
    return np.where(np.isfinite(relative), relative, np.inf)
