"""What became of every candidate: fitted, not needed, or not fitted because something failed."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from mofit.diagnosis.candidate_model import CandidateModel
from mofit.diagnosis.score_test import ScoreTest

Outcome = Literal["fitted", "not needed", "could not be fitted"]
#: Confounding from which tests hardly show an effect.
_HIDDEN = 0.99


@dataclass(frozen=True)
class Account:
    """What became of a candidate, and why.

    Parameters
    ----------
    name
        Of the effect.
    outcome
        What became of it.
    reason
        A clause for people.
    statistic
        Its score statistic at the baseline; None where it could not be computed.
    """

    name: str
    outcome: Outcome
    reason: str
    statistic: float | None = None


def accounts_of(
    scores: Sequence[ScoreTest],
    models: Sequence[CandidateModel],
    failed: Mapping[tuple[str, ...], str],
    passed_over: Mapping[str, str],
) -> tuple[Account, ...]:
    """One per candidate.

    Parameters
    ----------
    scores
        Of all candidates.
    models
        Fitted, the best first.
    failed
        Sets of effects that could not be fitted, and why.
    passed_over
        Candidates that were not fitted alone, and why.
    """

    def account(one: ScoreTest) -> Account:
        fitted = next((model for model in models if one.name in model.effects), None)
        attempts = [(effects, reason) for effects, reason in failed.items() if one.name in effects]
        if fitted is not None:
            standing = [_standing(fitted, one.name, models[0])]
            standing += [
                f"as {' with '.join(effects)} it could not be fitted: {reason}" for effects, reason in attempts
            ]
            return Account(one.name, "fitted", "; ".join(standing), one.statistic)
        if attempts:
            return Account(one.name, "could not be fitted", attempts[0][1], one.statistic)
        hidden = "; these tests would hardly show it" if one.confounding > _HIDDEN else ""
        return Account(one.name, "not needed", f"{passed_over[one.name]}{hidden}", one.statistic)

    return tuple(account(one) for one in scores)


def _standing(fitted: CandidateModel, name: str, best: CandidateModel) -> str:
    """How the best model with an effect compares with the best of all."""
    others = [other for other in fitted.effects if other != name]
    beside = f"with {' and '.join(others)}" if others else "alone"
    above = fitted.criterion - best.criterion
    return f"{beside} the best" if fitted is best else f"{beside}: criterion {above:.3g} above the best"


def promising(scores: Iterable[ScoreTest], share: float, most: int) -> tuple[list[ScoreTest], dict[str, str]]:
    """Those with at least this share of the largest T, the largest first; and why each of the others is passed over.

    T less what chance gives values per test. No law is tried without the plainer one that it refines.
    """
    ranked = sorted(scores, key=lambda one: -one.promise)
    largest = ranked[0].promise if ranked else 0.0
    kept: list[ScoreTest] = []
    passed_over: dict[str, str] = {}
    for one in ranked:
        if one.statistic <= 0:
            passed_over[one.name] = "it explains nothing of the residual with a size that it may have"
        elif one.promise <= 0:
            passed_over[one.name] = "it explains no more of the residual than chance would with a value per test"
        elif one.promise <= share * largest:
            part = 100 * one.promise / largest
            passed_over[one.name] = f"its score is {part:.2g} % of the largest; it is fitted from {100 * share:g} % on"
        elif len(kept) == most:
            passed_over[one.name] = f"{most} others have larger scores, and no more are fitted at once"
        else:
            kept.append(one)
    plainer = [one for one in ranked if one.name in passed_over and one.name in {law.effect.refines for law in kept}]
    for one in plainer:
        del passed_over[one.name]
    return [*kept, *plainer], passed_over
