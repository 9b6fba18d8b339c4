"""Model and campaign joined: objectives, derivatives, priors, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest

from mofit.data import Campaign, Experiment, Measurement
from mofit.errors import InputError
from mofit.models import Channel, Condition, Equations, Model
from mofit.parameters import Parameter, ParameterSpace
from mofit.problem import GaussianPrior, JointProblem, build_problem


class Lag(Model):
    """First-order lag with gain: T y' = k u - y."""

    name = "lag"
    parameters = (Parameter("k", "1", 0.5, 4.0, 1.0), Parameter("T", "s", 0.01, 1.0, 0.1, "log"))
    states = (Channel("y", "1"),)
    inputs = (Channel("u", "1"),)
    outputs = (Channel("response", "1"),)
    conditions = (Condition("bias", "1", 0.0),)

    def equations(self, s):
        return Equations(outputs={"response": s.y + s.bias}, derivatives={"y": (s.k * s.u - s.y) / s.T})


class Gain(Model):
    """Static gain k."""

    name = "gain"
    parameters = (Parameter("k", "1", 0.1, 10.0, 1.0, "log"),)
    inputs = (Channel("u", "1"),)
    outputs = (Channel("response", "1"),)

    def equations(self, s):
        return Equations(outputs={"response": s.k * s.u})


def lag_response(time, gain, lag, frequency):
    """Exact response of the lag to sin from rest."""
    w = 2 * np.pi * frequency
    amplitude = gain / np.hypot(1, w * lag)
    phase = -np.arctan(w * lag)
    return amplitude * (np.sin(w * time + phase) - np.sin(phase) * np.exp(-time / lag))


def measurement(frequency, gain=2.0, lag=0.15, noise=0.0, seed=0, kind="sine"):
    time = np.arange(0, 6 / frequency, 0.01)
    u = np.sin(2 * np.pi * frequency * time)
    y = lag_response(time, gain, lag, frequency) + noise * np.random.default_rng(seed).normal(size=len(time))
    return Measurement(
        Experiment(f"test_{frequency:g}", kind, time, {"u": u}, {}, frequency, 1.0),
        {"response": y},
        {"u": "1", "response": "1"},
    )


@pytest.fixture(scope="module")
def campaign():
    return Campaign("lag", "simulated", {}, (measurement(0.5, noise=0.01), measurement(1.5, noise=0.01, seed=1)))


@pytest.fixture(scope="module")
def problem(campaign):
    return build_problem(Lag(), campaign)


def test_objective_at_the_truth_is_the_noise(problem):
    truth = problem.space.to_unit([[2.0, 0.15]])
    expected = [0.01 / np.ptp(m.channel("response")) for m in problem.measurements]
    assert problem.objectives(truth)[0] == pytest.approx(expected, rel=0.1)


def test_first_period_is_not_judged(problem):
    for experiment, record in zip(problem.experiments, problem.signals, strict=True):
        first = np.argmax(experiment.weights[:, 0] > 0) * experiment.step
        assert first == pytest.approx(max(record.period, record.transient), abs=2 * experiment.step)


def test_tests_with_other_inputs_share_what_is_measured(campaign, problem):
    led = build_problem(Lag(), campaign, leads={campaign.measurements[0].name: 0.4}, known=problem.experiments)
    (first, second), (known, same) = led.experiments, problem.experiments
    assert second is same
    assert first.lead == 40
    assert np.shares_memory(first.measured, known.measured)
    assert np.shares_memory(first.weights, known.weights)
    np.testing.assert_array_equal(first.inputs[40:], known.inputs)


def test_a_record_just_short_of_whole_periods_loses_none():
    whole = measurement(0.5)
    cut = 5  # of 200 samples a period
    experiment = replace(whole.experiment, time=whole.time[:-cut], inputs={"u": whole.channel("u")[:-cut]})
    short = replace(whole, experiment=experiment, outputs={"response": whole.channel("response")[:-cut]})
    (experiment,) = build_problem(Lag(), Campaign("lag", "simulated", {}, (short,))).experiments
    assert np.count_nonzero(experiment.weights) == pytest.approx(5 * 200, abs=1)


def test_gradient_matches_differences(problem):
    u, step = np.array([0.4, 0.55]), 1e-4
    _, gradient, hessian = problem.evaluate(u[None])
    for i in range(2):
        shift = np.eye(2)[i] * step
        up, down = problem.evaluate(np.stack([u + shift, u - shift]))[0]
        assert gradient[0, i] == pytest.approx((up - down) / (2 * step), rel=1e-4)
    assert np.all(np.linalg.eigvalsh(hessian[0]) > 0)


def test_gradients_of_the_objectives_match_differences(problem):
    u, step = np.array([0.4, 0.55]), 1e-4
    values, gradients = problem.gradients(u[None])
    assert values == pytest.approx(problem.objectives(u[None]), rel=1e-12)
    for i in range(2):
        shift = np.eye(2)[i] * step
        up, down = problem.objectives(np.stack([u + shift, u - shift]))
        assert gradients[0, :, i] == pytest.approx((up - down) / (2 * step), rel=1e-4)


def test_log_posterior_is_minus_the_value_inside_and_minus_infinity_outside(problem):
    inside = np.array([[0.4, 0.5], [0.7, 0.2]])
    assert problem.log_posterior(inside) == pytest.approx(-problem.evaluate(inside)[0], rel=1e-12)
    assert np.all(problem.log_posterior(np.array([[1.01, 0.5], [0.5, -0.1]])) == -np.inf)


def test_prior_adds_its_quadratic(campaign, problem):
    prior = GaussianPrior(("T",), np.array([0.3]), np.array([[400.0]]))
    held = build_problem(Lag(), campaign, prior=prior)
    u = np.array([[0.4, 0.5]])
    gained = [a - b for a, b in zip(held.evaluate(u), problem.evaluate(u), strict=True)]
    assert gained[0][0] == pytest.approx(0.5 * 400 * 0.2**2)
    assert gained[1][0] == pytest.approx([0, 400 * 0.2])
    assert gained[2][0] == pytest.approx(np.diag([0, 400.0]))


def test_fixed_parameters_and_select(campaign, problem):
    fixed = build_problem(Lag(), campaign, space=ParameterSpace(Lag.parameters).subset(["T"]), fixed={"k": 2.0})
    u = ParameterSpace(Lag.parameters).to_unit([[2.0, 0.2]])
    assert fixed.objectives(u[:, 1:]) == pytest.approx(problem.objectives(u), rel=1e-12)
    assert problem.select(["test_1.5"]).objectives(u)[:, 0] == pytest.approx(problem.objectives(u)[:, 1], rel=1e-12)


def test_white_residuals_count_wholly_and_a_misfit_does_not(problem):
    truth = problem.space.to_unit([2.0, 0.15])
    wrong = problem.space.to_unit([3.0, 0.15])
    assert np.all(problem.with_noise_at(truth).noise.independent > 0.7 * problem.noise.count)
    assert np.all(problem.with_noise_at(wrong).noise.independent < 0.1 * problem.noise.count)


def test_joint_posterior_adds_up(campaign, problem):
    gain = build_problem(Gain(), Campaign("g", "simulated", {}, (measurement(0.5, lag=1e-9, noise=0.02, kind="free"),)))
    joint = JointProblem(problem, (gain,))
    u = np.array([[0.4, 0.5], [0.6, 0.3]])
    k = problem.space.from_unit(u)[:, :1]
    assert joint.log_posterior(u) == pytest.approx(
        problem.log_posterior(u) + gain.log_posterior(gain.space.to_unit(k)), rel=1e-12
    )
    value, gradient, hessian = joint.evaluate(u)
    assert value == pytest.approx(-joint.log_posterior(u), rel=1e-12)
    assert value == pytest.approx(joint.value(u), rel=1e-12)
    for i in range(2):
        shift = np.eye(2)[i] * 2e-4  # larger than a jump where the number of integration steps changes
        differences = (joint.evaluate(u + shift)[0] - joint.evaluate(u - shift)[0]) / 4e-4
        assert gradient[:, i] == pytest.approx(differences, rel=1e-3)
    assert hessian == pytest.approx(hessian.transpose(0, 2, 1))


def test_every_missing_channel_and_condition_is_named():
    class Needy(Lag):
        name = "needy"
        inputs = (Channel("u", "1"), Channel("load", "N"))
        conditions = (*Lag.conditions, Condition("speed", "m/s"))

    with pytest.raises(InputError) as caught:
        build_problem(Needy(), Campaign("lag", "simulated", {}, (measurement(0.5), measurement(1.5))))
    issues = caught.value.issues
    assert len(issues) == 4
    assert {issue.where for issue in issues} == {"test 'test_0.5'", "test 'test_1.5'"}
    assert any("'load'" in issue.message for issue in issues)
    assert any("'speed'" in issue.message for issue in issues)


def test_derivative_of_a_channel_is_supplied(campaign):
    class Dashpot(Model):
        name = "dashpot"
        parameters = (Parameter("d", "1", 0.1, 10.0, 1.0),)
        inputs = (Channel("u", "1"), Channel("rate", "1/s", derivative_of="u"))
        outputs = (Channel("response", "1"),)

        def equations(self, s):
            return Equations(outputs={"response": s.d * s.rate})

    problem = build_problem(Dashpot(), campaign)
    experiment, time = problem.experiments[0], problem.measurements[0].time
    exact = np.pi * np.cos(np.pi * time)
    assert experiment.inputs[20:-20, 1] == pytest.approx(exact[20:-20], abs=2e-3 * np.pi)


def test_a_failing_simulation_is_nan_and_minus_infinity(campaign):
    class Exploding(Lag):
        name = "exploding"

        def equations(self, s):
            return Equations(outputs={"response": s.y}, derivatives={"y": 1e3 * s.k * (1 + s.y**2)})

    problem = build_problem(Exploding(), campaign)
    u = np.array([[0.5, 0.5]])
    assert np.isnan(problem.objectives(u)).all()
    assert problem.log_posterior(u)[0] == -np.inf
