"""Compiled models, kept: many hypotheses, and many campaigns, need the same ones."""

from __future__ import annotations

from collections.abc import Sequence

from mofit.kernel import Drive, Simulator
from mofit.model import Model, System, build_system


class Workshop:
    """Builds simulators, and compiles each model only once.

    Parameters
    ----------
    jobs
        Threads; results do not depend on it.
    """

    def __init__(self, jobs: int = 1) -> None:
        self.jobs = jobs
        self._kept: dict[tuple[str, tuple[str, ...]], Simulator] = {}

    def simulator(
        self, model: Model, drives: Sequence[Drive], free: Sequence[str], steps: int
    ) -> tuple[System, Simulator]:
        """The model in vector form, and its simulator on these tests with a fixed number of Runge-Kutta steps."""
        system = build_system(model)
        key = (system.hash(), tuple(free))
        if key not in self._kept:
            self._kept[key] = Simulator(system, drives, free, jobs=self.jobs, steps=steps)
        return system, self._kept[key].on_tests(drives, steps)
