"""Models fitted again with what the best one leaves counted as noise: the estimates that are reported."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from mofit.diagnosis.beside import fitted_to
from mofit.diagnosis.candidate_model import CandidateModel
from mofit.diagnosis.model_search import Attribution
from mofit.diagnosis.whitened_data import WhitenedData, with_discrepancy
from mofit.runtime.progress import Progress, silent

#: Share of what the best model explains that another one must explain to be a rival (a third), or nearly so: below, how
#: far exactly its minimum lies changes nothing.
_NEARLY = 0.25


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
    baseline, best = fitted_to(noisy, [found.baseline, found.best.fitted], progress)
    others = [one for one in found.models[1:] if any(one is other for other in reported)]
    explained = baseline.minimum.value - best.minimum.value
    limit = 2 * (baseline.minimum.value - _NEARLY * max(explained, 0.0))
    fits = [best, *fitted_to(noisy, [one.fitted for one in others], progress, limit)]
    again = [found.best, *others]
    fresh = {id(one): replace(one, fitted=fitted) for one, fitted in zip(again, fits, strict=True)}
    return replace(found, baseline=baseline, models=tuple(fresh.get(id(one), one) for one in found.models))
