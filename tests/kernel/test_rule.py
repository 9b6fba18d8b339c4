"""The choice of method and number of steps."""

import numpy as np
import pytest
from kernel_models import OSCILLATOR, RELAXATION, sine_drive
from test_accuracy import DYNAMIC, NOMINAL, TYRE, dynamic_box, tyre_drive

from mofit.errors import InputError
from mofit.kernel import Simulator
from mofit.kernel.rule import sample_box
from mofit.kernel.steps import RK4, RODAS4
from mofit.kernel.stiffness import Stiffness


def test_sample_lies_in_the_box_and_holds_its_corners():
    lower, upper = np.array([0.1, -1.0, 3.0]), np.array([100.0, 1.0, 3.0])
    p = sample_box(lower, upper)
    assert np.all((p >= lower) & (p <= upper))
    for corner in ((0.1, -1.0, 3.0), (0.1, 1.0, 3.0), (100.0, -1.0, 3.0), (100.0, 1.0, 3.0)):
        assert np.any(np.all(np.isclose(p, corner), axis=1))
    # logarithmic where the bounds are far apart
    assert 2 < np.median(p[:, 0]) < 5


def test_stiffness_is_the_fastest_rate_whatever_the_units():
    probes = [np.zeros((n, 1)) for n in (2, 1, 0)]
    m, d, k = 2.0, 1.0, 2e6
    rate = Stiffness(OSCILLATOR, *probes)(np.array([[m, d, k], [1.0, 1e5, 1.0], [np.nan, 1.0, 1.0]]))
    # the norm of the 16th power lies above the spectral radius by at most the 16th root of the condition
    assert np.sqrt(k / m) <= rate[0] < 2.1 * np.sqrt(k / m)
    assert 1e5 * 0.99 < rate[1] < 2.1e5


def test_stiffer_sets_get_more_work_and_the_stiffest_the_l_stable_method():
    drive = sine_drive(RELAXATION, 1.0)
    simulator = Simulator(RELAXATION, [drive], box=([1e-6, 1.0, -0.5], [10.0, 1.0, 0.5]))
    rule = simulator.rules[0]
    assert rule.rungs[0].scheme is RK4
    assert rule.rungs[-1].scheme is RODAS4
    assert list(rule.limits) == sorted(rule.limits)
    assert rule.hopeless == 0


def test_a_small_box_or_a_loose_tolerance_takes_fewer_steps():
    drive = tyre_drive(3.3, 100)
    whole = Simulator(TYRE, [drive], DYNAMIC, box=dynamic_box())
    work = whole.rules[0].rungs[-2].cost
    around = (0.95 * NOMINAL, 1.05 * NOMINAL)
    near = whole.within((np.minimum(*around), np.maximum(*around)))
    loose = near.within((np.minimum(*around), np.maximum(*around)), tolerance=1e-3)
    assert loose.rules[0].rungs[0].cost < near.rules[0].rungs[0].cost <= work
    np.testing.assert_allclose(near.cost(NOMINAL), whole.cost(NOMINAL), rtol=1e-5)
    assert loose.tolerance == 1e-3
    assert whole.tolerance == near.tolerance == 1e-6


def test_fast_undamped_oscillations_are_counted_as_hopeless():
    drive = sine_drive(OSCILLATOR, 1.0, 60)
    simulator = Simulator(OSCILLATOR, [drive], box=([1e-6, 1e-6, 1.0], [1.0, 1.0, 1e8]))
    assert 0 < simulator.rules[0].hopeless < 1
    # and still have outputs
    assert np.all(np.isfinite(simulator.simulate([1e-6, 1e-6, 1e8])[0]))


def test_bounds_that_coincide_are_a_box_too():
    drive = sine_drive(RELAXATION)
    p = np.array([0.2, 2.0, 0.1])
    fixed, measured = Simulator(RELAXATION, [drive], box=(p, p)), Simulator(RELAXATION, [drive])
    np.testing.assert_allclose(fixed.simulate(p)[0], measured.simulate(p)[0], atol=1e-6)


def test_box_of_another_size_is_an_input_error():
    with pytest.raises(InputError, match="tau, gain, start"):
        Simulator(RELAXATION, [sine_drive(RELAXATION)], box=([0.0], [1.0]))
