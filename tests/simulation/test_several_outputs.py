"""Several outputs on the kernel: sums per test and output, against the stored outputs and central differences."""

import numpy as np
import pytest
from kernel_models import sine_experiment

from mofit.models import Channel, Equations, Model, build_system
from mofit.parameters import Parameter
from mofit.simulation import Simulator, objective_pairs


class ShakenMass(Model):
    """m x'' + d x' + k x = F; outputs: displacement, acceleration, and the force of the spring."""

    name = "shaken_mass"
    states = (Channel("x", "m"), Channel("v", "m/s"))
    inputs = (Channel("force", "N"),)
    outputs = (Channel("displacement", "m"), Channel("acceleration", "m/s^2"), Channel("spring_force", "N"))
    parameters = (
        Parameter("m", "kg", 0.1, 10.0, 1.0),
        Parameter("d", "N s/m", 0.1, 10.0, 1.0),
        Parameter("k", "N/m", 1.0, 1e3, 100.0),
    )

    def equations(self, s):
        rate = (s.force - s.d * s.v - s.k * s.x) / s.m
        outputs = {"displacement": s.x, "acceleration": rate, "spring_force": s.k * s.x}
        return Equations(outputs, {"x": s.v, "v": rate})


SYSTEM = build_system(ShakenMass())
POINTS = np.random.default_rng(3).uniform([0.5, 0.5, 50], [2.0, 2.0, 200], (21, 3))
#: outputs that each test has
SEEN = [(0, 1, 2), (1,), (0, 2)]
PAIRS = tuple((test, output) for test, seen in enumerate(SEEN) for output in seen)


def experiments():
    """A test with all outputs and two that lack some: their weights and measured values are 0."""
    for frequency, seen in zip((0.5, 1.0, 2.0), SEEN, strict=True):
        whole = sine_experiment(SYSTEM, frequency)
        kept = np.isin(np.arange(3), seen)
        yield whole.changed(measured=whole.measured * kept, weights=whole.weights * kept)


@pytest.mark.parametrize("steps", [1, 3])
def test_sums_of_every_test_and_output_are_those_of_the_stored_outputs(steps):
    tests = [*experiments()]
    simulator = Simulator(SYSTEM, tests, steps=steps)
    assert objective_pairs(tests) == PAIRS
    cost, gradient, normal = simulator.gauss_newton(POINTS)
    np.testing.assert_allclose(simulator.cost(POINTS), cost, rtol=1e-13)
    stored = simulator.sensitivities(POINTS)
    for column, (test, output) in enumerate(PAIRS):
        y, dy = stored[test][0][..., output], stored[test][1][:, :, output]
        weights, residual = tests[test].weights[:, output], y - tests[test].measured[:, output]
        np.testing.assert_allclose(cost[:, column], residual**2 @ weights, rtol=1e-11)
        slope = np.einsum("k,nk,nki->ni", weights, residual, dy)
        curvature = np.einsum("k,nki,nkj->nij", weights, dy, dy)
        np.testing.assert_allclose(gradient[:, column], slope, rtol=1e-9, atol=1e-9 * np.abs(slope).max())
        np.testing.assert_allclose(normal[:, column], curvature, rtol=1e-9, atol=1e-9 * np.abs(curvature).max())


def test_gradient_of_every_test_and_output_agrees_with_central_differences():
    simulator = Simulator(SYSTEM, [*experiments()], steps=2)
    p = np.array([1.0, 1.0, 100.0])
    _, gradient, _ = simulator.gauss_newton(p)
    for k in range(3):
        shift = np.eye(3)[k] * 1e-5 * p[k]
        after, before = simulator.cost([p + shift, p - shift])
        np.testing.assert_allclose(2 * gradient[0, :, k], (after - before) / (2 * shift[k]), rtol=1e-5, atol=1e-7)


def test_selected_tests_keep_their_objectives():
    simulator = Simulator(SYSTEM, [*experiments()], steps=1)
    some = simulator.select([2, 0])
    columns = [PAIRS.index(pair) for pair in PAIRS if pair[0] == 2] + [
        k for k, (test, _) in enumerate(PAIRS) if test == 0
    ]
    np.testing.assert_array_equal(some.cost(POINTS), simulator.cost(POINTS)[:, columns])


def test_an_output_that_fails_spoils_no_other():
    """Where one output is not finite, its objective is nan and the others keep their values."""

    class Root(Model):
        name = "root"
        inputs = (Channel("u", "m"),)
        outputs = (Channel("y", "m"), Channel("z", "m"))
        parameters = (Parameter("a", "m", -1.0, 1.0, 0.5),)

        def equations(self, s):
            return Equations({"y": s.a * s.u, "z": s.a**0.5 * s.u})

    system = build_system(Root())
    cost = Simulator(system, [sine_experiment(system)]).cost([[-0.5], [0.5]])
    np.testing.assert_array_equal(np.isnan(cost), [[False, True], [False, False]])
