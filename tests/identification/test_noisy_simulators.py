"""Simulators whose own noise, a solver's tolerance, spoils differences: standard deviations must not follow it."""

import numpy as np
import pytest
from simulators import line, line_simulator
from straight_line import StraightLine, campaign, sine_test

from mofit.identification.emulation import emulated
from mofit.problem import adjusted_posterior, build_problem
from mofit.sampling import laplace_covariance
from mofit.simulation.evaluation.evaluations import with_evaluations

POINT = np.array([0.6, 0.525])


class Noisy:
    """The straight line with noise that is another at every parameter set, N."""

    def __init__(self, size):
        self.size = size

    def __call__(self, record, parameters):
        seed = np.array([float(parameters[name]) for name in ("k", "b")]).view(np.uint32)
        return line(record, parameters) + self.size * np.random.default_rng(seed).normal(size=len(record.time))


def adjusted(model, noise):
    rig = campaign(sine_test("a", periods=4, noise=noise), sine_test("b", periods=4, noise=noise, seed=1))
    return adjusted_posterior(build_problem(model, rig).with_noise_at(POINT), POINT)


def sd(posterior):
    return np.sqrt(np.diag(np.linalg.inv(posterior.hessian)))


@pytest.mark.parametrize(
    ("noise", "own", "by_differences"),
    # a wide posterior, whose emulator has better slopes; a narrow one, where wide differences are the better ones
    [(20.0, 1.0, False), (0.3, 0.03, True)],
)
def test_the_better_slopes_adjust_the_posterior(noise, own, by_differences):
    exact = sd(adjusted(StraightLine(), noise))
    plain = adjusted(with_evaluations(line_simulator(Noisy(own)), 100), noise)
    quick, _ = emulated(plain, POINT, laplace_covariance(plain.hessian), 0)
    assert np.array_equal(quick.adjustment.map, plain.adjustment.map) == by_differences
    assert sd(quick) / exact == pytest.approx(1, abs=0.1)
    if not by_differences:
        assert (sd(plain) / exact < 0.9).any()
