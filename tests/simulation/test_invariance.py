"""The numbers of a parameter set depend on nothing but the set and the test."""

import numpy as np
import pytest
from kernel_models import (
    DYNAMIC,
    NOMINAL,
    RELAXATION,
    STATIC,
    TYRE,
    draws,
    dynamic_box,
    sine_experiment,
    tyre_experiment,
)

from mofit.simulation import Simulator

EXPERIMENTS = [tyre_experiment(0.52), tyre_experiment(2.1, 80), tyre_experiment(3.93, 120)]


@pytest.fixture(scope="module")
def batch():
    unit = np.zeros((45, len(NOMINAL)))
    unit[:, -3:] = np.random.default_rng(3).uniform(size=(45, 3))
    return draws(*dynamic_box(), unit)


def simulator(**options):
    return Simulator(TYRE, EXPERIMENTS, DYNAMIC, box=dynamic_box(), **options)


def results(simulator, p):
    (y, dy) = simulator.sensitivities(p)[1]
    return [simulator.cost(p), *simulator.gauss_newton(p), simulator.simulate(p)[2], y, dy]


def test_any_number_of_threads_gives_the_same_bits(batch):
    for one, two in zip(results(simulator(), batch), results(simulator(jobs=3), batch), strict=True):
        np.testing.assert_array_equal(one, two)


def test_any_batch_gives_the_same_bits(batch):
    whole = results(simulator(), batch)
    other = simulator()
    for rows in (np.array([7]), np.array([44, 7, 3]), np.arange(20)[::-1]):
        for all_of_them, some in zip(whole, results(other, batch[rows]), strict=True):
            np.testing.assert_array_equal(all_of_them[rows], some)


def test_a_set_that_fails_stays_alone(batch):
    clean = results(simulator(), batch)
    broken = batch.copy()
    broken[5, -1] = np.nan
    broken[17, TYRE.parameters.index("c_y")] = np.inf
    hurt = results(simulator(), broken)
    kept = np.setdiff1d(np.arange(len(batch)), [5, 17])
    for before, after in zip(clean, hurt, strict=True):
        np.testing.assert_array_equal(before[kept], after[kept])
    assert np.all(np.isnan(hurt[0][[5, 17]]))


def test_a_set_that_diverges_has_no_cost():
    # tau < 0: grows without end
    p = np.array([[0.3, 2.0, 0.5], [-1e-3, 2.0, 0.5]])
    cost, gradient, _ = Simulator(RELAXATION, [sine_experiment(RELAXATION)], steps=1).gauss_newton(p)
    assert np.isfinite(cost[0, 0])
    assert np.isnan(cost[1, 0])
    assert np.all(np.isfinite(gradient[0]))


def test_parameters_that_are_not_free_may_differ_too():
    rng = np.random.default_rng(11)
    p = NOMINAL * rng.uniform(0.9, 1.1, (12, len(NOMINAL)))
    together = Simulator(TYRE, EXPERIMENTS, DYNAMIC, steps=3)
    whole = results(together, p)
    for row in range(len(p)):
        for all_of_them, alone in zip(whole, results(together, p[row : row + 1]), strict=True):
            np.testing.assert_array_equal(all_of_them[row : row + 1], alone)


def test_selected_tests_give_the_same_bits(batch):
    both = simulator()
    some = both.select([2, 0])
    np.testing.assert_array_equal(some.cost(batch), both.cost(batch)[:, [2, 0]])
    assert some.rules == [both.rules[2], both.rules[0]]


def test_samples_without_weight_do_not_count():
    experiment = sine_experiment(STATIC)
    p = np.array([[2.0, 0.3], [1.0, -0.1]])
    ((y, dy),) = Simulator(STATIC, [experiment]).sensitivities(p)
    used = experiment.weights[:, 0] > 0
    residual = (y - experiment.measured)[:, used]
    _, gradient, _ = Simulator(STATIC, [experiment]).gauss_newton(p)
    np.testing.assert_allclose(
        gradient[:, 0], np.einsum("ky,nky,nkyi->ni", experiment.weights[used], residual, dy[:, used]), rtol=1e-12
    )


def test_no_parameter_sets_give_no_results():
    empty = np.empty((0, 3))
    simulator = Simulator(RELAXATION, [sine_experiment(RELAXATION)])
    assert simulator.cost(empty).shape == (0, 1)
    assert simulator.simulate(empty)[0].shape == (0, 200, 1)
