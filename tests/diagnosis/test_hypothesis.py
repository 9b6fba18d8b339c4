"""Hypotheses: exact slopes, the prior's rows, and effects that the calibration tests had too."""

from dataclasses import replace

import numpy as np
import pytest
from damper_rig import WORKSHOP, damper_fit

from mofit.calibration import calibrate
from mofit.diagnosis.cause import causes, recalibrated
from mofit.diagnosis.hypothesis import Hypothesis, hypothesis
from mofit.diagnosis.steps import RUNAWAY, with_enough_steps
from mofit.library import find_effect, find_model
from mofit.objectives import GaussianPrior
from mofit.parameters import ParameterSpace
from mofit.simulate import plan as plans
from mofit.simulate import run_plan

CONDITIONS = {"longitudinal_velocity": 16.7}


def with_friction() -> tuple[Hypothesis, np.ndarray]:
    """The damper with friction, and a point."""
    fitted = damper_fit()
    observed = fitted.hypothesis.observed
    found = causes(find_effect("dry_friction"), observed.problem.space, (), WORKSHOP)
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


def test_runaway_integrations_do_not_count_as_converged() -> None:
    simulator, rows = with_enough_steps(
        Stiff(),
        lambda at: np.full(3, RUNAWAY if at.steps < 8 else 1 + 1e-6 / at.steps),
        lambda coarse, fine: float(np.max(np.abs(fine - coarse))),
        1e-3,
    )
    assert simulator.steps == 8
    assert rows == pytest.approx(1.0, abs=1e-6)


def test_steps_are_fine_enough_for_the_slopes_too(monkeypatch) -> None:
    """Slopes of a stiff friction can run away where its force does not."""
    model, point = with_friction()
    simulator = type(model.simulator)
    whole = simulator.sensitivities

    def wild_below_sixteen(self, values):
        factor = 1.0 if self.steps >= 16 else RUNAWAY
        return [(output, factor * slopes) for output, slopes in whole(self, values)]

    assert model.at_steps_for(point[None]).simulator.steps < 16
    monkeypatch.setattr(simulator, "sensitivities", wild_below_sixteen)
    assert model.at_steps_for(point[None]).simulator.steps == 16


def test_a_failed_simulation_is_nan_and_leaves_the_others_alone() -> None:
    fitted = damper_fit()
    point = fitted.minimum.point
    value, gradient, hessian = fitted.hypothesis.evaluate(np.stack([point, point * np.nan]))
    assert value[0] == pytest.approx(fitted.minimum.value)
    assert np.isnan(value[1])
    assert np.isfinite(gradient).all()
    assert np.isfinite(hessian).all()


def test_slopes_too_large_to_square_make_a_point_unusable_without_a_word(monkeypatch) -> None:
    model = damper_fit().hypothesis
    point = damper_fit().minimum.point[None]
    usual = model.linear(point)
    monkeypatch.setattr(Hypothesis, "linear", lambda self, u: replace(usual, jacobian=1e200 * usual.jacobian))
    value, _, hessian = model.evaluate(point)
    assert np.isfinite(value).all()
    assert not np.isfinite(hessian).all()


def calibration_campaign(offset: float):
    effects = (plans.EffectPlan(name="slip_offset", parameters={"alpha_0": offset}),) if offset else ()
    steps = [plans.TestPlan(name=f"step{a}", kind="step", sample_rate=50.0, amplitude=a, ramp_rate=1.0, duration=6.0)
             for a in (0.02, 0.035, 0.07)]  # fmt: skip
    return run_plan(
        plans.Plan(
            title="steps", model="maxwell_tyre", seed=1, conditions=CONDITIONS, effects=effects, tests=tuple(steps)
        )
    )


def test_an_effect_in_the_calibration_tests_moves_their_estimates_as_foreseen() -> None:
    model = find_model("maxwell_tyre")
    space = ParameterSpace(model.parameters)
    offset = 2e-4
    with_, without = (calibrate(model, calibration_campaign(a), space, seed=0, jobs=1)[0] for a in (offset, 0.0))
    effect = find_effect("slip_offset")
    _, everywhere = causes(effect, space, with_, WORKSHOP)
    names = with_[0].problem.space.names
    place = [space.index(name) for name in names]
    moved = with_[0].minimum - without[0].minimum
    np.testing.assert_allclose(everywhere.carried[place, 0] * offset, moved, rtol=0.1)
    # looked at with the offset itself, the stage finds what it had found without one
    again = recalibrated(everywhere, {"alpha_0": offset}, space, with_, WORKSHOP)
    np.testing.assert_allclose(again.moved[place], -moved, rtol=1e-2)
    # from afar, too
    afar = {"alpha_0": offset, "s_M": 4 * with_[0].values["s_M"]}
    np.testing.assert_allclose(recalibrated(everywhere, afar, space, with_, WORKSHOP).moved, again.moved, atol=1e-6)
    # and with none, what it found: nothing is left of where it was looked at before
    far = recalibrated(everywhere, {"alpha_0": 20 * offset}, space, with_, WORKSHOP)
    assert not np.any(recalibrated(far, {"alpha_0": 0.0}, space, with_, WORKSHOP).moved)
    # steered past a right angle these tests cannot be fitted
    assert recalibrated(everywhere, {"alpha_0": np.pi / 2}, space, with_, WORKSHOP) is everywhere


def test_the_prior_follows_an_effect_of_the_calibration_tests() -> None:
    """R (mean - u) is the same whether an effect moved the estimates by b a, or the estimates moved by themselves."""
    fitted = damper_fit()
    observed, space = fitted.hypothesis.observed, fitted.hypothesis.space
    prior = GaussianPrior(("c", "d"), np.array([0.3, 0.6]), np.array([[100.0, 20.0], [20.0, 50.0]]))
    known = replace(observed, problem=replace(observed.problem, prior=prior))
    cause = causes(find_effect("force_gain"), space, (), WORKSHOP)[0]
    carried = np.array([[0.4], [0.0], [-0.2], [0.0]])
    model = hypothesis(known, [replace(cause, carried=carried)])
    rows, mean = model.prior_rows
    gain = 0.05
    point = np.full(len(model.space), 0.5)
    point[-1] = model.space.subset(["g_F"]).to_unit([gain])[0]
    offset = np.array([0.3, 0.6]) - 0.5 - gain * carried[[0, 2], 0]
    assert np.sum((rows @ (mean - point)) ** 2) == pytest.approx(offset @ prior.precision @ offset)
