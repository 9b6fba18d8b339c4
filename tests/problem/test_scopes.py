"""Parameters per test and per condition: profile, derivatives and marginal against linear algebra."""

from dataclasses import replace

import numpy as np
import pytest

from mofit.data import Campaign, Experiment, Measurement
from mofit.models import Channel, Equations, Model
from mofit.parameters import Parameter
from mofit.problem import build_problem
from mofit.simulation.scopes import unknowns_of

NOISE = 0.3


class Line(Model):
    """y = k x + b + c z: linear in everything."""

    name = "line"
    parameters = (
        Parameter("k", "N/m", -10.0, 10.0, 1.0),
        Parameter("b", "N", -10.0, 10.0, 0.0, per="test"),
        Parameter("c", "N/m", -10.0, 10.0, 0.0, per="load"),
    )
    inputs = (Channel("x", "m"), Channel("z", "m"))
    outputs = (Channel("y", "N"),)

    def equations(self, s):
        """No state."""
        return Equations(outputs={"y": s.k * s.x + s.b + s.c * s.z})


def campaign(tests: int = 4, samples: int = 60) -> tuple[Campaign, np.ndarray, np.ndarray]:
    """Tests of two loads; also the regressors of all samples, one column per value, and the weights of the samples."""
    rng, columns, weights, measurements = np.random.default_rng(3), [], [], []
    for t in range(tests):
        x, z = rng.normal(size=(2, samples))
        y = 2.0 * x + (t - 1.0) + (1.0, -2.0)[t % 2] * z + NOISE * rng.normal(size=samples)
        experiment = Experiment(
            name=f"t{t}", kind="free", time=0.1 * np.arange(samples), inputs={"x": x, "z": z},
            conditions={"load": float(t % 2)},
        )  # fmt: skip
        measurements.append(Measurement(experiment, {"y": y}, {"x": "m", "z": "m", "y": "N"}))
        own = np.zeros((samples, 1 + tests + 2))
        own[:, 0], own[:, 1 + t], own[:, 1 + tests + t % 2] = x, 1.0, z
        columns.append(np.column_stack([own, y]))
        weights.append(np.full(samples, 1 / np.ptp(y) ** 2))
    return Campaign("lines", "simulated", {}, tuple(measurements)), np.concatenate(columns), np.concatenate(weights)


def test_profile_and_derivatives_are_those_of_linear_least_squares() -> None:
    data, columns, weights = campaign()
    problem = build_problem(Line(), data)
    assert problem.space.names == ("k",)
    regressors, y = columns[:, :-1] * np.sqrt(weights)[:, None], columns[:, -1] * np.sqrt(weights)
    for k in (-3.0, 1.0, 2.1):
        p = problem.layout.full(problem.space.to_unit([[k]]))
        rest = y - k * regressors[:, 0]
        inner, *_ = np.linalg.lstsq(regressors[:, 1:], rest, rcond=None)
        residual = rest - regressors[:, 1:] @ inner
        assert problem.simulator.cost(p).sum() == pytest.approx(residual @ residual, rel=1e-9)
        cost, gradient, normal = problem.simulator.gauss_newton(p)
        projected = regressors[:, 0] - regressors[:, 1:] @ np.linalg.lstsq(regressors[:, 1:], regressors[:, 0])[0]
        assert cost.sum() == pytest.approx(residual @ residual, rel=1e-9)
        assert gradient.sum() == pytest.approx(-projected @ residual, rel=1e-6, abs=1e-9)
        assert normal.sum() == pytest.approx(projected @ projected, rel=1e-6)
        assert problem.value(problem.space.to_unit([[k]])) == pytest.approx(
            problem.evaluate(problem.space.to_unit([[k]]))[0], rel=1e-9
        )
        estimates = problem.simulator.best(p).values[0]
        assert estimates[:, 1] == pytest.approx(inner[:4], abs=1e-6)
        assert estimates[:, 2] == pytest.approx(inner[[4, 5, 4, 5]], abs=1e-6)


def test_marginal_is_that_of_the_whole_linear_model() -> None:
    data, columns, weights = campaign()
    problem = build_problem(Line(), data)
    noise = problem.noise
    k = np.linspace(1.8, 2.2, 5)
    ours = problem.log_posterior(problem.space.to_unit(k[:, None]))
    # all values but k, flat priors, level with Jeffreys' prior: a Student-t with n - 6 - 1 degrees of freedom
    scale = np.sqrt(weights * np.repeat(noise.weights, 60))
    regressors, y = columns[:, :-1] * scale[:, None], columns[:, -1] * scale
    squares = [np.linalg.lstsq(regressors[:, 1:], y - value * regressors[:, 0])[1][0] for value in k]
    expected = -0.5 * (240 - 6) * np.log(squares)
    assert ours - ours[0] == pytest.approx(expected - expected[0], abs=1e-6)


def test_values_at_the_end_of_their_range_are_held() -> None:
    data, _, _ = campaign()
    model = Line()
    model.parameters = tuple(replace(p, upper=0.5) if p.name == "b" else p for p in model.parameters)
    problem = build_problem(model, data)
    p = problem.layout.full(problem.space.to_unit([[2.0]]))
    best = problem.simulator.best(p)
    assert best.values[0, 2:, 1] == pytest.approx([0.5, 0.5])
    step = 1e-5
    both = problem.simulator.cost(np.stack([p[0] + [step, 0, 0], p[0] - [step, 0, 0]])).sum(axis=1)
    _, gradient, _ = problem.simulator.gauss_newton(p)
    assert gradient.sum() == pytest.approx((both[0] - both[1]) / (4 * step), rel=1e-4)


def test_groups_join_what_shares_a_value() -> None:
    unknowns = unknowns_of([("a", "1"), ("b", "1"), ("c", "2")])
    assert unknowns.group.tolist() == [0, 0, 1]
    assert unknowns.place.tolist() == [[0, 1], [2, 1], [0, 1]]
    assert unknowns.used.tolist() == [[True, True, True], [True, True, False]]


def test_one_test_is_simulated_as_all_are_with_the_values_that_are_best_for_all():
    problem = build_problem(Line(), campaign()[0])
    p = problem.layout.full(np.array([[0.2], [0.7]]))
    for test, outputs in enumerate(problem.simulate(np.array([[0.2], [0.7]]))):
        np.testing.assert_array_equal(problem.simulator.one(test, p), outputs)
