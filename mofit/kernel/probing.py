"""Integrating a sample of parameter sets with more and more steps, to see how many they need."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from mofit.kernel.drive import Drive
from mofit.kernel.mesh import Rung
from mofit.kernel.runner import Choice, Runner
from mofit.kernel.steps import RODAS4, Scheme
from mofit.kernel.stiffness import Stiffness
from mofit.model import System

Array = NDArray[np.float64]

#: a long test is integrated on its liveliest stretch of so many samples
_SAMPLES = 2000
#: states at which the stiffness is taken
_PROBES = 24
#: an explicit step longer than this over the stiffness is unstable (RK4: 2.8; the stiffness may lie a little high)
_UNSTABLE = 6.0
#: share of the tolerance that a change by doubling the steps may take
_SHARE = 0.25
#: order of convergence from which the error may be interpolated
_CLEAN = 2.7
#: and up to which: where it seems higher, half as many steps were unstable
_STABLE = 6.0


class Probing:
    """Tests whose outputs are the model's, then its states.

    Parameters
    ----------
    system, drives, free, jobs
        As for `Simulator`.
    """

    def __init__(self, system: System, drives: Sequence[Drive], free: Sequence[str], jobs: int) -> None:
        x, u, p, c = (ca.SX.sym(name, *system.rhs.size_in(name)) for name in ("x", "u", "p", "c"))
        out = ca.Function("out", [x, u, p, c], [ca.vertcat(system.out(x, u, p, c), x)], ["x", "u", "p", "c"], ["y"])
        self.system = system
        self.drives = [_stretch(drive) for drive in drives]
        self.outputs = len(system.outputs)
        self.runner = Runner(
            replace(system, outputs=system.outputs + system.states, out=out), self.drives, free, jobs, lean=True
        )

    def stiffness(self, p: Array) -> Stiffness:
        """The stiffness, probed at states that these parameter sets visit."""
        everything = Choice((Rung(RODAS4, 2),), np.zeros(len(p), dtype=np.intp))
        states = slice(self.outputs, None)
        stored = self.runner.stored(p, [everything] * len(self.drives), derivatives=False, kept=states)
        visited = [values[..., 0] for values in stored]
        usual = [_usual(states) for states in visited[:_PROBES]]
        rng = np.random.default_rng(0)
        columns = []
        for test in (probe % len(self.drives) for probe in range(_PROBES)):
            if len(usual[test]):
                drive = self.drives[test]
                row, sample = rng.choice(usual[test]), rng.integers(drive.samples)
                columns.append((visited[test][row, sample], drive.inputs[sample], drive.conditions))
        columns = columns or [(np.zeros(len(self.system.states)), self.drives[0].inputs[0], self.drives[0].conditions)]
        x, u, c = (np.stack(parts, axis=1).astype(float) for parts in zip(*columns, strict=True))
        return Stiffness(self.system, x, u, c)

    def needed(
        self,
        p: Array,
        scheme: Scheme,
        most: int,
        tolerance: float,
        rate: Array | None = None,
        skip: NDArray[np.bool_] | None = None,
    ) -> Array:
        """Steps per sampling interval that each parameter set needs on each test, shape (N, T).

        Not rounded; infinite if ``most`` are too few, nan where ``skip`` is set. With the stiffness ``rate``
        what is unstable anyhow is not tried.
        """
        result = np.full((len(p), len(self.drives)), np.inf)
        active = np.ones(result.shape, dtype=bool) if skip is None else ~skip
        result[~active] = np.nan
        coarse, last, steps = self._outputs(p, Rung(scheme, 1), active), np.full(result.shape, np.inf), 1
        while steps <= most and active.any():
            lengths = np.array([drive.step for drive in self.drives]) / (2 * steps)
            tried = active if rate is None else active & ~(rate[:, None] * lengths > _UNSTABLE)
            fine = self._outputs(p, Rung(scheme, 2 * steps), tried)
            change = np.stack([_change(a, b) for a, b in zip(coarse, fine, strict=True)], axis=1)
            enough = active & (change <= _SHARE * tolerance)
            result[enough] = _interpolated(steps, change, last, _SHARE * tolerance)[enough]
            active = active & ~enough
            coarse, last, steps = fine, change, 2 * steps
        return result

    def _outputs(self, p: Array, rung: Rung, active: NDArray[np.bool_]) -> list[Array]:
        choices = [Choice((rung,), np.where(active[:, t], 0, -1)) for t in range(len(self.drives))]
        stored = self.runner.stored(p, choices, derivatives=False, kept=slice(self.outputs))
        return [values[..., 0] for values in stored]


def _usual(states: Array) -> NDArray[np.intp]:
    """Parameter sets whose states neither fail nor run away."""
    size = np.max(np.abs(states), axis=1)
    finite = np.all(np.isfinite(size), axis=1)
    if not finite.any():
        return np.empty(0, dtype=np.intp)
    return np.flatnonzero(finite & np.all(size <= 100 * np.median(size[finite], axis=0), axis=1))


def _change(coarse: Array, fine: Array) -> Array:
    """Largest difference relative to the output's range, of every parameter set; infinite if there is none."""
    with np.errstate(invalid="ignore", over="ignore"):
        # an output that hardly moves is held against its size
        size = np.maximum(np.ptp(fine, axis=1), 1e-9 * np.max(np.abs(fine), axis=1))
        difference = np.max(np.abs(coarse - fine), axis=1)
        relative = np.max(difference / np.where(size > 0, size, 1.0), axis=1)
    return np.where(np.isfinite(relative), relative, np.inf)


def _interpolated(steps: int, change: Array, last: Array, allowed: float) -> Array:
    """Number of steps at which the change would be as allowed, from that at ``steps`` and at half as many.

    Where steps cross kinks convergence is slow and erratic, and near the limit of stability it is sudden: nothing is
    taken off there.
    """
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        order = np.full(change.shape, 4.0) if steps == 1 else np.log2(last / change)
        usual = (order > _CLEAN) & (order < _STABLE)
        needed = np.where(usual, steps * (change / allowed) ** (1 / np.minimum(order, 4.0)), steps)
    return np.clip(np.nan_to_num(needed, nan=steps), 0.5 * steps if steps > 1 else 0.1, steps)


def _stretch(drive: Drive) -> Drive:
    """The part of a long test in which its inputs move most."""
    if drive.samples <= _SAMPLES:
        return drive
    starts = np.linspace(0, drive.samples - _SAMPLES, 50).astype(int)
    moves = [np.sum(np.ptp(drive.inputs[start : start + _SAMPLES], axis=0)) for start in starts]
    part = slice(starts[int(np.argmax(moves))], starts[int(np.argmax(moves))] + _SAMPLES)
    return replace(drive, inputs=drive.inputs[part], measured=drive.measured[part], weights=drive.weights[part])
