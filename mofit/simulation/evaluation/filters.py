"""What effects do before and behind a simulator, sample after sample."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import casadi as ca
import numpy as np

from mofit._typing import FloatArray
from mofit.models import System
from mofit.simulation.experiment import ExperimentData
from mofit.simulation.scheduler import Scheduler
from mofit.simulation.time_grid import StepChoice, StepLevel


class Filter:
    """A system whose inputs differ from parameter set to parameter set."""

    def __init__(self, system: System) -> None:
        self.system = system
        self._scheduler = Scheduler(system, (), 1) if system.states else None

    def __call__(
        self, experiment: ExperimentData, inputs: Sequence[FloatArray], p: FloatArray, level: StepLevel
    ) -> list[FloatArray]:
        """Outputs (lead + n, ny) of every set of parameters (N, np) with inputs of its own, (lead + n, nu)."""
        return [self._one(experiment, own, values, level) for own, values in zip(inputs, p, strict=True)]

    def _one(self, experiment: ExperimentData, inputs: FloatArray, p: FloatArray, level: StepLevel) -> FloatArray:
        if not np.isfinite(inputs).all():
            return np.full((len(inputs), len(self.system.outputs)), np.nan)
        if self._scheduler is None:
            count = len(inputs)
            x, c = ca.DM.zeros(0, count), ca.repmat(ca.DM(experiment.conditions), 1, count)
            found = self.system.out.map(count)(x, inputs.T, ca.repmat(ca.DM(p), 1, count), c)
            return np.asarray(found).T
        shape = (len(inputs), len(self.system.outputs))
        blank = np.zeros(shape)
        data = replace(experiment, inputs=inputs, measured=blank, weights=blank, origin=None, lead=0)
        scheduler = self._scheduler.without_tables()
        choice = StepChoice.everywhere(level, 1)
        with np.errstate(all="ignore"):
            return np.asarray(scheduler.stored([data], p[None], [choice], False)[0][0, ..., 0])
