"""What a next test is foreseen to rule out."""

import numpy as np
import pytest

from mofit.diagnosis.next_test import ruled_out


@pytest.mark.parametrize(("distance", "likely"), [(6.0, (0.5, 0.5)), (7.0, (0.2, 0.8)), (4.0, (0.9, 0.1))])
def test_a_rival_is_ruled_out_as_often_as_in_an_experiment(distance: float, likely: tuple[float, float]) -> None:
    """Two means, white noise; half of the squared distance foreseen is there."""
    rng = np.random.default_rng(1)
    there = distance / np.sqrt(2)
    noise = rng.standard_normal(200_000)
    for right, sign in ((0, 1.0), (1, -1.0)):
        measured = noise if right == 0 else there + noise
        # log likelihood of mean 0 over that of the other
        lead = sign * 0.5 * ((measured - there) ** 2 - measured**2) + np.log(likely[right] / likely[1 - right])
        found = np.mean(lead > np.log(10))
        noncentrality = np.array([[np.inf, distance**2], [distance**2, np.inf]])
        foreseen = ruled_out(noncentrality, np.array(likely))
        assert foreseen[right, 1 - right] == pytest.approx(found, abs=0.004)
        assert foreseen[right, right] == 1


def test_a_test_that_parts_nothing_leaves_what_is_ruled_out_already() -> None:
    likely = np.array([0.95, 0.05])
    found = ruled_out(np.zeros((3, 2, 2)), likely)
    assert found.shape == (3, 2, 2)
    assert found[:, 0, 1] == pytest.approx(1)
    assert found[:, 1, 0] == pytest.approx(0)
