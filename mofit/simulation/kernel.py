"""A kernel: what one kind of result needs, that is the graph, its tables and its compiled loops."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from mofit._typing import FloatArray
from mofit.models import System
from mofit.simulation.compiler.evaluate import evaluate
from mofit.simulation.compiler.loop import FIXED, Shape, compile_loop
from mofit.simulation.compiler.machine import Code, kept
from mofit.simulation.compiler.program import LANE, Program, contract, trace
from mofit.simulation.compiler.split import Split
from mofit.simulation.experiment import ExperimentData
from mofit.simulation.integrators import GRAPH_INPUTS, Scheme, build_graph, free_first
from mofit.simulation.lane_points import LanePoints, LaneSteps, lane_points
from mofit.simulation.step_points import StepPoints, step_points
from mofit.simulation.time_grid import StepLevel

#: steps whose part of a table is made at once
_PART = 20_000
#: steps that a loop takes until its code is made well: what it loses in them takes about as long, of any program, as
#: both grow with the number of operations
_MANY = 400_000


class Table:
    """What the lanes of a job read: constant, rows, counts and substep rows, see `loop.JOB_FIELDS`."""

    def __init__(self, *arrays: NDArray[np.generic]) -> None:
        self._arrays = arrays  # they live as long as their addresses
        self.addresses = tuple(array.ctypes.data for array in arrays)
        self.nbytes = sum(array.nbytes for array in arrays)
        #: whether some sampling interval takes more than one step
        self.refined = arrays[-1].size > 0


def _program(system: System, scheme: Scheme, free: Sequence[str], derivatives: bool) -> Program:
    """The graph as a program, from the cache where it is kept: building it takes far longer than reading it."""
    order = tuple(free_first(system.parameters, free))
    what = ("program", system.hash(), scheme.digest, order, len(free), derivatives)

    def made() -> bytes:
        return contract(trace(build_graph(system, scheme, free, derivatives)), tuple(GRAPH_INPUTS.values())).serialized

    return Program.deserialized(kept(what, made))


class Kernel:
    """Outputs or, with ``reduce``, weighted sums (cost, Gauss-Newton), by one scheme.

    With ``derivatives`` sensitivities by the ``free`` parameters are propagated. With ``fixed_per_lane`` the other
    parameters differ between lanes, too: the numbers are the same, but fewer of them come from tables.
    """

    def __init__(
        self,
        system: System,
        free: Sequence[str],
        scheme: Scheme,
        derivatives: bool,
        reduce: bool,
        fixed_per_lane: bool = False,
    ) -> None:
        self.system, self.scheme, self.reduce, self.fixed_per_lane = system, scheme, reduce, fixed_per_lane
        self.shape = Shape(len(system.states), len(system.outputs), len(free), derivatives)
        levels, program = tuple(GRAPH_INPUTS.values()), _program(system, scheme, free, derivatives)
        if fixed_per_lane:
            levels = tuple(LANE if index == FIXED else level for index, level in enumerate(levels))
        self.sample = Split(program, levels, (0, 1, 2))
        self.substep = Split(program, levels, (1,))
        #: Loops, and how many steps each of them has taken; code lives as long as it is here.
        self._codes: dict[tuple[bool, int, bool, bool], Code] = {}
        self._taken: dict[tuple[bool, int, bool], int] = {}

    def code(self, refined: bool, lanes: int, steps: int, own_tables: bool = False) -> Code:
        """The compiled loop, with or without further steps within a sampling interval, for so many steps more."""
        # a refined loop takes any time grid
        refined = refined or (True, lanes, own_tables) in self._taken
        loop = (refined, lanes, own_tables)
        self._taken[loop] = self._taken.get(loop, 0) + steps
        quick = self._taken[loop] < _MANY
        if (*loop, quick) not in self._codes:
            split = (self.sample, self.substep if refined else None)
            self._codes[*loop, quick] = compile_loop(*split, self.shape, self.reduce, lanes, own_tables, quick=quick)
        return self._codes[*loop, quick]

    def table(self, experiment: ExperimentData, level: StepLevel, fixed: FloatArray) -> Table:
        """The table of a test for the parameters that all lanes share."""
        points = step_points(self.system, experiment, level)
        shared = {"first": points.first, "fixed": fixed, "condition": experiment.conditions}
        constant, rows = self._evaluated(self.sample, experiment, points, points.begins, shared)
        more, substep_rows = np.empty(0), np.empty((0, 0))
        if not points.evenly:
            more, substep_rows = self._evaluated(self.substep, experiment, points, ~points.begins, shared)
        experiment.forget_curves()
        return Table(np.concatenate([constant, more]), rows, points.counts - 1, substep_rows)

    def table_of_lanes(self, experiments: Sequence[ExperimentData], lanes: int, level: StepLevel) -> Table:
        """The tables of tests side by side, one per lane, where all parameters are those of a lane.

        The last test fills the lanes that are left.
        """
        points = lane_points(self.system, experiments, level)
        parts = [(self.sample, points.begin)]
        if points.further.count:
            parts.append((self.substep, points.further))
        made = [self._of_lanes(split, experiments, lanes, points, steps) for split, steps in parts]
        for experiment in experiments:
            experiment.forget_curves()
        constant, rows = zip(*made, strict=True)
        return Table(np.concatenate(constant), rows[0], points.counts - 1, *rows[1:] or [np.empty((0, 0))])

    def _of_lanes(
        self, split: Split, experiments: Sequence[ExperimentData], lanes: int, points: LanePoints, steps: LaneSteps
    ) -> tuple[FloatArray, FloatArray]:
        """Constant values (values, lanes) and rows (steps, values, lanes) of the tables, for some of the steps."""
        tests = list(zip(experiments, points.own, steps.at, strict=True))

        def everywhere(values: Sequence[FloatArray]) -> FloatArray:
            return np.repeat(np.transpose(values), [len(at) for at in steps.at], axis=1)

        given: dict[str, Callable[[], FloatArray]] = {
            "input": lambda: np.concatenate([own.inputs_of(test, at) for test, own, at in tests], axis=1),
            "input_rate": lambda: np.concatenate([test.derivative(own.start[at]) for test, own, at in tests], axis=1),
            "first": lambda: everywhere([own.first for _, own, _ in tests]),
            "condition": lambda: everywhere([test.conditions for test in experiments]),
            "h": lambda: steps.length[None],
        }
        read, none = split.table.inputs, np.empty((0, len(steps.length)))
        values = evaluate(split.table, [given[name]() if i in read else none for i, name in enumerate(GRAPH_INPUTS)])
        cut = len(split.constant)
        return steps.first(values[:cut], lanes), steps.spread(values[cut:], lanes)

    def _evaluated(
        self,
        split: Split,
        experiment: ExperimentData,
        points: StepPoints,
        which: NDArray[np.bool_],
        shared: Mapping[str, FloatArray],
    ) -> tuple[FloatArray, FloatArray]:
        """Constant values and rows of the table, for some of the steps; ``shared`` is the same in all of them."""
        cut, steps = len(split.constant), np.flatnonzero(which)
        constant, rows = np.empty(cut), np.empty((len(steps), sum(map(len, split.table.outputs)) - cut))
        # in parts, because the points take several times the memory of the table
        for first in range(0, len(steps), _PART):
            part = steps[first : first + _PART]
            values = self._part(split, experiment, points, part, shared)
            constant, rows[first : first + _PART] = values[:cut, 0].copy(), values[cut:].T
        return constant, rows

    def _part(
        self,
        split: Split,
        experiment: ExperimentData,
        points: StepPoints,
        part: NDArray[np.intp],
        shared: Mapping[str, FloatArray],
    ) -> FloatArray:
        """Values of the table, one per column, for some of the steps."""
        count = len(part)

        def everywhere(name: str) -> FloatArray:
            return np.broadcast_to(shared[name][:, None], (len(shared[name]), count))

        # values of a lane, "free" and "state", are never read
        given: dict[str, Callable[[], FloatArray]] = {
            "input": lambda: points.inputs_of(experiment, part),
            "input_rate": lambda: experiment.derivative(points.start[part]),
            **{name: partial(everywhere, name) for name in shared},
            "h": lambda: points.length[None, part],
        }
        read, none = split.table.inputs, np.empty((0, count))
        return evaluate(split.table, [given[name]() if i in read else none for i, name in enumerate(GRAPH_INPUTS)])
