"""The Bouc–Wen damper in its limits."""

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from reference_response import response

from mofit.models import build_system, find_model

VALUES = {"c": 0.0, "q": 0.0, "F_y": 100.0, "delta": 1e-3, "F_r": 1.0, "v_s": 1e3, "F_0": 0.0}


def force_over(values: dict[str, float], path, time, averaging_time: float = 0.0):
    """Force over a path x(t)."""
    t = ca.SX.sym("t")
    slope = ca.Function("v", [t], [ca.jacobian(path(t), t)])
    return response(
        find_model("bouc_wen_damper"),
        {**VALUES, **values},
        time,
        lambda s: [path(s), slope(s)],
        {"averaging_time": averaging_time},
    )


def test_elastic_before_the_yield():
    # stiffness F_y / delta at small stroke, whatever the direction
    time = np.linspace(0, 1, 9)
    force = force_over({}, lambda t: 1e-7 * ca.sin(6 * t), time)
    assert force == pytest.approx(100 / 1e-3 * 1e-7 * np.sin(6 * time), abs=1e-2 * 1e-2)


def test_yields_at_F_y_in_both_directions():
    force = force_over({}, lambda t: 0.02 * ca.sin(2 * np.pi * t), np.array([0.0, 0.24, 0.74]))
    assert force[1:] == pytest.approx([100, -100], abs=0.2)


def test_first_loading_is_exponential():
    # from rest, z' = (1 - z) v / delta: z = 1 - exp(-x / delta)
    time = np.linspace(0, 1, 11)
    force = force_over({}, lambda t: 0.003 * t, time)
    assert force == pytest.approx(100 * (1 - np.exp(-3 * time)), abs=1e-5)


def test_unloads_along_the_elastic_line():
    # beta = gamma: while z and v have opposite signs, the stiffness is F_y / delta
    time = np.array([0.0, 0.5, 0.52])
    force = force_over({}, lambda t: 0.01 * ca.sin(np.pi * t), time)
    back = 0.01 * (np.sin(np.pi * 0.52) - 1)
    assert force[2] - force[1] == pytest.approx(100 / 1e-3 * back, rel=1e-3)


@settings(max_examples=10)
@given(st.floats(0.2, 5.0))
def test_hysteresis_does_not_depend_on_the_rate(speed):
    time = np.linspace(0, 1, 11)
    slow = force_over({}, lambda t: 0.002 * ca.sin(5 * t), time)
    fast = force_over({}, lambda t: 0.002 * ca.sin(5 * speed * t), time / speed)
    assert fast == pytest.approx(slow, abs=1e-2)


@settings(max_examples=25)
@given(z=st.floats(-1, 1), v=st.floats(-10, 10))
def test_the_hysteretic_variable_stays_within_one(z, v):
    system = build_system(find_model("bouc_wen_damper"))
    p = [VALUES[name] for name in system.parameters]
    rate = float(system.rhs([z, z, z, v], [0.0, v], p, [0.0])[0])
    if abs(z) == 1:
        assert rate * z <= 0
    assert rate * v >= 0


def test_friction_is_viscous_below_v_s_and_logarithmic_above():
    system = build_system(find_model("bouc_wen_damper"))
    values = {**VALUES, "F_r": 50.0, "v_s": 2e-3}
    p = [values[name] for name in system.parameters]

    def friction(v: float) -> float:
        return float(system.out(np.zeros(4), [0.0, v], p, [0.0]))

    assert friction(2e-6) == pytest.approx(50 * 1e-3, rel=1e-5)
    assert friction(2 * np.e) - friction(2) == pytest.approx(50, rel=1e-5)
    assert friction(-0.1) == -friction(0.1)


def test_spring_differs_between_the_directions():
    system = build_system(find_model("bouc_wen_damper"))
    values = {**VALUES, "c": 1e3, "q": 10.0, "F_0": 5.0}
    p = [values[name] for name in system.parameters]
    assert float(system.out(np.zeros(4), [0.02, 0.0], p, [0.0])) == pytest.approx(1e3 * 1.2 * 0.02 + 5)
    assert float(system.out(np.zeros(4), [-0.02, 0.0], p, [0.0])) == pytest.approx(-1e3 * 0.8 * 0.02 + 5)


def test_averaged_record_is_the_moving_average_of_the_force():
    values, window = {"c": 500.0, "F_r": 40.0, "v_s": 5e-3, "delta": 1e-4}, 0.1
    time = np.linspace(0, 2, 4001)
    plain = force_over(values, lambda t: 0.01 * ca.sin(2 * np.pi * t), time)
    averaged = np.convolve(plain, np.ones(201) / 201, mode="same")
    modelled = force_over(values, lambda t: 0.01 * ca.sin(2 * np.pi * t), time, window)
    settled = slice(1000, 3800)
    left = np.std((modelled - averaged)[settled])
    # three nodes make steps of a smooth reversal; without the averaging the difference is several times as large
    assert left < 0.02 * np.ptp(averaged)
    assert left < 0.3 * np.std((plain - averaged)[settled])
