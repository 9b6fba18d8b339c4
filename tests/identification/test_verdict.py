"""Verdicts on posteriors whose shape is known."""

import numpy as np
import pytest

from mofit.sampling import contraction, verdict

RNG = np.random.default_rng(4)


@pytest.mark.parametrize(
    ("samples", "expected"),
    [
        (RNG.uniform(size=5000), "not identifiable"),
        (RNG.normal(0.5, 0.01, 5000), "identified"),
        (RNG.normal(0.5, 0.18, 5000).clip(0.02, 0.98), "weakly identified"),
        (1 - RNG.exponential(0.05, 5000).clip(0, 1), "lower limit only"),
        (RNG.exponential(0.05, 5000).clip(0, 1), "upper limit only"),
        (RNG.normal(39.3e-5, 1e-5, 5000), "identified"),  # near the end of the range, and 39 sd away from it
    ],
)
def test_verdict(samples, expected):
    assert verdict(samples[:, None]) == [expected]


def test_contraction_of_the_prior_is_zero():
    assert contraction(RNG.uniform(size=(100_000, 1)))[0] == pytest.approx(0, abs=0.01)
