"""Our Sobol points are SciPy's."""

import numpy as np
import pytest
from scipy.stats import qmc

from mofit.sobol import Sobol, sobol


@pytest.mark.parametrize("dimension", [1, 2, 8, 40])
@pytest.mark.parametrize("seed", [None, 0, 7])
def test_numbers_are_those_of_scipy(dimension, seed):
    ours, theirs = sobol(dimension, seed), qmc.Sobol(dimension, scramble=seed is not None, rng=seed)
    assert isinstance(ours, Sobol)
    for count in (64, 5, 1, 300):
        np.testing.assert_array_equal(ours.random(count), theirs.random(count))


def test_a_generator_gives_each_sequence_a_child_of_its_own():
    ours, theirs = np.random.default_rng(3), np.random.default_rng(3)
    for _ in range(2):
        np.testing.assert_array_equal(sobol(3, ours).random(8), qmc.Sobol(3, rng=theirs).random(8))
    assert ours.random() == theirs.random()


def test_dimensions_beyond_the_table_are_scipys():
    np.testing.assert_array_equal(sobol(50, 1).random(16), qmc.Sobol(50, rng=1).random(16))
