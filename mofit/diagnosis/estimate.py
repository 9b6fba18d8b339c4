"""Parameters and sizes as they are told: what the best explanation leaves beyond the noise counts as noise."""

from __future__ import annotations

from dataclasses import replace

from mofit.diagnosis.baseline import Fitted, fit
from mofit.diagnosis.observed import Observed, with_discrepancy
from mofit.diagnosis.several import Attribution
from mofit.diagnosis.verdict import Conclusion, named


def counting_remainder(
    observed: Observed, remainder: float, found: Attribution, conclusion: Conclusion
) -> tuple[Fitted, Conclusion]:
    r"""The best explanation and the effects named, fitted anew with the remainder counted as noise.

    Weighed by the noise alone, the lines with the least noise decide, though what an explanation misses is no smaller
    there, and intervals hold the noise alone. With the remainder on all lines, relative to the output's range and the
    same in all tests, the estimates come near those of ordinary least squares, and the intervals say how far such a
    remainder moves them.

    Parameters
    ----------
    observed
        The tests with their own noise.
    remainder
        Root mean square of what is left, relative to the output's range.
    found, conclusion
        What was tried and concluded, with the weights that tests of hypotheses need.

    Returns
    -------
    Fitted, Conclusion
        The best explanation; the conclusion with sizes and intervals from such fits.
    """
    noisy = with_discrepancy(observed, remainder, everywhere=True)

    def again(fitted: Fitted) -> Fitted:
        here = fitted.minimum.point[None]
        return fit(replace(fitted.hypothesis, observed=noisy).at_steps_for(here), here)

    best = again(found.best.fitted)
    alike = [replace(one, fitted=best if one is found.best else again(one.fitted)) for one in conclusion.alike]
    effects = tuple(
        named(next(one for one in alike if effect.name in one.effects), effect.name, effect.probability)
        for effect in conclusion.effects
    )
    return best, replace(conclusion, effects=effects)
