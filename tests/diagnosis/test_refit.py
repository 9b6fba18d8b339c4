"""What a refit lets pass."""

from types import SimpleNamespace

import numpy as np

from mofit.diagnosis.refit import _holds


def fitted(steps, runs_away_from):
    """A minimum of a model that runs away with so many steps."""

    def model(steps):
        value = np.array([np.nan if steps >= runs_away_from else 1.0])
        return SimpleNamespace(
            simulator=SimpleNamespace(steps=steps), with_steps=model, evaluate=lambda u: (value, None, None)
        )

    return SimpleNamespace(hypothesis=model(steps), minimum=SimpleNamespace(point=np.zeros(2)))


def test_a_minimum_that_runs_away_at_half_the_step_does_not_hold():
    assert _holds(fitted(steps=4, runs_away_from=16))
    assert not _holds(fitted(steps=4, runs_away_from=8))
