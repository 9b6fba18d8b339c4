"""How a test is integrated, and where its steps lie: between samples, and never across a kink of the inputs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from weakref import WeakKeyDictionary

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from mofit._typing import FloatArray
from mofit.models import System
from mofit.simulation.compiler.evaluate import evaluate
from mofit.simulation.compiler.program import LANE, TIME, Node, Program, pruned, trace
from mofit.simulation.experiment import ExperimentData
from mofit.simulation.integrators import Scheme

#: how often the first sampling interval is halved for implicit schemes: T = 1e-6 of it is resolved
_HALVINGS = 20
#: points per sampling interval at which switches are looked for
_LOOKS = 8
#: parts that the place of a switch is cut into from there on, and how often: to about 1e-16 of the interval
_PARTS, _CUTS = 16, 12
#: sampling intervals that are looked at together: their points take several times the memory of the samples
_PART = 20_000
#: systems whose switch functions are remembered
_REMEMBERED = 256


@dataclass(frozen=True)
class StepLevel:
    """How a test is integrated: the method and its number of steps per sampling interval."""

    scheme: Scheme
    steps: int

    @property
    def cost(self) -> float:
        """Work per sampling interval, relative to one Runge-Kutta step."""
        return self.scheme.cost * self.steps


@dataclass(frozen=True)
class StepChoice:
    """The levels of one test, and the one that each parameter set takes: its place in ``levels``, -1 for none."""

    levels: tuple[StepLevel, ...]
    taken: NDArray[np.intp]

    @classmethod
    def of(cls, levels: Sequence[StepLevel]) -> StepChoice:
        """From the level of every parameter set."""
        known = {level: place for place, level in enumerate(dict.fromkeys(levels))}
        return cls(tuple(known), np.array([known[level] for level in levels], dtype=np.intp))

    @classmethod
    def everywhere(cls, level: StepLevel, count: int) -> StepChoice:
        """One level for all parameter sets."""
        return cls((level,), np.zeros(count, dtype=np.intp))


@dataclass(frozen=True)
class TimeGrid:
    """Steps in order of time, each from ``start`` to ``end``, s.

    Where inputs switch, one step ends just before and the next starts just after. ``counts`` are the steps of every
    sampling interval; the last sample has one too, which leads nowhere.
    """

    start: FloatArray
    end: FloatArray
    counts: NDArray[np.int64]


def build_time_grid(experiment: ExperimentData, level: StepLevel, switches: tuple[FloatArray, FloatArray]) -> TimeGrid:
    """Cut every sampling interval at its switches, and every part into equal steps; switches after the end are ignored.

    With an implicit scheme the first interval is also halved again and again towards its start.
    """
    before, after = (times[switches[1] < (experiment.samples - 1) * experiment.step] for times in switches)
    halves = experiment.step * 0.5 ** np.arange(_HALVINGS, 0, -1) if not level.scheme.explicit else np.empty(0)
    samples = np.arange(experiment.samples + 1) * experiment.step
    ends = np.concatenate([samples[1:], halves, before])
    starts = np.concatenate([samples[:-1], halves, after])
    order = np.argsort(ends, kind="stable")
    ends, starts = ends[order], np.sort(starts)
    # parts shorter than rounding are no parts
    parts = ends - starts > 1e-12 * experiment.step
    starts, ends = starts[parts], ends[parts]
    # in place: of many steps these arrays are several times the samples
    fractions, lengths = np.arange(level.steps + 1) / level.steps, (ends - starts)[:, None]
    first, last = lengths * fractions[:-1], lengths * fractions[1:]
    first += starts[:, None]
    last += starts[:, None]
    last[:, -1] = ends
    interval = np.searchsorted(samples, 0.5 * (starts + ends), side="right") - 1
    counts = np.bincount(interval, minlength=experiment.samples) * level.steps
    return TimeGrid(first.ravel(), last.ravel(), counts.astype(np.int64))


def find_switches(system: System, experiment: ExperimentData) -> tuple[FloatArray, FloatArray]:
    """Times just before and just after a branch of the equations switches, sampling times left out.

    Only switches that inputs and conditions decide alone: they are the same for all parameter
    sets. A step across a kink would be of second order only.
    """
    known, programs = _switches.setdefault(experiment, {}), switch_programs(system)
    if programs not in known:
        for program in (one for one in programs if (one,) not in known):
            known[program,] = _find(program, experiment)
            experiment.forget_curves()
        found = [known[program,] for program in programs]
        low, high = (np.concatenate([np.empty(0), *(times[side] for times in found)]) for side in (0, 1))
        known[programs] = _separate(low, high, experiment.step)
    return known[programs]


#: by test, with which they go, and functions whose sign decides: models that share them share their switches
_switches: WeakKeyDictionary[ExperimentData, dict[tuple[Program, ...], tuple[FloatArray, FloatArray]]] = (
    WeakKeyDictionary()
)


def _find(program: Program, experiment: ExperimentData) -> tuple[FloatArray, FloatArray]:
    """The same for one function whose sign decides."""
    if experiment.samples < 2:
        return np.empty(0), np.empty(0)

    def sides(time: FloatArray) -> FloatArray:
        conditions = np.repeat(np.asarray(experiment.conditions, dtype=float)[:, None], len(time), axis=1)
        unread = np.empty((0, len(time)))
        return np.sign(evaluate(program, [unread, experiment.at(time), unread, conditions]))

    def between(first: int, last: int) -> tuple[FloatArray, FloatArray]:
        time = (np.arange(first * _LOOKS, last * _LOOKS + 1) / _LOOKS) * experiment.step
        look = sides(time)
        which, at = np.nonzero(look[:, :-1] * look[:, 1:] < 0)
        low, high = time[at], time[at + 1]
        column, shares = np.arange(len(at)), np.arange(_PARTS + 1)[:, None] / _PARTS
        for _ in range(_CUTS if len(at) else 0):
            # many points at a time: a call takes longer than its points
            cut = low + shares * (high - low)
            inner = sides(cut[1:-1].ravel()).reshape(len(look), _PARTS - 1, len(at))
            past = look[which, at] != inner[which, :, column].T
            place = np.where(past.any(axis=0), past.argmax(axis=0), _PARTS - 1)
            low, high = cut[place, column], np.append(cut[1:-1], high[None], axis=0)[place, column]
        within = np.flatnonzero(np.any(look == 0, axis=0))
        within = within[within % _LOOKS != 0]  # both parts see their common sample, which is left out
        return np.concatenate([low, time[within]]), np.concatenate([high, time[within]])

    end = experiment.samples - 1
    parts = [between(first, min(first + _PART, end)) for first in range(0, end, _PART)]
    low, high = (np.concatenate(times) for times in zip(*parts, strict=True))
    return _separate(low, high, experiment.step)


def _separate(low: FloatArray, high: FloatArray, step: float) -> tuple[FloatArray, FloatArray]:
    """In order of time, those closer than rounding taken as one."""
    order = np.argsort(low, kind="stable")
    low, high = low[order], high[order]
    new = np.concatenate([[True], np.diff(low) > 1e-9 * step])[: len(low)]
    return low[new], high[new]


@lru_cache(maxsize=_REMEMBERED)
def switch_programs(system: System) -> tuple[Program, ...]:
    """The functions of inputs and conditions whose sign decides a branch."""
    x, u, p, c = system.rhs.sx_in()
    everything = ca.densify(ca.vertcat(system.rhs(x, u, p, c), system.out(x, u, p, c)))
    program = trace(ca.Function("everything", [x, u, p, c], [everything]))
    levels = program.levels((LANE, TIME, LANE, 0))
    nodes, found = list(program.nodes), set()
    for node in program.nodes:
        if node.op in (ca.OP_FABS, ca.OP_SIGN):
            found.add(node.args[0])
        elif node.op in (ca.OP_LT, ca.OP_LE, ca.OP_EQ, ca.OP_NE, ca.OP_FMIN, ca.OP_FMAX):
            nodes.append(Node(ca.OP_SUB, node.args))
            levels.append(levels[node.args[0]] | levels[node.args[1]])
            found.add(len(nodes) - 1)
    roots = sorted(index for index in found if levels[index] == TIME)
    # only what they need, so that models that differ elsewhere have the same programs
    return tuple(dict.fromkeys(pruned(Program(tuple(nodes), ((root,),))) for root in roots))
