"""What a peer says, and the choice between its settings that all peers make alike."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from diagnosis_peers_cases.records import Records
from mofit._typing import FloatArray


@dataclass(frozen=True)
class Answer:
    """What a peer says of a campaign.

    Parameters
    ----------
    gap
        Whether there is one.
    terms, families
        Terms that it selects, and families of cause that these stand for; the largest first.
    where
        In words.
    told
        Share of the residual's squares that it removes on tests left out of its fit; None where it predicts nothing.
    correction
        Predicted residual of the records held out, (tests, samples); None where there is none.
    """

    gap: bool
    terms: tuple[str, ...] = ()
    families: tuple[str, ...] = ()
    where: str = ""
    told: float | None = None
    correction: FloatArray | None = None


#: predicts the residual of tests from a fit to others
Predict = Callable[[Records, Records], FloatArray]


@dataclass(frozen=True)
class Choice:
    """One setting of a peer: how complex it is, and its predictions."""

    complexity: int
    predict: Predict


def only(records: Records, tests: Sequence[int]) -> Records:
    """Some of the tests."""
    picked = list(tests)
    two = {key: getattr(records, key)[picked] for key in ("input", "output", "deflection", "rate", "residual")}
    forced = records.forced[:, picked] if records.forced.size else records.forced
    return Records(**two, forced=forced, parameters=records.parameters[:, picked])


def chosen(records: Records, choices: Sequence[Choice]) -> tuple[int | None, float]:
    """Number of the simplest choice within one standard error of the best on tests left out in turn; share it removes.

    None, and a share of 0, where no correction at all is within that: the rule of one standard error (Breiman et al.
    1984), on the mean over tests of the squares left.
    """
    tests = range(len(records.residual))
    left = np.tile(np.mean(records.residual**2, axis=1), (len(choices) + 1, 1))
    for k, choice in enumerate(choices, start=1):
        for test in tests:
            others = only(records, [one for one in tests if one != test])
            one = only(records, [test])
            error = one.residual - choice.predict(others, one)
            with np.errstate(all="ignore"):
                left[k, test] = np.mean(error**2)
    left = np.where(np.isfinite(left), left, 1e6)
    best = left[np.argmin(left.mean(axis=1))]
    more = left - best
    within = more.mean(axis=1) <= more.std(axis=1, ddof=1) / np.sqrt(len(tests))
    order = np.lexsort((left.mean(axis=1), [0, *(choice.complexity for choice in choices)]))
    first = next(int(k) for k in order if within[k])
    return (first - 1, float(1 - left[first].mean() / left[0].mean())) if first else (None, 0.0)
