"""Tests side by side in the lanes of a loop: the same numbers as one after the other."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from kernel_models import DYNAMIC, NOMINAL, TYRE, draws, dynamic_box, tyre_experiment

from mofit.simulation import Simulator


def simulator(experiments, steps=2):
    return Simulator(TYRE, experiments, DYNAMIC, steps=steps, fixed_per_lane=True)


def sets(count, seed=3):
    unit = np.zeros((count, len(NOMINAL)))
    unit[:, -3:] = np.random.default_rng(seed).uniform(size=(count, 3))
    return draws(*dynamic_box(), unit)


@settings(max_examples=20, deadline=None)
@given(
    tests=st.lists(st.tuples(st.floats(0.3, 9.0), st.integers(5, 130)), min_size=2, max_size=11),
    count=st.integers(1, 3),
    steps=st.integers(1, 3),
)
def test_tests_side_by_side_give_the_same_bits(tests, count, steps):
    # switches within sampling intervals, and records of all lengths: lanes wait for one another
    experiments = [tyre_experiment(frequency, samples) for frequency, samples in tests]
    p = sets(count)
    together = simulator(experiments, steps).sensitivities(p)
    alone = [simulator([one], steps).sensitivities(p)[0] for one in experiments]
    for found, expected in zip(together, alone, strict=True):
        for one, other in zip(found, expected, strict=True):
            np.testing.assert_array_equal(one, other)


def test_every_test_has_its_own_parameters():
    experiments = [tyre_experiment(0.52), tyre_experiment(2.1, 80), tyre_experiment(3.93, 120)]
    p = sets(3)
    together = simulator(experiments).simulate(p[None])
    for number, found in enumerate(together):
        np.testing.assert_array_equal(found[0], simulator(experiments).simulate(p[[number]])[number][0])


def test_a_set_that_diverges_stays_alone():
    experiments = [tyre_experiment(0.52), tyre_experiment(2.1, 80)]
    p = np.concatenate([sets(1), sets(1)])
    p[1, TYRE.parameters.index("c_y")] = np.inf
    good, bad = ([found[row] for found in simulator(experiments).simulate(p)] for row in (0, 1))
    for found, expected in zip(good, simulator(experiments).simulate(p[:1]), strict=True):
        np.testing.assert_array_equal(found, expected[0])
    assert not any(np.isfinite(found[1:]).any() for found in bad)


@pytest.mark.parametrize("count", [1, 2])
def test_leads_are_left_out_of_side_by_side_records(count):
    longer, shorter = tyre_experiment(1.3, 120), tyre_experiment(2.9, 60)
    led = type(longer)(**{
        **{name: getattr(longer, name) for name in ("name", "step", "inputs", "interpolation", "conditions")},
        "measured": longer.measured[40:], "weights": longer.weights[40:], "lead": 40,
    })  # fmt: skip
    p = sets(count)
    whole, cut = (simulator([one, shorter]).simulate(p)[0] for one in (longer, led))
    np.testing.assert_array_equal(cut, whole[:, 40:])
