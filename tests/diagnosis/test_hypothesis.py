"""Hypotheses: exact slopes, the prior's rows, and effects that the calibration tests had too."""

from dataclasses import replace

import numpy as np
import pytest
import strangers
from damper_rig import SIMULATORS, damper_fit

from mofit.diagnosis.discrepancy import CalibrationStages
from mofit.diagnosis.extended_tests import experiments_of
from mofit.diagnosis.hypothesis import Hypothesis, hypothesis
from mofit.diagnosis.input_rates import InputRates
from mofit.diagnosis.integration import DIVERGED, each_with_enough_steps, with_enough_steps
from mofit.diagnosis.remembered import Remembered
from mofit.diagnosis.whitened_data import whiten
from mofit.identification.calibration import calibrate
from mofit.models import find_effect, find_model
from mofit.parameters import ParameterSpace
from mofit.problem import GaussianPrior, build_problem
from mofit.simulation.virtual_rig import plan as plans
from mofit.simulation.virtual_rig.rig import run_plan

CONDITIONS = {"longitudinal_velocity": 16.7}


def with_friction() -> tuple[Hypothesis, np.ndarray]:
    """The damper with friction, and a point."""
    fitted = damper_fit()
    observed = fitted.hypothesis.observed
    found = observed.stages.discrepancies(find_effect("dry_friction"))
    return hypothesis(observed, found[:1]), np.concatenate([fitted.minimum.point, [0.05, 0.6]])


def test_jacobian_is_that_of_the_residual() -> None:
    model, point = with_friction()
    model = model.at_steps_for(point[None])
    here = model.linear(point[None])
    for k in range(len(point)):
        near = point.copy()
        near[k] += 1e-5
        change = (model.linear(near[None]).residual[0] - here.residual[0]) / 1e-5
        scale = np.linalg.norm(here.jacobian[0, :, k])
        assert np.linalg.norm(change - here.jacobian[0, :, k]) < 2e-3 * scale


class Stiff:
    """A simulator that is unstable below eight steps."""

    def __init__(self, steps: int = 1) -> None:
        self.steps = steps

    def with_steps(self, steps: int) -> "Stiff":
        return Stiff(steps)


def test_divergent_integrations_do_not_count_as_converged() -> None:
    simulator, rows = with_enough_steps(
        Stiff(),
        lambda at: np.full(3, DIVERGED if at.steps < 8 else 1 + 1e-6 / at.steps),
        lambda coarse, fine: float(np.max(np.abs(fine - coarse))),
        1e-3,
    )
    assert simulator.steps == 8
    assert rows == pytest.approx(1.0, abs=1e-6)


class DivergentDerivatives:
    """A simulator of which the derivatives diverge below sixteen steps."""

    def __init__(self, simulator) -> None:
        self.simulator, self.steps = simulator, simulator.steps

    def with_steps(self, steps: int) -> "DivergentDerivatives":
        return DivergentDerivatives(self.simulator.with_steps(steps))

    def sensitivities(self, values):
        factor = 1.0 if self.steps >= 16 else DIVERGED
        return [(output, factor * slopes) for output, slopes in self.simulator.sensitivities(values)]


def test_steps_are_fine_enough_for_the_derivatives_too() -> None:
    """Derivatives of a sharp friction can diverge where its force does not."""
    model, point = with_friction()
    assert model.at_steps_for(point[None]).steps < 16
    divergent = replace(model, simulator=DivergentDerivatives(model.simulator))
    assert divergent.at_steps_for(point[None]).steps == 16


def test_a_failed_simulation_is_nan_and_leaves_the_others_alone() -> None:
    fitted = damper_fit()
    point = fitted.minimum.point
    value, gradient, hessian = Remembered(fitted.hypothesis).evaluate(np.stack([point, point * np.nan]))
    assert value[0] == pytest.approx(fitted.minimum.value)
    assert np.isnan(value[1])
    assert np.isfinite(gradient).all()
    assert np.isfinite(hessian).all()


def test_derivatives_too_large_to_square_make_a_point_unusable_without_a_warning() -> None:
    usual = damper_fit().hypothesis.linear(damper_fit().minimum.point[None])
    value, _, hessian = replace(usual, jacobian=1e200 * usual.jacobian).normal_equations()
    assert np.isfinite(value).all()
    assert not np.isfinite(hessian).all()


def calibration_campaign(name: str, parameters: dict[str, float]):
    effects = (plans.EffectPlan(name=name, parameters=parameters),) if any(parameters.values()) else ()
    steps = [plans.TestPlan(name=f"step{a}", kind="step", sample_rate=50.0, amplitude=a, ramp_rate=0.1, duration=6.0)
             for a in (0.02, 0.035, 0.07)]  # fmt: skip
    return run_plan(
        plans.Plan(
            title="steps", model="maxwell_tyre", seed=1, conditions=CONDITIONS, effects=effects, tests=tuple(steps)
        )
    )


# in the made tests the play comes to rest within some per cent of its width
@pytest.mark.parametrize(("name", "size", "accuracy"), [("slip_offset", "alpha_0", 0.01), ("backlash", "b_0", 0.1)])
def test_an_effect_in_the_calibration_tests_moves_their_estimates_as_predicted(
    name: str, size: str, accuracy: float
) -> None:
    model = find_model("maxwell_tyre")
    space = ParameterSpace(model.parameters)
    small = 2e-4
    with_, without = (
        calibrate(model, calibration_campaign(name, {size: a}), space, seed=0, jobs=1)[0] for a in (small, 0.0)
    )
    effect = find_effect(name)
    stages = CalibrationStages(space, with_, SIMULATORS)
    _, everywhere = stages.discrepancies(effect)
    names = with_[0].problem.space.names
    place = [space.index(name) for name in names]
    moved = with_[0].minimum - without[0].minimum
    np.testing.assert_allclose(everywhere.sensitivity[place, 0] * small, moved, rtol=0.1)
    # fitted with the effect itself, the stage finds what it had found without it
    again = stages.recalibrated(everywhere, {size: small})
    np.testing.assert_allclose(again.shift[place], -moved, rtol=accuracy)
    # from afar, too
    afar = {size: small, "s_M": 4 * with_[0].values["s_M"]}
    np.testing.assert_allclose(stages.recalibrated(everywhere, afar).shift, again.shift, atol=1e-6)
    # and with none, what it found: nothing is left of the fit before
    far = stages.recalibrated(everywhere, {size: 20 * small})
    assert not np.any(stages.recalibrated(far, {size: 0.0}).shift)


def test_stages_that_cannot_be_fitted_with_an_effect_stay_as_they_are() -> None:
    """Steered past a right angle they cannot be simulated."""
    model = find_model("maxwell_tyre")
    space = ParameterSpace(model.parameters)
    stages = CalibrationStages(
        space, calibrate(model, calibration_campaign("slip_offset", {}), space, seed=0, jobs=1)[0], SIMULATORS
    )
    _, everywhere = stages.discrepancies(find_effect("slip_offset"))
    assert stages.recalibrated(everywhere, {"alpha_0": np.pi / 2}) is everywhere


def test_settled_stages_do_not_feel_a_lag() -> None:
    model = find_model("maxwell_tyre")
    space = ParameterSpace(model.parameters)
    found = calibrate(model, calibration_campaign("slip_offset", {}), space, seed=0, jobs=1)[0]
    assert len(CalibrationStages(space, found, SIMULATORS).discrepancies(find_effect("sensor_lowpass"))) == 1


def test_the_prior_follows_an_effect_of_the_calibration_tests() -> None:
    """R (mean - u) is the same whether an effect moved the estimates by B a, or the estimates moved by themselves."""
    fitted = damper_fit()
    observed = fitted.hypothesis.observed
    prior = GaussianPrior(("c", "d"), np.array([0.3, 0.6]), np.array([[100.0, 20.0], [20.0, 50.0]]))
    known = replace(observed, problem=replace(observed.problem, prior=prior))
    gain_error = observed.stages.discrepancies(find_effect("force_gain"))[0]
    sensitivity = np.array([[0.4], [0.0], [-0.2], [0.0]])
    model = hypothesis(known, [replace(gain_error, sensitivity=sensitivity)])
    rows, mean = model.prior_rows
    gain = 0.05
    point = np.full(len(model.space), 0.5)
    point[-1] = model.space.subset(["g_F"]).to_unit([gain])[0]
    offset = np.array([0.3, 0.6]) - 0.5 - gain * sensitivity[[0, 2], 0]
    assert np.sum((rows @ (mean - point)) ** 2) == pytest.approx(offset @ prior.precision @ offset)


def test_each_set_takes_the_steps_that_it_needs() -> None:
    needed, asked = np.array([1, 8, 2]), []

    def rows(steps: int, which: np.ndarray) -> np.ndarray:
        asked.append((steps, tuple(which)))
        return np.where(steps < needed[which], DIVERGED, 1.0 + which)[:, None]

    steps, found = each_with_enough_steps(rows, lambda a, b: float(np.max(np.abs(b - a))), 1e-3, 3)
    assert steps.tolist() == [1, 8, 2]
    assert found.ravel().tolist() == [1.0, 2.0, 3.0]
    assert asked == [(2, (0, 1, 2)), (1, (0, 1, 2)), (4, (1, 2)), (8, (1,)), (16, (1,))]


def test_inputs_are_led_in_of_a_record_that_is_taken_not_to_repeat() -> None:
    """What an effect reads beside the model is led in like what the model reads."""
    campaign, model = strangers.oscillator(lambda x, v: 0.0), find_model("oscillator")
    led = build_problem(model, campaign, leads={one.name: 0.7 for one in campaign.measurements})
    signals = (replace(led.signals[0], period=None, periods=0), *led.signals[1:])
    observed = whiten(replace(led, signals=signals))
    for ours, theirs in zip(led.experiments, experiments_of(observed.problem, [InputRates(model)]), strict=True):
        assert theirs.lead == ours.lead == round(0.7 * strangers.RATE)
        np.testing.assert_allclose(theirs.inputs[:, 0], ours.inputs[:, 0], atol=1e-2 * np.ptp(ours.inputs))
