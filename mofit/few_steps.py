"""Integration in few steps around one point, made right by defect correction."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mofit.kernel import Drive
from mofit.problem import Problem

Array = NDArray[np.float64]

#: Steps per sampling interval that are tried.
STEPS = (1, 2)
#: Standard deviations along every parameter within which the correction must hold.
CHECKED = 4.0


def star(point: Array, spread: Array) -> Array:
    """The point (d,) and those at `CHECKED` standard deviations (d,) from it along every parameter, (2 d + 1, d)."""
    arms = CHECKED * np.diag(spread)
    return np.clip(np.concatenate([point[None], point + arms, point - arms]), 0.0, 1.0)


def in_few_steps(problem: Problem, point: Array, spread: Array) -> Problem:
    """The same problem for sampling around one point (d,) with standard deviations (d,), integrated in few steps.

    What few steps do wrong at the point is added to the data, so that only the *change* of that defect from there is an
    error. Where it exceeds the problem's tolerance at 4 standard deviations along any parameter, the problem is
    returned as it is.
    """
    values = problem.full(star(point, spread))
    exact = problem.simulator.simulate(values)
    for steps in STEPS:
        quick = problem.simulator.with_steps(steps)
        defects = [few - many for few, many in zip(quick.simulate(values), exact, strict=True)]
        if all(
            _steady(drive, defect, problem.simulator.tolerance)
            for drive, defect in zip(problem.drives, defects, strict=True)
        ):
            drives = tuple(
                replace(drive, measured=drive.measured + defect[0])
                for drive, defect in zip(problem.drives, defects, strict=True)
            )
            return replace(problem, simulator=quick.with_drives(drives), drives=drives)
    return problem


def _steady(drive: Drive, defects: Array, tolerance: float) -> bool:
    """Whether defects (N, n, ny) of a test are those of the first set, within the tolerance times the range."""
    judged = drive.weights > 0
    change = np.where(judged, np.abs(defects - defects[0]), 0.0).max(axis=(0, 1))
    measured = np.where(judged, drive.measured, np.nan)
    return bool(np.all(change <= tolerance * (np.nanmax(measured, axis=0) - np.nanmin(measured, axis=0))))
