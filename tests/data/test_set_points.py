"""Values of a condition that scatter about set points, and those that do not."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mofit.data import Campaign, Experiment, Measurement
from mofit.data.set_points import at_set_points, set_points
from mofit.errors import InputError


def campaign(name: str, values) -> Campaign:
    time = np.arange(20) / 10
    tests = [
        Measurement(
            Experiment(f"t{k}", "free", time, {"displacement": np.sin(time)}, {name: value}),
            {"force": np.cos(time)},
            {"displacement": "m", "force": "N"},
        )
        for k, value in enumerate(values)
    ]
    return Campaign("rig", "simulated", {}, tuple(tests))


@given(st.integers(2, 8), st.integers(0, 10_000), st.floats(0.01, 0.4))
def test_values_that_scatter_belong_to_their_set_points(count, seed, scatter):
    """In a random order, any number of them each."""
    rng = np.random.default_rng(seed)
    truth = rng.permutation(np.concatenate([np.arange(count), rng.integers(count, size=20)]))
    values = 293.15 + 10 * truth * 1.05**truth + scatter * 10 / 50 / 2 * rng.uniform(-1, 1, len(truth))
    assert np.array_equal(set_points(values), truth)


@pytest.mark.parametrize(
    "values",
    [
        [2000.0, 3000.0, 4000.0, 5000.0],
        [0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 100.0],
        np.geomspace(0.1, 1e4, 11),
        [0.0, 0.5, 1.0, 20.0],
        [-1.0, 0.0, 3.0],
        [20.0, 21.0],
        [5.0],
    ],
)
def test_values_of_a_plan_stay_apart(values):
    assert np.array_equal(set_points(values), np.arange(len(values)))


def test_a_width_says_what_belongs_together():
    values = [20.0, 21.0, 25.0, 21.5, 20.0]
    assert set_points(values, 1.0).tolist() == [0, 0, 1, 0, 0]
    assert set_points(values, 0.0).tolist() == [0, 1, 3, 2, 0]


def test_the_tests_of_a_set_point_have_its_mean():
    whole = campaign("temperature", [293.25, 313.0, 293.15, 292.9, 313.0])
    moved, notes = at_set_points(whole, ("temperature",), {})
    found = [m.experiment.conditions["temperature"] for m in moved.measurements]
    assert found == pytest.approx([293.1, 313.0, 293.1, 293.1, 313.0])
    (note,) = notes
    assert note.startswith(
        "temperature: 292.9, 293.15, 293.25 count as one set point, 293.1 (--set-point temperature=0"
    )
    assert at_set_points(whole, ("temperature",), {"temperature": 0.0})[0] is whole


def test_specimens_are_numbers():
    whole = campaign("specimen", [1.0, 2.0, 500.0])
    assert at_set_points(whole, ("specimen",), {})[0] is whole


def test_a_width_of_no_condition_or_below_zero_is_refused():
    with pytest.raises(InputError, match="no condition of --over") as caught:
        at_set_points(campaign("temperature", [1.0, 2.0]), ("temperature",), {"load": 1.0, "temperature": -1.0})
    assert len(caught.value.issues) == 2
