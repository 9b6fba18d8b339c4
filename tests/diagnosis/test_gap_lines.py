"""Noise that is known too high on lines of one class hides no gap on those of another."""

import numpy as np
from damper_rig import damper_fit

from mofit.diagnosis.gap_lines import beyond_noise


def test_less_than_nothing_on_slow_lines_hides_no_gap_on_harmonics() -> None:
    observed = damper_fit().hypothesis.observed
    odd, slow = observed.of("odd"), observed.of("slow")
    assert odd.any()
    assert slow.any()
    squares = np.where(odd, 1.0, np.where(slow, -5.0 * odd.sum(), 0.0))
    assert squares[observed.explainable].sum() < 0
    assert np.array_equal(beyond_noise(observed, squares), odd)


def test_other_lines_never_count() -> None:
    observed = damper_fit().hypothesis.observed
    assert np.array_equal(beyond_noise(observed, np.ones(len(observed.measured))), observed.explainable)
