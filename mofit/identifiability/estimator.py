"""The likelihood that an identification will see, from tests that need not have been run."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from mofit.identifiability.fisher import Sensitivity
from mofit.objectives import Adjustment, Score, adjust
from mofit.signals import NoiseProcess

Array = NDArray[np.float64]


def expected_score(tests: Sequence[Sensitivity], point: int, stretch: Array) -> Score:
    """What `mofit.score.score` finds on average over the noise, where the model is right.

    Parameters
    ----------
    tests
        Sensitivities by d parameters.
    point
        Which of their parameter sets.
    stretch
        Derivative of the value by the unit coordinate, (d,).
    """
    square = np.outer(stretch, stretch)
    scatter = np.stack([test.scatter[point] for test in tests]) * square
    return Score(
        slope=np.zeros((len(tests), len(stretch))),
        normal=np.stack([test.normal[point] for test in tests]) * square,
        noise=scatter,
        gap=np.zeros_like(scatter),
        freedom=np.full(len(tests), min(part.freedom.min() for part in _parts(tests, point))),
        gap_freedom=1.0,
    )


def expected_adjustment(tests: Sequence[Sensitivity], point: int, stretch: Array, centre: Array) -> Adjustment:
    """The adjusted likelihood of these tests around the truth ``centre`` (d,) in the unit cube."""
    return adjust(expected_score(tests, point, stretch), centre, with_gap=False)


def _parts(tests: Sequence[Sensitivity], point: int) -> Iterator[NoiseProcess]:
    return (part for test in tests for own in test.noise for part in own[point])
