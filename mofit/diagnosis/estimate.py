"""Fits as they are told: what the best explanation leaves beyond the noise counts as noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mofit.diagnosis.baseline import Fitted, fit
from mofit.diagnosis.candidates import Candidate
from mofit.diagnosis.observed import Observed, with_discrepancy
from mofit.diagnosis.refit import Explanation
from mofit.diagnosis.several import Attribution


def counting_remainder(
    observed: Observed, remainder: float, found: Attribution, alike: Sequence[Explanation]
) -> Attribution:
    r"""The baseline and the explanations that are told, fitted anew with the remainder counted as noise.

    Weighed by the noise alone, the lines with the least noise decide, though what an explanation misses is no smaller
    there, and intervals hold the noise alone. With the remainder on all lines, relative to the output's range and the
    same in all tests, the estimates come near those of ordinary least squares, and the intervals say how far such a
    remainder moves them. What is significant was decided before, and stays.

    Parameters
    ----------
    observed
        The tests with their own noise.
    remainder
        Root mean square of what the best explanation leaves, relative to the output's range.
    found, alike
        What was tried, and the explanations that are told beside the best.
    """
    noisy = with_discrepancy(observed, remainder, everywhere=True)

    def again(fitted: Fitted) -> Fitted:
        here = fitted.minimum.point[None]
        return fit(replace(fitted.hypothesis, observed=noisy).at_steps_for(here), here)

    told = {id(one) for one in (found.best, *alike)}
    explanations = (replace(one, fitted=again(one.fitted)) if id(one) in told else one for one in found.explanations)
    return replace(found, baseline=again(found.baseline), explanations=tuple(explanations))


def share_left(told: Attribution) -> float:
    """Share of the gap's mean square that the best explanation leaves."""
    left, gap = (_gap(fitted) for fitted in (told.best.fitted, told.baseline))
    return float(np.clip(left / gap, 0.0, 1.0)) if gap > 0 else 0.0


def _gap(fitted: Fitted) -> float:
    observed = fitted.hypothesis.observed
    squares = (fitted.residual[: len(observed.measured)] ** 2 - observed.genuine) * observed.variance
    return float(squares[observed.repeating].sum())


def scaled(candidates: Sequence[Candidate], old: Observed, new: Observed) -> list[Candidate]:
    """Candidates of the same tests with other noise."""
    factor = np.sqrt(old.variance / new.variance)
    found = []
    for one in candidates:
        slopes = one.slopes.copy()
        slopes[:, : len(factor)] *= factor[:, None]
        found.append(replace(one, slopes=slopes))
    return found
