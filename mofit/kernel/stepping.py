"""Which way to integrate, for every parameter set and test."""

from __future__ import annotations

import copy
from collections import OrderedDict
from collections.abc import Sequence
from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mofit.kernel.drive import Drive
from mofit.kernel.mesh import Rung
from mofit.kernel.probing import Probing
from mofit.kernel.rule import Rule, calibrate, measure
from mofit.kernel.runner import Choice
from mofit.kernel.steps import RK4
from mofit.kernel.stiffness import Stiffness
from mofit.model import System

Array = NDArray[np.float64]

#: measured parameter sets that are remembered
_REMEMBERED = 4096


class Stepping:
    """Fixed, by a calibrated rule, or measured; depends on nothing but the parameter set and the test.

    Parameters
    ----------
    system, drives, free, tolerance, box, steps, jobs
        As for `Simulator`.
    """

    def __init__(
        self,
        system: System,
        drives: Sequence[Drive],
        free: Sequence[str],
        tolerance: float,
        box: tuple[ArrayLike, ArrayLike] | None,
        steps: int | None,
        jobs: int,
    ) -> None:
        # compiled when first needed; shared by all that `within` makes
        self._probing = cache(lambda: Probing(system, drives, free, jobs))
        self._drives = {drive: index for index, drive in enumerate(drives)}
        self._tolerance, self._box = tolerance, box
        # without states there is nothing to integrate
        self._static = not system.states
        self._fixed = 1 if self._static else steps
        self._calibrated: tuple[list[Rule], Stiffness] | None = None
        self._remembered: OrderedDict[bytes, list[Rung]] = OrderedDict()

    def within(self, box: tuple[ArrayLike, ArrayLike], tolerance: float) -> Stepping:
        """The same in another box or to another tolerance."""
        other = copy.copy(self)
        other._tolerance, other._box, other._calibrated, other._remembered = tolerance, box, None, OrderedDict()
        return other

    def fixed(self, steps: int) -> Stepping:
        """The same with a fixed number of Runge-Kutta steps."""
        other = copy.copy(self)
        other._fixed = 1 if self._static else steps
        return other

    @property
    def steps(self) -> int | None:
        """The fixed number of steps; None if they are chosen."""
        return self._fixed

    def with_drives(self, drives: Sequence[Drive], others: Sequence[Drive]) -> Stepping:
        """The same for other drives that are integrated like these."""
        other = copy.copy(self)
        other._drives = self._drives | {new: self._drives[old] for old, new in zip(drives, others, strict=True)}
        return other

    def rules(self, drives: Sequence[Drive]) -> list[Rule]:
        """The rule of each test; none if there is no box to calibrate in."""
        if self._fixed:
            return [Rule((Rung(RK4, self._fixed),))] * len(drives)
        if self._box is None:
            return []
        rules, _ = self._calibration(self._box)
        return [rules[self._drives[drive]] for drive in drives]

    def choices(self, p: Array, drives: Sequence[Drive]) -> list[Choice]:
        """How each test is integrated at parameter sets (N, np)."""
        if self._fixed or not len(p):
            rung = Rung(RK4, self._fixed or 1)
            return [Choice((rung,), np.zeros(len(p), dtype=np.intp))] * len(drives)
        if self._box is None:
            return self._measured(p, drives)
        _, stiffness = self._calibration(self._box)
        rate = stiffness(p)
        return [rule.choose(rate) for rule in self.rules(drives)]

    def _calibration(self, box: tuple[ArrayLike, ArrayLike]) -> tuple[list[Rule], Stiffness]:
        if self._calibrated is None:
            lower, upper = (np.asarray(bound, dtype=float) for bound in box)
            self._calibrated = calibrate(self._probing(), self._tolerance, (lower, upper))
        return self._calibrated

    def _measured(self, p: Array, drives: Sequence[Drive]) -> list[Choice]:
        keys = [row.tobytes() for row in p]
        new = [i for i, key in enumerate(keys) if key not in self._remembered]
        if new:
            found = measure(self._probing(), p[new], self._tolerance)
            for row, i in enumerate(new):
                self._remembered[keys[i]] = [choice.rungs[choice.taken[row]] for choice in found]
        choices = []
        for index in (self._drives[drive] for drive in drives):
            rungs = [self._remembered[key][index] for key in keys]
            known = tuple(dict.fromkeys(rungs))
            choices.append(Choice(known, np.array([known.index(rung) for rung in rungs], dtype=np.intp)))
        while len(self._remembered) > _REMEMBERED:
            self._remembered.popitem(last=False)
        return choices
