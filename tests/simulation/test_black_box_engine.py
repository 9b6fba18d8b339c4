"""Outputs and slopes of users' simulators beside the same equations in CasADi, and how simulations are counted."""

import numpy as np
import pytest
from simulators import INPUTS, LINE, Lagging, LineWithSlopes, lagging_simulator, line, line_simulator
from straight_line import campaign, sine_test

from mofit.data import Campaign, Experiment, Measurement
from mofit.models import Addition, Channel, Effect, Scaling, Simulator, with_effects
from mofit.models.model import Applied
from mofit.parameters import Parameter
from mofit.problem import build_problem, model_failures
from mofit.simulation.evaluation.evaluations import evaluations_of, with_evaluations


class Lag(Effect):
    """A first-order lag of what it acts on."""

    states = (Channel("lagged", "1"),)

    def __init__(self, target: str) -> None:
        self.name, self.on = f"lag_of_{target}", (target,)
        self.parameters = (Parameter("T_f", "s", 1e-3, 1.0, 0.03, "log", neutral=1e-3),)

    def apply(self, s, value):
        """The lagged quantity."""
        return Applied(s.lagged, {"lagged": (value - s.lagged) / s.T_f}, {"lagged": value})


class Offset(Addition):
    """Of the force, in every test another."""

    name, on = "own_offset", ("force",)
    parameters = (Parameter("F_0", "N", -10.0, 10.0, 0.0, neutral=0.0, per="test"),)


class Gain(Scaling):
    """Of the displacement."""

    name, on = "gain", ("displacement",)
    parameters = (Parameter("g", "1", -1.0, 1.0, 0.1, neutral=0.0),)


def rig() -> Campaign:
    """Two tests with straight inputs; what was measured is anything."""
    tests = []
    for number, load in enumerate((0.0, 50.0)):
        time = np.arange(800) * 0.005
        x = np.interp(time, np.linspace(0, 4, 17), np.random.default_rng(number).normal(size=17))
        force = 90 * x + 0.1 * load + np.random.default_rng(9).normal(size=len(time))
        experiment = Experiment(
            f"test {number}", "free", time, {"displacement": x}, {"load": load}, interpolation="linear"
        )
        tests.append(Measurement(experiment, {"force": force}, {"displacement": "m", "force": "N"}))
    return Campaign("rig", "simulated", {}, tuple(tests), units={"load": "N"})


def both(*effects):
    return [build_problem(with_effects(one, *effects), rig()) for one in (Lagging(), lagging_simulator())]


@pytest.mark.parametrize(
    "effects",
    [(), (Gain(),), (Lag("force"),), (Lag("displacement"),), (Gain(), Offset()), (Lag("displacement"), Offset())],
    ids=lambda effects: "+".join(effect.name for effect in effects) or "alone",
)
def test_a_function_is_simulated_as_the_same_equations_are(effects):
    equations, function = both(*effects)
    points = np.array([[0.4, 0.3, 0.5], [0.6, 0.8, 0.2]])
    points = np.concatenate([points, np.full((2, len(equations.space) - 3), 0.6)], axis=1)
    assert function.objectives(points) == pytest.approx(equations.objectives(points), rel=2e-3)
    for ours, theirs in zip(function.evaluate(points), equations.evaluate(points), strict=True):
        assert ours == pytest.approx(theirs, rel=5e-3, abs=5e-3 * np.abs(theirs).max())
    ours, theirs = function.simulator.sensitivities(function.layout.full(points))[1], None
    theirs = equations.simulator.sensitivities(equations.layout.full(points))[1]
    for one, other in zip(ours, theirs, strict=True):
        scale = np.abs(other).max(axis=(0, 1), keepdims=True)
        assert np.max(np.abs(one - other) / scale) < 0.02


def test_scoped_values_around_a_simulator_take_no_simulation():
    problem = build_problem(with_effects(lagging_simulator(), Offset()), rig())
    best = problem.simulator.best(problem.layout.full(np.array([[0.4, 0.3, 0.5]])))
    assert best.values[0, :, -1].shape == (2,)
    assert problem.evaluations.count == 2


def test_the_function_s_own_slopes_are_taken():
    problem = build_problem(line_simulator(LineWithSlopes()), campaign(sine_test()))
    values = problem.layout.full(np.array([[0.6, 0.4]]))
    ((_, slopes),) = problem.simulator.sensitivities(values)
    x = problem.experiments[0].inputs[:, 0]
    assert slopes[0, :, 0] == pytest.approx(np.stack([x, np.ones_like(x)], axis=1))
    assert problem.evaluations.count == 1


@pytest.mark.parametrize("many", [False, True])
def test_slopes_by_differences_are_exact_for_a_line(many):
    problem = build_problem(line_simulator(many=many), campaign(sine_test()))
    ((_, slopes),) = problem.simulator.sensitivities(problem.layout.full(np.array([[0.6, 0.4], [1.0, 0.0]])))
    x = problem.experiments[0].inputs[:, 0]
    assert slopes[1, :, 0] == pytest.approx(np.stack([x, np.ones_like(x)], axis=1), abs=1e-6)


def test_many_sets_are_one_call_per_record():
    calls = []

    def spy(record, parameters):
        calls.append(np.shape(parameters["k"]))
        return line(record, parameters)

    problem = build_problem(line_simulator(spy, many=True), campaign(sine_test("a"), sine_test("b", size=2.0)))
    points = np.random.default_rng(0).random((5, 2))
    alone = build_problem(line_simulator(), campaign(sine_test("a"), sine_test("b", size=2.0)))
    assert problem.objectives(points) == pytest.approx(alone.objectives(points))
    assert calls == [(5,), (5,)]
    assert problem.evaluations.count == 10


def test_nothing_is_simulated_twice():
    problem = build_problem(line_simulator(), campaign(sine_test()))
    point = np.array([[0.6, 0.4]])
    problem.objectives(np.repeat(point, 3, axis=0))
    assert problem.evaluations.count == 1
    problem.evaluate(point)
    taken = problem.evaluations.count
    problem.evaluate(point)
    problem.simulate(point)
    assert problem.evaluations.count == taken


def test_a_failure_is_a_failed_point_and_says_why():
    def fragile(record, parameters):
        if parameters["k"] > 0:
            raise RuntimeError("it broke")
        return line(record, parameters)

    model = line_simulator(fragile)
    problem = build_problem(model, campaign(sine_test()))
    found = problem.objectives(np.array([[0.4, 0.5], [0.6, 0.5]]))
    assert np.isfinite(found[0]).all()
    assert np.isnan(found[1]).all()
    assert (problem.evaluations.count, problem.evaluations.failed) == (2, 1)
    assert problem.log_posterior(np.array([[0.6, 0.5]]))[0] == -np.inf


def test_a_simulator_that_always_fails_is_told_in_its_own_words():
    def broken(record, parameters):
        raise RuntimeError("no licence")

    problem = build_problem(line_simulator(broken), campaign(sine_test()))
    (issue,) = model_failures(problem, problem.space.nominal)
    assert issue.where == "model 'broken', test 'sine'"
    assert "the simulator fails" in issue.message
    assert "no licence" in issue.message


def test_beyond_the_limit_nothing_is_simulated():
    model = with_evaluations(line_simulator(), 2)
    problem = build_problem(model, campaign(sine_test()))
    found = problem.objectives(np.random.default_rng(0).random((5, 2)))
    assert np.isfinite(found[:, 0]).sum() == 2
    assert (problem.evaluations.count, problem.evaluations.refused, problem.evaluations.left) == (2, 3, 0)
    assert evaluations_of(model) is problem.evaluations
    assert evaluations_of(with_evaluations(model, 2)).count == 0


def test_what_is_kept_for_later_is_not_spent():
    model = with_evaluations(line_simulator(), 5)
    evaluations_of(model).reserved["later"] = 3
    problem = build_problem(model, campaign(sine_test()))
    assert np.isfinite(problem.objectives(np.random.default_rng(0).random((5, 2)))).sum() == 2
    evaluations_of(model).reserved.clear()
    assert np.isfinite(problem.objectives(np.random.default_rng(1).random((5, 2)))).sum() == 3


def test_two_outputs_by_name():
    def forces(record, parameters):
        x = record.inputs["displacement"]
        return {"rear": 2 * parameters["k"] * x, "front": parameters["k"] * x + parameters["b"]}

    model = Simulator(forces, LINE, INPUTS, (Channel("front", "N"), Channel("rear", "N")))
    test = sine_test()
    test = Measurement(
        test.experiment, {"front": test.outputs["force"], "rear": test.outputs["force"]},
        {"displacement": "m", "front": "N", "rear": "N"},
    )  # fmt: skip
    problem = build_problem(model, campaign(test))
    (outputs,) = problem.simulator.simulate(np.array([[2.0, 0.5]]))
    x = problem.experiments[0].inputs[:, 0]
    assert outputs[0] == pytest.approx(np.stack([2 * x + 0.5, 4 * x], axis=1))
