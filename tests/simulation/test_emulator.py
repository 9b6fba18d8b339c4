"""The emulator of responses, where it can be exact and where it cannot."""

import numpy as np
import pytest
from simulators import lagging_simulator, line_simulator
from straight_line import campaign, sine_test

from mofit.problem import build_problem
from mofit.simulation.evaluation.emulated import EmulatedSimulator
from mofit.simulation.evaluation.emulator import Coordinates, Emulator
from mofit.simulation.evaluation.surface import Surface, coefficients


def emulated(problem, centre, sd, count, seed=0):
    """The problem's simulator emulated around a point, from so many random sets."""
    free = problem.simulator.free
    columns = tuple(problem.layout.names.index(name) for name in free)
    coordinates = Coordinates(problem.space, columns, centre, np.diag(sd))
    u = centre + sd * np.random.default_rng(seed).normal(size=(count, len(centre)))
    sets = problem.layout.full(u)
    emulator = Emulator(
        coordinates, problem.experiments, sets, problem.simulator.simulate(sets),
        np.ones(len(problem.experiments)), np.zeros(count), seed,
    )  # fmt: skip
    return EmulatedSimulator(problem.system, problem.experiments, free, emulator)


def test_a_linear_response_is_exact_everywhere():
    problem = build_problem(line_simulator(), campaign(sine_test("a"), sine_test("b", size=2.0)))
    quick = emulated(problem, np.array([0.6, 0.5]), np.array([0.02, 0.03]), 10)
    p = problem.layout.full(np.random.default_rng(5).random((20, 2)))
    before = problem.evaluations.count
    for ours, theirs in zip(quick.gauss_newton(p), problem.simulator.gauss_newton(p), strict=True):
        assert ours == pytest.approx(theirs, rel=1e-5, abs=1e-6 * np.abs(theirs).max())
    for ours, theirs in zip(quick.sensitivities(p), problem.simulator.sensitivities(p), strict=True):
        assert ours[0] == pytest.approx(theirs[0], abs=1e-6)
        assert ours[1] == pytest.approx(theirs[1], abs=1e-4)
    after = problem.evaluations.count
    quick.cost(p + 0.1)
    quick.select([1]).simulate(p)
    assert problem.evaluations.count == after > before


def test_a_nonlinear_response_is_good_within_the_points_and_its_slopes_are_its_own():
    problem = build_problem(lagging_simulator(), campaign(sine_test(periods=4)))
    centre, sd = np.array([0.5, 0.5, 0.5]), np.full(3, 0.02)
    p = problem.layout.full(centre + sd * np.random.default_rng(6).normal(size=(20, 3)))
    quick = emulated(problem, centre, sd, 40)
    true, found = problem.simulator.cost(p), quick.cost(p)
    spread = np.ptp(true)
    assert np.abs(found - true).max() < 5e-3 * spread
    few = emulated(problem, centre, sd, 8)
    assert np.abs(few.cost(p) - true).max() > 10 * np.abs(found - true).max()
    (outputs, slopes) = quick.sensitivities(p[:1])[0]
    for k in range(3):
        step = np.zeros(3)
        step[k] = 1e-6 * p[0, k]
        above, below = quick.simulate(np.array([p[0] + step, p[0] - step]))[0]
        assert slopes[0, ..., k] == pytest.approx((above - below) / (2 * step[k]), rel=1e-4, abs=1e-6)
    assert outputs.shape == (1, problem.experiments[0].recorded, 1)


def test_sums_follow_what_was_measured_when_that_changes():
    problem = build_problem(line_simulator(), campaign(sine_test()))
    quick = emulated(problem, np.array([0.6, 0.5]), np.array([0.02, 0.03]), 10)
    p, (one,) = problem.layout.full(np.array([[0.6, 0.52]])), problem.experiments
    other = one.changed(measured=one.measured + 1.0, weights=2 * one.weights)
    residual = problem.simulator.simulate(p)[0][0] - other.measured
    assert quick.with_experiments([other]).cost(p)[0, 0] == pytest.approx(np.sum(other.weights * residual**2))


@pytest.mark.parametrize(("degree", "count"), [(1, 12), (2, 30), (3, 60)])
def test_a_surface_is_exact_for_polynomials(degree, count):
    rng = np.random.default_rng(degree)
    z, there = rng.normal(size=(count, 3)), rng.normal(size=(50, 3))

    def function(z):
        return np.stack([(1 + z @ [0.5, -1.0, 0.3]) ** degree, z[:, 0] - 2.0], axis=1)

    surface = Surface.fitted(z, function(z), rng)
    values, slopes = surface.with_slopes(there)
    assert values == pytest.approx(function(there), abs=1e-8)
    assert slopes[:, 1] == pytest.approx(np.tile([1.0, 0.0, 0.0], (50, 1)), abs=1e-8)
    assert surface.error < 1e-8


def test_a_process_follows_what_no_polynomial_does():
    rng = np.random.default_rng(0)
    z, there = rng.uniform(-2, 2, size=(60, 1)), rng.uniform(-1.9, 1.9, size=(50, 1))
    surface = Surface.fitted(z, np.tanh(3 * z), rng)
    assert surface.process is not None
    assert np.abs(surface(there) - np.tanh(3 * there)).max() < 0.01


def test_too_few_points_are_refused():
    with pytest.raises(ValueError, match="too few"):
        Surface.fitted(np.zeros((3, 3)), np.zeros((3, 1)), np.random.default_rng(0))
    assert [coefficients(4, degree) for degree in (1, 2, 3)] == [5, 15, 35]
