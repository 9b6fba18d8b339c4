"""The simulator against known answers and itself."""

import gc
import weakref
from dataclasses import replace

import numpy as np
import pytest
from kernel_models import RELAXATION, STATIC, sine_experiment

from mofit.errors import InputError
from mofit.simulation import Simulator
from mofit.simulation.table_cache import drop_tables


def draw(system, count, seed=0):
    rng = np.random.default_rng(seed)
    if system is STATIC:
        return rng.uniform([0.1, -1], [10, 1], (count, 2))
    return rng.uniform([0.1, 0.1, -1], [1.0, 10, 1], (count, 3))


def test_linear_system_follows_its_analytic_solution():
    experiment = sine_experiment(RELAXATION, 1.0)
    tau, gain, start = 0.2, 3.0, 0.4
    time, w = np.arange(200) * 0.01, 2 * np.pi
    steady = (np.sin(w * time) - w * tau * np.cos(w * time)) / (1 + (w * tau) ** 2)
    exact = gain * (steady + (start - steady[0]) * np.exp(-time / tau))
    (y,) = Simulator(RELAXATION, [experiment]).simulate([tau, gain, start])
    assert np.max(np.abs(y[0, :, 0] - exact)) < 1e-6 * np.ptp(exact)


def test_static_model_gives_its_outputs():
    experiment = sine_experiment(STATIC)
    p = draw(STATIC, 5)
    (y,) = Simulator(STATIC, [experiment]).simulate(p)
    u = experiment.inputs[:, 0]
    exact = p[:, :1] * np.abs(u) ** 1.5 * np.sign(u) + p[:, 1:]
    np.testing.assert_allclose(y[..., 0], exact, rtol=1e-14, atol=1e-14)


@pytest.mark.parametrize("system", [RELAXATION, STATIC], ids=["dynamic", "static"])
def test_sums_are_those_of_the_stored_outputs(system):
    experiments = [sine_experiment(system, 0.5), sine_experiment(system, 2.0, samples=150)]
    simulator, p = Simulator(system, experiments), draw(system, 21)
    cost, gradient, normal = simulator.gauss_newton(p)
    np.testing.assert_allclose(simulator.cost(p), cost, rtol=1e-13)
    for t, (experiment, y, (y_too, dy)) in enumerate(
        zip(experiments, simulator.simulate(p), simulator.sensitivities(p), strict=True)
    ):
        np.testing.assert_allclose(y, y_too, rtol=1e-13)
        residual = y - experiment.measured
        np.testing.assert_allclose(cost[:, t], np.sum(experiment.weights * residual**2, (1, 2)), rtol=1e-12)
        np.testing.assert_allclose(
            gradient[:, t], np.einsum("ky,nky,nkyi->ni", experiment.weights, residual, dy), rtol=1e-9, atol=1e-9
        )
        np.testing.assert_allclose(
            normal[:, t], np.einsum("ky,nkyi,nkyj->nij", experiment.weights, dy, dy), rtol=1e-11, atol=1e-9
        )


@pytest.mark.parametrize("free", [("tau", "gain", "start"), ("gain", "tau"), ("start",)])
def test_sensitivities_agree_with_central_differences(free):
    experiment = sine_experiment(RELAXATION)
    simulator = Simulator(RELAXATION, [experiment], free, steps=2)
    p = np.array([0.2, 3.0, 0.4])
    ((_, dy),) = simulator.sensitivities(p)
    for column, name in enumerate(free):
        index = RELAXATION.parameters.index(name)
        shift = np.eye(3)[index] * 1e-5 * p[index]
        (ends,) = simulator.simulate([p + shift, p - shift])
        difference = (ends[0] - ends[1]) / (2 * shift[index])
        np.testing.assert_allclose(dy[0, ..., column], difference, rtol=1e-6, atol=1e-6 * np.ptp(difference))


def test_unknown_free_parameter_and_unfit_test_are_reported_together():
    experiment = sine_experiment(STATIC, interpolation="steps")
    with pytest.raises(InputError) as caught:
        Simulator(RELAXATION, [experiment], ["tua"])
    assert "Did you mean 'tau'" in str(caught.value)
    assert "'steps'" in str(caught.value)


def test_wrong_number_of_parameters_is_an_input_error():
    with pytest.raises(InputError, match="tau, gain, start"):
        Simulator(RELAXATION, [sine_experiment(RELAXATION)]).cost(np.ones((4, 2)))


def test_one_test_is_simulated_as_all_are():
    experiments = [sine_experiment(RELAXATION, 0.5), sine_experiment(RELAXATION, 2.0, samples=150)]
    simulator, p = Simulator(RELAXATION, experiments), draw(RELAXATION, 5)
    for test, outputs in enumerate(simulator.simulate(p)):
        np.testing.assert_array_equal(simulator.one(test, p), outputs)


def test_responses_of_a_test_are_gone_when_those_of_the_next_come():
    experiments = [sine_experiment(RELAXATION, frequency) for frequency in (0.5, 1.0, 2.0)]
    responses = Simulator(RELAXATION, experiments, steps=2).one_by_one(draw(RELAXATION, 3), derivatives=True)
    before = weakref.ref(next(responses))
    for _ in experiments[1:]:
        assert before() is None
        before = weakref.ref(next(responses))


@pytest.mark.parametrize("steps", [1, 3])
def test_a_long_test_begins_as_a_short_one(steps):
    long = sine_experiment(RELAXATION, samples=45_000, interpolation="linear")
    data = {name: getattr(long, name)[:150] for name in ("inputs", "measured", "weights")}
    short, p = replace(long, **data), draw(RELAXATION, 3)
    (whole,), (part,) = (Simulator(RELAXATION, [one], steps=steps).simulate(p) for one in (long, short))
    np.testing.assert_array_equal(whole[:, :150], part)


def test_tables_that_were_dropped_are_made_again():
    simulator, p = Simulator(RELAXATION, [sine_experiment(RELAXATION)]), draw(RELAXATION, 5)
    before = simulator.cost(p)
    drop_tables()
    np.testing.assert_array_equal(simulator.cost(p), before)


@pytest.mark.parametrize("bounded", [True, False], ids=["box", "measured"])
def test_tests_leave_the_memory_with_their_simulator(bounded):
    p = draw(RELAXATION, 5)
    box = (p.min(axis=0), p.max(axis=0)) if bounded else None
    experiment = sine_experiment(RELAXATION)
    seen = weakref.ref(experiment)
    simulator = Simulator(RELAXATION, [experiment], box=box)
    simulator.cost(p)
    del simulator, experiment
    if not bounded:  # what was measured is remembered in a circle
        gc.collect()
    assert seen() is None


def test_results_of_a_single_set_are_those_of_many_whatever_was_asked_before():
    experiments = [sine_experiment(RELAXATION, frequency) for frequency in (0.5, 2.0)]
    simulator, p = Simulator(RELAXATION, experiments, steps=1), draw(RELAXATION, 6)
    finer, other = simulator.with_steps(2), simulator.with_experiments(experiments[1:])
    for _ in range(2):  # the second time some are remembered
        for one in (simulator, finer, other):
            whole = one.sensitivities(p)
            for row in range(len(p)):
                for (y, dy), (many, slopes) in zip(one.sensitivities(p[row]), whole, strict=True):
                    np.testing.assert_array_equal(y[0], many[row])
                    np.testing.assert_array_equal(dy[0], slopes[row])
    (y, _), *_ = simulator.sensitivities(p[-1])
    with pytest.raises(ValueError, match="read-only"):
        y += 1.0
