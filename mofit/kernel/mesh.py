"""Where the steps of an integration lie: between samples, and never across a kink of the inputs."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from mofit.kernel.drive import Drive
from mofit.kernel.evaluate import evaluate
from mofit.kernel.program import LANE, TIME, Node, Program, trace
from mofit.kernel.steps import Scheme
from mofit.model import System

Array = NDArray[np.float64]

#: how often the first sampling interval is halved for implicit schemes: T = 1e-6 of it is resolved
_HALVINGS = 20
#: points per sampling interval at which switches are looked for
_LOOKS = 8
#: bisections from there; to about 1e-16 of the interval
_BISECTIONS = 48
#: tests whose switches are remembered
_REMEMBERED = 256


@dataclass(frozen=True)
class Rung:
    """How a test is integrated: the method and its number of steps per sampling interval."""

    scheme: Scheme
    steps: int

    def __str__(self) -> str:
        return f"{self.scheme.name} x {self.steps}"

    @property
    def cost(self) -> float:
        """Work per sampling interval, relative to one Runge-Kutta step."""
        return self.scheme.cost * self.steps


@dataclass(frozen=True)
class Mesh:
    """Steps in order of time.

    Parameters
    ----------
    start, end
        Of every step, s. Where inputs switch, one step ends just before and the next starts just after.
    counts
        Number of steps of every sampling interval; the last sample has one too, which leads nowhere.
    """

    start: Array
    end: Array
    counts: NDArray[np.int64]


def build_mesh(drive: Drive, rung: Rung, switches: tuple[Array, Array]) -> Mesh:
    """Cut every sampling interval at its switches, and every part into equal steps.

    With an implicit scheme the first interval is also halved again and again towards its start.
    """
    before, after = switches
    halves = drive.step * 0.5 ** np.arange(_HALVINGS, 0, -1) if not rung.scheme.explicit else np.empty(0)
    samples = np.arange(drive.samples + 1) * drive.step
    ends = np.concatenate([samples[1:], halves, before])
    starts = np.concatenate([samples[:-1], halves, after])
    order = np.argsort(ends, kind="stable")
    ends, starts = ends[order], np.sort(starts)
    # parts shorter than rounding are no parts
    parts = ends - starts > 1e-12 * drive.step
    starts, ends = starts[parts], ends[parts]
    fractions = np.arange(rung.steps + 1) / rung.steps
    edges = starts[:, None] + (ends - starts)[:, None] * fractions
    edges[:, -1] = ends
    interval = np.searchsorted(samples, 0.5 * (starts + ends), side="right") - 1
    counts = np.bincount(interval, minlength=drive.samples) * rung.steps
    return Mesh(edges[:, :-1].ravel(), edges[:, 1:].ravel(), counts.astype(np.int64))


def find_switches(system: System, drive: Drive) -> tuple[Array, Array]:
    """Times just before and just after a branch of the equations switches, sampling times left out.

    Only switches that inputs and conditions decide alone: they are the same for all parameter
    sets. A step across a kink would be of second order only.
    """
    return _find(_switch_program(system), drive)


@lru_cache(maxsize=_REMEMBERED)
def _find(program: Program, drive: Drive) -> tuple[Array, Array]:
    """The same for the functions whose sign decides; models that share them share the answer."""
    count = len(program.outputs[0])
    if count == 0 or drive.samples < 2:
        return np.empty(0), np.empty(0)

    def sides(time: Array) -> Array:
        points = [
            np.empty((0, len(time))),
            drive.at(time),
            np.empty((0, len(time))),
            np.broadcast_to(np.asarray(drive.conditions, dtype=float)[:, None], (len(drive.conditions), len(time))),
        ]
        return np.sign(evaluate(program, points))

    time = (np.arange((drive.samples - 1) * _LOOKS + 1) / _LOOKS) * drive.step
    look = sides(time)
    which, at = np.nonzero(look[:, :-1] * look[:, 1:] < 0)
    low, high = time[at], time[at + 1]
    column = np.arange(len(at))
    for _ in range(_BISECTIONS if len(at) else 0):
        middle = 0.5 * (low + high)
        left = sides(middle)[which, column] == look[which, at]
        low, high = np.where(left, middle, low), np.where(left, high, middle)
    within = np.flatnonzero(np.any(look == 0, axis=0))
    within = within[within % _LOOKS != 0]
    return _separate(np.concatenate([low, time[within]]), np.concatenate([high, time[within]]), drive.step)


def _separate(low: Array, high: Array, step: float) -> tuple[Array, Array]:
    """In order of time, those closer than rounding taken as one."""
    order = np.argsort(low, kind="stable")
    low, high = low[order], high[order]
    new = np.concatenate([[True], np.diff(low) > 1e-9 * step])[: len(low)]
    return low[new], high[new]


@lru_cache(maxsize=_REMEMBERED)
def _switch_program(system: System) -> Program:
    """The functions of inputs and conditions whose sign decides a branch, as one output."""
    x, u, p, c = (ca.SX.sym(name, *system.rhs.size_in(name)) for name in ("x", "u", "p", "c"))
    both = ca.Function("whole", [x, u, p, c], [ca.densify(ca.vertcat(system.rhs(x, u, p, c), system.out(x, u, p, c)))])
    program = trace(both)
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
    whole = Program(tuple(nodes), (tuple(roots),))
    # only what they need, so that models that differ elsewhere have the same program
    kept = sorted(whole.needed(roots))
    place = {index: number for number, index in enumerate(kept)}
    pruned = tuple(nodes[index]._replace(args=tuple(place[arg] for arg in nodes[index].args)) for index in kept)
    return Program(pruned, (tuple(place[index] for index in roots),))
