"""Which column drives, responds, or is a derivative, from nothing but the values."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.signal import butter, lfilter

from mofit.data.importers.shapes import looks_like_time, roles_by_shape

TIME = np.arange(2000) / 200
FEW = settings(max_examples=20, deadline=None, suppress_health_check=list(HealthCheck), derandomize=True)


def noise(seed, size=2000):
    return np.random.default_rng(seed).normal(size=size)


@FEW
@given(seed=st.integers(0, 10**6), scale=st.sampled_from([1.0, 1000.0, 0.001]))
def test_a_recorded_velocity_tells_the_motion(seed, scale):
    motion = np.cumsum(lfilter(*butter(2, 0.02), noise(seed))) / 200
    speed = np.gradient(motion, TIME) * scale
    force = 30 * np.tanh(20 * np.gradient(motion, TIME)) + 5 * motion
    roles = roles_by_shape(TIME, {"F": force, "v": speed, "x": motion})
    assert (roles.driver, roles.response, roles.derivatives) == ("x", "F", {"v": "x"})


@FEW
@given(seed=st.integers(0, 10**6))
def test_a_cause_predicts_its_effect(seed):
    force = noise(seed)
    response = lfilter([0, 0.05], [1, -1.8, 0.88], force) + 0.01 * noise(seed + 1)
    roles = roles_by_shape(None, {"response": response, "force": force})
    assert (roles.driver, roles.response) == ("force", "response")


def test_a_sine_drives_what_is_less_of_a_sine():
    stroke = np.sin(9 * TIME)
    force = np.sign(np.cos(9 * TIME)) + 0.3 * stroke
    assert roles_by_shape(TIME, {"F": force, "x": stroke}).driver == "x"


def test_demand_and_measurement_count_once_and_constants_not_at_all():
    stroke = np.sin(9 * TIME)
    measured = stroke + 0.005 * noise(1)
    columns = {"demand": stroke, "F": np.tanh(9 * np.cos(9 * TIME)), "x": measured, "k": 0 * TIME + 3, "n": TIME}
    roles = roles_by_shape(TIME, columns)
    assert {roles.driver, roles.response} == {"x", "F"}


@pytest.mark.parametrize("columns", [{}, {"x": TIME}, {"x": noise(0), "gap": np.full(2000, np.nan)}])
def test_one_signal_has_no_roles(columns):
    assert roles_by_shape(TIME, columns) is None


def test_what_looks_like_time():
    assert looks_like_time(TIME)
    assert not looks_like_time(np.insert(TIME, 3, TIME[2]))
    assert not looks_like_time(np.cumsum(np.abs(noise(0)) ** 6))
