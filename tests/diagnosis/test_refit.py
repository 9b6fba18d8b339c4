"""What a refit lets pass."""

from types import SimpleNamespace

import numpy as np

from mofit.diagnosis.refit import _holds


def fitted(steps, runs_away_from, slope=1.0):
    """A minimum of a model that runs away with so many steps, and its slope."""

    def model(steps):
        value = np.array([np.nan if steps >= runs_away_from else 1.0])
        return SimpleNamespace(
            simulator=SimpleNamespace(steps=steps), with_steps=model, evaluate=lambda u: (value, None, None)
        )

    minimum = SimpleNamespace(point=np.zeros(2))
    return SimpleNamespace(hypothesis=model(steps), minimum=minimum, jacobian=np.full((3, 2), slope))


def test_a_minimum_that_runs_away_at_half_the_step_does_not_hold():
    assert _holds(fitted(steps=4, runs_away_from=16))
    assert not _holds(fitted(steps=4, runs_away_from=8))


def test_a_minimum_with_slopes_that_ran_away_does_not_hold():
    assert not _holds(fitted(steps=4, runs_away_from=16, slope=1e71))
    assert not _holds(fitted(steps=4, runs_away_from=16, slope=np.nan))
