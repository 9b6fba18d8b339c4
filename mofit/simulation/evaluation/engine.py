"""Parameter sets through a user's simulator: what `mofit.simulation.scheduler` is for equations."""

from __future__ import annotations

import copy
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from itertools import accumulate

import numpy as np
from numpy.typing import NDArray

from mofit._typing import FloatArray
from mofit.models import BlackBoxSystem, Record
from mofit.simulation.evaluation import Evaluation
from mofit.simulation.evaluation.differences import FINE, Step, find_steps, moved, nodes, slope
from mofit.simulation.evaluation.evaluations import Call, Evaluations
from mofit.simulation.evaluation.filters import Filter
from mofit.simulation.experiment import ExperimentData
from mofit.simulation.integrators import RK4
from mofit.simulation.time_grid import StepChoice, StepLevel

#: Most numbers of outputs that are in memory at once.
_AT_ONCE = 2e7
#: Runge-Kutta steps per sampling interval of the effects around a simulator.
FILTER_STEPS = 4


class BlackBoxEngine:
    """Runs parameter sets through tests; slopes are the function's own, or differences.

    Parameters
    ----------
    system, free
        The simulator with its effects, and the names that results are differentiated by.
    """

    def __init__(self, system: BlackBoxSystem, free: Sequence[str]) -> None:
        self.system, self.free = system, tuple(free)
        self.evaluations: Evaluations = system.box.once(Evaluations)
        self._before = None if system.bare_inputs else Filter(system.before)
        self._behind = None if system.bare_outputs else Filter(system.behind)
        self._seen = [system.inputs.index(channel.name) for channel in system.box.inputs]

    def without_tables(self) -> BlackBoxEngine:
        """The same: it has none; the evaluations stay."""
        return copy.copy(self)

    def reduced(
        self, experiments: Sequence[ExperimentData], p: FloatArray, choices: Sequence[StepChoice], derivatives: bool
    ) -> FloatArray:
        """Sums per set, test and output as of `mofit.simulation.scheduler.Scheduler`, (N, T, ny, terms)."""
        count = len(self.free) * derivatives
        terms = 1 + count + count * (count + 1) // 2
        result = np.full((len(p), len(experiments), len(self.system.outputs), terms), np.nan)
        for rows in self._parts(experiments, p, derivatives):
            own = [replace_taken(choice, rows) for choice in choices]
            found = self._values(experiments, p[rows], own, derivatives, central=self.evaluations.near_minimum)
            for test, (experiment, values) in enumerate(zip(experiments, found, strict=True)):
                result[rows, test] = sums_of(experiment, values)
        return result

    def stored(
        self,
        experiments: Sequence[ExperimentData],
        p: FloatArray,
        choices: Sequence[StepChoice],
        derivatives: bool,
    ) -> list[FloatArray]:
        """Outputs and their derivatives, by central differences, (N, n, ny, 1 + nf) per test."""
        return self._values(experiments, p, choices, derivatives, central=True)

    def simulated(self, experiment: ExperimentData, p: FloatArray) -> FloatArray:
        """What the simulator itself gives in a test at one set (np,), lead included, (lead + n, ny); nan: failed."""
        answer = self._answer(experiment, p)
        lacking = np.full((experiment.samples, len(self.system.box.outputs)), np.nan)
        return lacking if answer.outputs is None else answer.outputs

    def failure(self, experiment: ExperimentData, p: FloatArray) -> str | None:
        """Why the simulator fails in a test at one set (np,); None if it does not."""
        return self._answer(experiment, p).failure

    def _answer(self, experiment: ExperimentData, p: FloatArray) -> Evaluation:
        choice = StepChoice.everywhere(StepLevel(RK4, FILTER_STEPS), 1)
        (answer,) = self.evaluations.run(self._calls(experiment, p[None], choice))
        return answer

    def _parts(self, experiments: Sequence[ExperimentData], p: FloatArray, derivatives: bool) -> Iterator[slice]:
        """The sets in parts that fit into memory."""
        numbers = sum(e.samples for e in experiments) * len(self.system.outputs) * (1 + len(self.free) * derivatives)
        size = max(int(_AT_ONCE // max(numbers, 1)), 1)
        return (slice(start, start + size) for start in range(0, len(p), size))

    def _values(
        self,
        experiments: Sequence[ExperimentData],
        p: FloatArray,
        choices: Sequence[StepChoice],
        derivatives: bool,
        central: bool,
    ) -> list[FloatArray]:
        """Outputs and derivatives of every test, (N, n, ny, 1 + nf); nan where no level is taken."""
        wanted = [choice.taken >= 0 for choice in choices]
        sets = [(p[:, test] if p.ndim == 3 else p)[own] for test, own in enumerate(wanted)]
        if derivatives and self.free and self._own_slopes:
            found = self._with_own_slopes(experiments, sets)
        elif derivatives and self.free:
            found = self._by_differences(experiments, sets, choices, central)
        else:
            found = [values[..., None] for values in self._respond(experiments, sets, choices)]
        result = []
        for own, values in zip(wanted, found, strict=True):
            whole = np.full((len(p), *values.shape[1:]), np.nan)
            whole[own] = values
            result.append(whole)
        return result

    @property
    def _own_slopes(self) -> bool:
        return self.evaluations.offers_slopes and self._before is self._behind is None

    def _with_own_slopes(self, experiments: Sequence[ExperimentData], sets: Sequence[FloatArray]) -> list[FloatArray]:
        calls = [
            self._calls(experiment, own, None, self.free) for experiment, own in zip(experiments, sets, strict=True)
        ]
        answers = self.evaluations.run([call for own in calls for call in own])
        ny, nf, result = len(self.system.outputs), len(self.free), []
        for experiment, own in zip(experiments, calls, strict=True):
            mine, answers = answers[: len(own)], answers[len(own) :]
            values = np.full((len(own), experiment.samples, ny, 1 + nf), np.nan)
            for row, answer in zip(values, mine, strict=True):
                if answer.outputs is not None and answer.slopes is not None:
                    row[..., 0], row[..., 1:] = answer.outputs, answer.slopes
            result.append(values[:, experiment.lead :])
        return result

    def _by_differences(
        self,
        experiments: Sequence[ExperimentData],
        sets: Sequence[FloatArray],
        choices: Sequence[StepChoice],
        central: bool,
    ) -> list[FloatArray]:
        first = next((own[0] for own in sets if len(own)), None)
        if first is None:
            shape = (len(self.system.outputs), 1 + len(self.free))
            return [np.empty((0, experiment.recorded, *shape)) for experiment in experiments]
        steps = self._steps(experiments, first, choices)
        around = [[self._around(values, steps, central) for values in own] for own in sets]
        grids = [np.concatenate([grid for grid, _ in own] or [np.empty((0, len(first)))]) for own in around]
        found = self._respond(experiments, grids, choices)
        rates = [self.system.space.derivative(own)[:, self._columns] for own in sets]
        return [
            np.stack([
                self._table(values, offsets, rate)
                for values, (_, offsets), rate in zip(np.split(flat, len(own)), near, beside, strict=True)
            ])
            if len(own)
            else np.empty((0, *flat.shape[1:], 1 + len(self.free)))
            for own, near, flat, beside in zip(sets, around, found, rates, strict=True)
        ]  # fmt: skip

    @property
    def _columns(self) -> list[int]:
        return [self.system.space.index(name) for name in self.free]

    def _around(
        self, values: FloatArray, steps: Mapping[str, Step], central: bool
    ) -> tuple[FloatArray, list[tuple[float, ...]]]:
        """The sets at and around one (np,), and their offsets by parameter."""
        rows, offsets = [values], []
        for name, column in zip(self.free, self._columns, strict=True):
            one, step = self.system.space.parameters[column], steps[name]
            offsets.append(nodes(one, values[column], step.size, central and step.error > FINE))
            for offset in offsets[-1]:
                rows.append(values.copy())
                rows[-1][column] = moved(one, values[column], offset)
        return np.array(rows), offsets

    def _table(self, values: FloatArray, offsets: Sequence[tuple[float, ...]], rate: FloatArray) -> FloatArray:
        """Outputs and slopes (n, ny, 1 + nf) from the outputs at the points around a set."""
        table, start = np.empty((*values.shape[1:], 1 + len(self.free))), 1
        table[..., 0] = values[0]
        for k, own in enumerate(offsets):
            with np.errstate(all="ignore"):
                table[..., 1 + k] = slope(values[0], list(values[start : start + len(own)]), own) / rate[k]
            start += len(own)
        return table

    def _steps(
        self, experiments: Sequence[ExperimentData], p: FloatArray, choices: Sequence[StepChoice]
    ) -> Mapping[str, Step]:
        """Steps of all free parameters, found at the first point that is asked for."""
        known = self.evaluations.steps
        missing = [name for name in self.free if name not in known]
        if missing:
            respond = partial(self._relative, experiments, choices)
            part = partial(self._relative, experiments[:1], choices[:1])
            known |= find_steps(respond, self.system.space, p, missing, self.system.reaching, part)
        return known

    def _relative(
        self, experiments: Sequence[ExperimentData], choices: Sequence[StepChoice], sets: FloatArray
    ) -> FloatArray:
        """Outputs of tests at sets, each relative to its range, (K, m)."""
        found = self._respond(experiments, [sets] * len(experiments), choices)
        extents = [np.ptp(values[0], axis=0) for values in found]
        relative = [values / np.where(extent > 0, extent, 1.0) for values, extent in zip(found, extents, strict=True)]
        return np.concatenate([values.reshape(len(sets), -1) for values in relative], axis=1)

    def _respond(
        self, experiments: Sequence[ExperimentData], sets: Sequence[FloatArray], choices: Sequence[StepChoice]
    ) -> list[FloatArray]:
        """Outputs (M, n, ny) of every test at sets (M, np) of its own; all simulations are asked for together."""
        calls = [self._calls(*each) for each in zip(experiments, sets, choices, strict=True)]
        answers = self.evaluations.run([call for own in calls for call in own])
        ends = [0, *accumulate(len(own) for own in calls)]
        result = []
        for test, (experiment, own, choice) in enumerate(zip(experiments, sets, choices, strict=True)):
            lacking = np.full((experiment.samples, len(self.system.box.outputs)), np.nan)
            mine = answers[ends[test] : ends[test + 1]]
            simulated = [lacking if answer.outputs is None else answer.outputs for answer in mine]
            if self._behind is not None:
                joined = [np.concatenate([experiment.inputs, one], axis=1) for one in simulated]
                simulated = self._behind(experiment, joined, own, choice.levels[0])
            values = np.stack(simulated) if simulated else lacking[None][:0]
            result.append(values[:, experiment.lead :])
        return result

    def _calls(
        self, experiment: ExperimentData, sets: FloatArray, choice: StepChoice | None, free: tuple[str, ...] = ()
    ) -> list[Call]:
        """The simulations that sets (M, np) of a test ask for."""
        constants = self.system.constants.map(len(sets)) if len(sets) else None
        if constants is None:
            return []
        conditions = np.repeat(experiment.conditions[:, None], len(sets), axis=1)
        seen, count = np.asarray(constants(sets.T, conditions)).T, len(self.system.box.parameters)
        names = [condition.name for condition in self.system.box.conditions]
        if self._before is None:
            known = {bytes(own): own for own in seen[:, count:]}
            records = {
                key: self._record(experiment, None, dict(zip(names, own, strict=True))) for key, own in known.items()
            }
            return [Call(records[bytes(own[count:])], tuple(own[:count].tolist()), free) for own in seen]
        assert choice is not None
        idle = np.zeros((experiment.samples, len(self.system.box.outputs)))
        given = np.concatenate([experiment.inputs, idle], axis=1)
        inputs = self._before(experiment, [given] * len(sets), sets, choice.levels[0])
        return [
            Call(
                self._record(experiment, own, dict(zip(names, row[count:].tolist(), strict=True))),
                tuple(row[:count].tolist()),
            )
            for own, row in zip(inputs, seen, strict=True)
        ]

    def _record(self, experiment: ExperimentData, inputs: FloatArray | None, conditions: dict[str, float]) -> Record:
        """The test as the simulator sees it, with inputs as they are or filtered."""
        seen = experiment.inputs[:, self._seen] if inputs is None else inputs
        columns = {one.name: np.ascontiguousarray(seen[:, k]) for k, one in enumerate(self.system.box.inputs)}
        time = np.asarray(np.arange(experiment.samples) * experiment.step, dtype=float)
        constants = {name: float(value) for name, value in conditions.items()}
        return Record(experiment.name, time, columns, constants, experiment.interpolation)


def replace_taken(choice: StepChoice, rows: slice) -> StepChoice:
    """The choice of some of the sets."""
    return StepChoice(choice.levels, choice.taken[rows])


def sums_of(experiment: ExperimentData, values: FloatArray) -> FloatArray:
    """Cost, gradient and upper triangle of the Gauss-Newton matrix per set and output, (N, ny, terms)."""
    residual, slopes = values[..., 0] - experiment.measured, values[..., 1:]
    weights: NDArray[np.float64] = experiment.weights
    # a sample without weight may be anything
    residual = np.where(weights > 0, residual, 0.0)
    slopes = np.where(weights[..., None] > 0, slopes, 0.0)
    weighted = weights[..., None] * slopes
    cost = np.einsum("ky,nky->ny", weights, residual**2)[..., None]
    gradient = np.einsum("nkyf,nky->nyf", weighted, residual)
    row, column = np.triu_indices(slopes.shape[-1])
    matrix = np.einsum("nkyf,nkyg->nyfg", weighted, slopes, optimize=True)[..., row, column]
    return np.concatenate([cost, gradient, matrix], axis=-1)
