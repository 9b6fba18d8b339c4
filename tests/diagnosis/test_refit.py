"""What a refit lets pass."""

from types import SimpleNamespace

import numpy as np
import pytest

from mofit.diagnosis import refit
from mofit.diagnosis.baseline import Fitted
from mofit.diagnosis.refit import _holds, _settled
from mofit.refine import Minimum


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


def test_spread_of_slopes_of_all_sizes():
    """Squared, the largest would leave nothing of the others."""
    jacobian = np.array([[1e10, 1e10], [0.0, 1.0]])
    point = np.full(2, 0.5)
    minimum = Minimum(point, 0.0, point, np.eye(2), 0.0, True, np.zeros(2, dtype=np.int64), ())
    fitted = Fitted(None, minimum, np.zeros(2), jacobian)
    # along (1, -1): one row of slope 1, and twice the box
    assert fitted.sd() == pytest.approx(np.full(2, 1 / np.sqrt(3)), rel=1e-5)


@pytest.fixture
def seen(monkeypatch):
    """Minima found one after the other, the stages' tests having had the effect."""

    def look_at(values):
        left = iter(values)

        def look(*_):
            minimum = SimpleNamespace(value=next(left), point=np.zeros(1))
            causes = [SimpleNamespace(everywhere=True)]
            return SimpleNamespace(minimum=minimum, hypothesis=SimpleNamespace(causes=causes))

        monkeypatch.setattr(refit, "fit", look)
        monkeypatch.setattr(refit, "_recalibrated", lambda found: SimpleNamespace(at_steps_for=lambda best: None))
        return look()

    return look_at


@pytest.mark.parametrize(("values", "kept"), [([1.0, 5.0] * 6, 5.0), ([5.0, 1.0, 1.05, 9.0], 1.05)])
def test_what_goes_to_and_fro_counts_by_its_worse_end(seen, values, kept):
    assert _settled(seen(values), np.inf).minimum.value == kept


@pytest.mark.parametrize(
    ("values", "kept"),
    [([1000.0], 1000.0), ([400.0, 399.0], 399.0), ([400.0, 380.0, 349.0, 348.9, 348.85], 348.85)],
    ids=["far off", "too slow", "within reach"],
)
def test_what_would_not_reach_the_limit_is_left_alone(seen, values, kept):
    # 700 white squares are a value of 350; another look would find nothing
    assert _settled(seen(values), 700.0).minimum.value == kept
