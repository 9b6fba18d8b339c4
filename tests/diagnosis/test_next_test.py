"""Which of the procedures tried is advised."""

import numpy as np
import pytest

from mofit.diagnosis.next_test import _LONGEST, _SECONDS, SEPARATES, _best

#: what the longest test makes separate
ENOUGH = SEPARATES * _SECONDS / _LONGEST


@pytest.mark.parametrize(
    ("separations", "weight", "best"),
    [
        # all pairs, the weakest of them best
        ([[2.0, 1.1, 9.0], [1.2, 3.0, 0.1]], [0.9, 0.1], 0),
        # none parts all: the probable pair first
        ([[2.0, 0.0, 0.9], [0.0, 2.0, 0.0]], [0.3, 0.6], 1),
        # more than enough is no better than enough
        ([[50.0, 1.0], [0.1, 0.5]], [0.5, 0.5], 1),
        # one that runs away in every test (0) does not hide the others
        ([[0.0, 0.0], [0.2, 0.4]], [0.5, 0.5], 1),
    ],
)
def test_the_procedure_that_parts_most_is_taken(separations, weight, best):
    assert _best(ENOUGH * np.array(separations), np.array(weight)) == best
