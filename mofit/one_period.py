"""One steady period that stands for all, made right around one point by folding the data."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mofit.few_steps import star
from mofit.kernel import Drive
from mofit.problem import Problem

Array = NDArray[np.float64]

#: Periods that may be needed until the sampling repeats, too, and how far from a sample that may end.
_MOST_PERIODS, _OFF_SAMPLE = 10, 0.02


def in_one_period(problem: Problem, point: Array, spread: Array) -> Problem:
    r"""The same problem for sampling around one point (d,) with standard deviations (d,), its tests cut short.

    Where the change of a response from the one at the point, :math:`\delta_k = y_k(u) - y_k(u_0)`, repeats with the
    period, the last samples simulated stand for all later ones of their phase, with their weights and their mean
    residual:

    .. math:: \sum_k w_k (y_k - m_k)^2 = \sum_j W_j (y_j - \bar m_j)^2 + \text{const}, \quad
              W_j = \sum_{k \sim j} w_k, \quad
              \bar m_j = y_j(u_0) + \frac{1}{W_j} \sum_{k \sim j} w_k (m_k - y_k(u_0))

    A test is cut where that holds to the problem's tolerance at 4 standard deviations along any parameter; one whose
    response never settles, or that does not repeat, is left as it is.
    """
    around = problem.simulate(star(point, spread))
    drives = tuple(
        _cut(drive, outputs, record.period, problem.simulator.tolerance)
        for drive, outputs, record in zip(problem.drives, around, problem.records, strict=True)
    )
    return replace(problem, simulator=problem.simulator.with_drives(drives), drives=drives)


def _cut(drive: Drive, outputs: Array, period: float | None, tolerance: float) -> Drive:
    """A test without the samples that repeat; outputs (N, n, ny) at the point and around it."""
    judged = np.flatnonzero(drive.weights.any(axis=1))
    if period is None or not len(judged) or not np.isfinite(outputs).all():
        return drive
    whole = np.arange(1, _MOST_PERIODS + 1) * period / drive.step
    fitting = whole[np.abs(whole - np.round(whole)) < _OFF_SAMPLE]
    if not len(fitting):
        return drive
    repeat, end = round(fitting[0]), judged[-1] + 1
    change = outputs - outputs[0]
    allowed = tolerance * np.ptp(drive.measured[judged], axis=0)
    for start in range(0, end - 2 * repeat + 1, max(repeat // 4, 1)):
        later = np.arange(start + repeat, end)
        phase = start + (later - start) % repeat
        if np.all(np.abs(change[:, later] - change[:, phase]) <= allowed):
            return _folded(drive, outputs[0], later, phase)
    return drive


def _folded(drive: Drive, response: Array, later: NDArray[np.intp], phase: NDArray[np.intp]) -> Drive:
    """The test up to its first later sample, what those say added to the samples of their phase."""
    end = later[0]
    weights, pull = drive.weights[:end].copy(), (drive.weights * (drive.measured - response))[:end]
    np.add.at(weights, phase, drive.weights[later])
    np.add.at(pull, phase, drive.weights[later] * (drive.measured[later] - response[later]))
    mean = np.divide(pull, weights, out=np.zeros_like(pull), where=weights > 0)
    measured = np.where(weights > 0, response[:end] + mean, 0.0)
    return replace(drive, inputs=drive.inputs[:end], measured=measured, weights=weights)
