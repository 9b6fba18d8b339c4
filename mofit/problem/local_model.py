"""Simulation made quick around one point: one period that stands for all, few steps with defect correction."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mofit._typing import FloatArray
from mofit.simulation import ExperimentData, Simulator

#: Standard deviations along every parameter within which a shortcut must hold.
CHECKED = 4.0
#: Steps per sampling interval that are tried: kinks may need many, and the defect saves half of them at best.
STEPS = (1, 2, 4, 8, 16)
#: Periods that may be needed until the sampling repeats, too, and how far from a sample that may end.
_MOST_PERIODS, _OFF_SAMPLE = 10, 0.02


def star(point: FloatArray, sd: FloatArray) -> FloatArray:
    """The point (d,) and those at `CHECKED` standard deviations (d,) from it along every parameter, (2 d + 1, d)."""
    arms = CHECKED * np.diag(sd)
    return np.clip(np.concatenate([point[None], point + arms, point - arms]), 0.0, 1.0)


def fold_periods(
    simulator: Simulator, experiments: Sequence[ExperimentData], periods: Sequence[float | None], values: FloatArray
) -> tuple[Simulator, tuple[ExperimentData, ...]]:
    r"""Cut tests short where the response around a point repeats with the period (period-synchronous averaging).

    Where the change of a response from the one at the point, :math:`\delta_k = y_k(u) - y_k(u_0)`, repeats, the last
    samples simulated stand for all later ones of their phase, with their weights and their mean residual:

    .. math:: \sum_k w_k (y_k - m_k)^2 = \sum_j W_j (y_j - \bar m_j)^2 + \text{const}, \quad
              W_j = \sum_{k \sim j} w_k, \quad
              \bar m_j = y_j(u_0) + \frac{1}{W_j} \sum_{k \sim j} w_k (m_k - y_k(u_0))

    A test is cut where that holds to the simulator's tolerance at all parameter sets; one whose response never
    settles, or that does not repeat, is left as it is.

    Parameters
    ----------
    simulator, experiments
        The tests.
    periods
        Period of each test in s, None where it has none.
    values
        Parameter sets (K, p): the point first, then those at which the shortcut must hold (`star`).
    """
    responses = simulator.one_by_one(values, False)
    # the responses of a test are handed on, not held: they go before those of the next one come
    cut = tuple(
        _cut(experiment, next(responses)[..., 0], period, simulator.tolerance)
        for experiment, period in zip(experiments, periods, strict=True)
    )
    return simulator.with_experiments(cut), cut


def coarse_steps(
    simulator: Simulator, experiments: Sequence[ExperimentData], values: FloatArray
) -> tuple[Simulator, tuple[ExperimentData, ...]]:
    """Integrate in few steps, with defect correction: what few steps do wrong at the point is added to the data.

    Only the *change* of that defect is an error then. Where it exceeds the simulator's tolerance at any of the
    parameter sets (K, p), of which the first is the point, for all numbers of steps that would be quicker, nothing is
    changed.
    """
    present = [rule.levels[0].cost for rule in simulator.rules]
    work = np.average(present, weights=[experiment.samples for experiment in experiments])
    for steps in (steps for steps in STEPS if steps < work):
        quick = simulator.with_steps(steps)
        coarse, fine = quick.one_by_one(values, False), simulator.one_by_one(values, False)
        corrected = []
        for experiment in experiments:
            defect = (next(coarse) - next(fine))[..., 0]
            if not _constant(experiment, defect, simulator.tolerance):
                break
            corrected.append(experiment.changed(measured=experiment.measured + defect[0]))
        else:
            return quick.with_experiments(corrected), tuple(corrected)
    return simulator, tuple(experiments)


def _constant(experiment: ExperimentData, defects: FloatArray, tolerance: float) -> bool:
    """Whether defects (K, n, ny) of a test are those of the first set, within the tolerance times the range."""
    if not np.isfinite(defects).all():
        return False
    seen = list(experiment.fitted)
    used, defects = experiment.weights[:, seen] > 0, defects[..., seen]
    change = np.where(used, np.abs(defects - defects[0]), 0.0).max(axis=(0, 1))
    measured = np.where(used, experiment.measured[:, seen], np.nan)
    return bool(np.all(change <= tolerance * (np.nanmax(measured, axis=0) - np.nanmin(measured, axis=0))))


def _cut(experiment: ExperimentData, outputs: FloatArray, period: float | None, tolerance: float) -> ExperimentData:
    """A test without the samples that repeat; outputs (K, n, ny) at the point and around it."""
    used = np.flatnonzero(experiment.weights.any(axis=1))
    if period is None or not len(used) or not np.isfinite(outputs).all():
        return experiment
    whole = np.arange(1, _MOST_PERIODS + 1) * period / experiment.step
    fitting = whole[np.abs(whole - np.round(whole)) < _OFF_SAMPLE]
    if not len(fitting):
        return experiment
    repeat, end = round(fitting[0]), used[-1] + 1
    seen = list(experiment.fitted)
    allowed = tolerance * np.ptp(experiment.measured[used][:, seen], axis=0)
    for start in range(0, end - 2 * repeat + 1, max(repeat // 4, 1)):
        later = np.arange(start + repeat, end)
        phase = start + (later - start) % repeat
        # one set after the other: all of them are many times the record
        changes = ((response - outputs[0])[:, seen] for response in outputs)
        if all(np.all(np.abs(change[later] - change[phase]) <= allowed) for change in changes):
            return _folded(experiment, outputs[0], later, phase)
    return experiment


def _folded(
    experiment: ExperimentData, response: FloatArray, later: NDArray[np.intp], phase: NDArray[np.intp]
) -> ExperimentData:
    """The test up to its first later sample; the residuals of later ones are added to the samples of their phase."""
    end = later[0]
    weights = experiment.weights[:end].copy()
    weighted = (experiment.weights * (experiment.measured - response))[:end]
    np.add.at(weights, phase, experiment.weights[later])
    np.add.at(weighted, phase, experiment.weights[later] * (experiment.measured[later] - response[later]))
    mean = np.divide(weighted, weights, out=np.zeros_like(weighted), where=weights > 0)
    measured = np.where(weights > 0, response[:end] + mean, 0.0)
    return experiment.changed(inputs=experiment.inputs[: experiment.lead + end], measured=measured, weights=weights)
