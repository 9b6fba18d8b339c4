"""Models fitted again with what the best one leaves counted as noise: the estimates that are reported."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from mofit.diagnosis.beside import fitted_to
from mofit.diagnosis.candidate_model import CandidateModel
from mofit.diagnosis.model_search import Attribution
from mofit.diagnosis.whitened_data import WhitenedData, with_discrepancy
from mofit.runtime.progress import Progress, silent


def with_final_estimates(
    found: Attribution,
    observed: WhitenedData,
    remainder: float,
    reported: Sequence[CandidateModel],
    progress: Progress = silent,
) -> Attribution:
    r"""The baseline and the reported models fitted again with what the best one leaves counted as noise.

    Weighted by the noise alone, the lines with the least noise decide, though what a model misses is no smaller there,
    and intervals hold the noise alone. With the remainder on all lines, relative to the output's range and the same in
    all tests, the estimates come near those of ordinary least squares, and the intervals say how far such a remainder
    moves them. What is significant was decided before, and stays.

    Parameters
    ----------
    found, reported
        What was tried; the models that are reported beside the best.
    observed
        The tests with their own noise.
    remainder
        Root mean square of what the best model leaves, relative to the output's range.
    """
    noisy = with_discrepancy(observed, remainder, everywhere=True)
    kept = {id(one) for one in (found.best, *reported)}
    again = [one for one in found.models if id(one) in kept]
    baseline, *fits = fitted_to(noisy, [found.baseline, *(one.fitted for one in again)], progress)
    fresh = {id(one): replace(one, fitted=fitted) for one, fitted in zip(again, fits, strict=True)}
    return replace(found, baseline=baseline, models=tuple(fresh.get(id(one), one) for one in found.models))
