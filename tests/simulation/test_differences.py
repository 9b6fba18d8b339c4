"""Steps of differences, from noise that is known."""

import numpy as np
import pytest

from mofit.parameters import Parameter, ParameterSpace
from mofit.simulation.evaluation.differences import LARGEST, LEAST, find_steps, moved, nodes, noise_level, slope

SPACE = ParameterSpace((Parameter("a", "1", 0.0, 1.0, 0.5), Parameter("b", "1", 0.1, 10.0, 1.0, "log")))


def response(noise, seed=0):
    """500 columns of a smooth function of a and log b with noise of this standard deviation."""
    rng, phase = np.random.default_rng(seed), np.linspace(0, 3, 500)

    def respond(p):
        smooth = np.sin(p[:, :1] + phase) + np.cos(np.log10(p[:, 1:]) * phase)
        return smooth + noise * rng.normal(size=smooth.shape)

    return respond


@pytest.mark.parametrize("noise", [1e-8, 1e-5, 1e-3])
def test_the_noise_is_that_which_was_added(noise):
    line = np.tile(0.3 + 1e-4 * np.arange(7)[:, None], 2)
    assert noise_level(response(noise)(line)) == pytest.approx(noise, rel=0.1)


@pytest.mark.parametrize("noise", [1e-9, 1e-7, 1e-5])
def test_a_noisy_simulator_gets_steps_far_above_its_noise_and_good_slopes(noise):
    p, respond = np.array([0.4, 1.5]), response(noise)
    steps = find_steps(respond, SPACE, p, ("a", "b"), frozenset("ab"))
    phase = np.linspace(0, 3, 500)
    step = steps["a"].size
    assert 0.5 * np.sqrt(noise) < step < 20 * np.sqrt(noise)
    values = respond(p + np.array([[0, 0], [step, 0]]))
    found = slope(values[0], [values[1]], (step,))
    error = np.sqrt(np.mean((found - np.cos(0.4 + phase)) ** 2))
    assert error < 3 * np.sqrt(noise)
    assert error < 3 * steps["a"].error  # the slope is about 1


def test_without_noise_the_step_is_the_least_and_a_failure_leaves_a_usual_one():
    p = np.array([0.4, 1.5])
    assert find_steps(response(0.0), SPACE, p, ("a",), frozenset("ab"))["a"].size == LEAST
    broken = find_steps(lambda sets: np.full((len(sets), 3), np.nan), SPACE, p, ("a",), frozenset("ab"))["a"]
    assert LEAST < broken.size < LARGEST


def test_what_does_not_reach_the_simulator_asks_nothing_of_it():
    def never(sets):
        raise AssertionError

    assert find_steps(never, SPACE, np.array([0.4, 1.5]), ("a",), frozenset())["a"].error == 0.0


@pytest.mark.parametrize("offsets", [(0.1, -0.1), (0.1, 0.2), (-0.1, -0.2)])
def test_two_points_beside_are_exact_for_a_parabola(offsets):
    values = [2 + 3 * h - 5 * h**2 for h in (0.0, *offsets)]
    assert slope(values[0], values[1:], offsets) == pytest.approx(3.0)


@pytest.mark.parametrize(("value", "signs"), [(0.0, (1, 1)), (0.5, (1, -1)), (1.0, (1, -1))])
def test_points_stay_within_the_limits(value, signs):
    one = Parameter("a", "1", 0.0, 1.0, 0.5)  # a bound at zero is a limit, that at one is none
    offsets = nodes(one, value, 0.01, central=True)
    assert tuple(np.sign(offsets)) == signs
    assert all(moved(one, np.array(value), offset) >= 0 for offset in offsets)


def test_a_step_on_a_log_scale_is_a_factor():
    assert moved(SPACE["b"], np.array(2.0), 0.5) == pytest.approx(20.0)
