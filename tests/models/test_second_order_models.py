"""Dampers and oscillators against analytic solutions."""

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from reference_response import response

from mofit.models import find_model

DAMPER = {"c": 800.0, "p": 0.0, "d": 600.0, "c_M": 5e4, "d_M": 2e3, "F_0": 3.0}
OSCILLATOR = {"k": 4.0, "f_0": 3.0, "zeta": 0.05, "x_0": 0.01, "k_2": 0.0, "k_3": 0.0}


def stroke(amplitude: float, frequency: float):
    """Displacement and velocity of a sine."""
    omega = 2 * np.pi * frequency
    return lambda t: [amplitude * ca.sin(omega * t), amplitude * omega * ca.cos(omega * t)]


@settings(max_examples=10)
@given(frequency=st.floats(0.1, 20), c_M=st.floats(1e3, 1e5), d_M=st.floats(100, 1e4))
def test_maxwell_damper_has_its_complex_stiffness(frequency, c_M, d_M):
    values = {**DAMPER, "c_M": c_M, "d_M": d_M}
    s, periods = 2j * np.pi * frequency, 2 + int(12 * frequency * d_M / c_M)
    time = np.concatenate([[0.0], (periods + np.arange(64) / 64) / frequency])
    force = response(find_model("maxwell_damper"), values, time, stroke(0.01, frequency))[1:]
    stiffness = values["c"] + s * values["d"] + s * d_M * c_M / (c_M + s * d_M)
    expected = 3.0 + np.imag(0.01 * stiffness * np.exp(s * time[1:]))
    assert np.max(np.abs(force - expected)) < 2e-5 * np.ptp(expected)


def test_maxwell_damper_relaxes_after_a_step():
    # a stroke that is there from the start holds a relaxed branch
    time = np.linspace(0, 1, 11)
    force = response(find_model("maxwell_damper"), DAMPER, time, lambda t: [ca.SX(0.01), ca.SX(0)])
    assert force == pytest.approx(np.full(11, 8.0 + 3.0))


def test_maxwell_damper_without_a_branch_is_the_kelvin_voigt_damper():
    time, values = np.linspace(0, 1, 51), {**DAMPER, "p": 2e4}
    force = response(find_model("maxwell_damper"), {**values, "c_M": 1e-9}, time, stroke(0.02, 2))
    assert force == pytest.approx(response(find_model("kelvin_voigt_damper"), values, time, stroke(0.02, 2)), abs=1e-8)


def test_damper_stiffens_with_stroke():
    time = np.array([0.0, 0.25])
    force = response(find_model("kelvin_voigt_damper"), {**DAMPER, "p": 1e4}, time, stroke(0.02, 1))[1]
    assert force == pytest.approx((800 + 1e4 * 0.02) * 0.02 + 3, abs=1e-9)


@settings(max_examples=10)
@given(f_0=st.floats(0.5, 20), zeta=st.floats(0.01, 0.8))
def test_linear_oscillator_answers_a_step_as_the_textbook_says(f_0, zeta):
    time = np.linspace(0, 4 / f_0, 41)
    values = {**OSCILLATOR, "f_0": f_0, "zeta": zeta}
    x = response(find_model("oscillator"), values, time, lambda t: [ca.SX(2.0)])
    omega, damped = 2 * np.pi * f_0, 2 * np.pi * f_0 * np.sqrt(1 - zeta**2)
    swing = np.cos(damped * time) + zeta * omega / damped * np.sin(damped * time)
    expected = 2.0 / 4.0 * (1 - np.exp(-zeta * omega * time) * swing) + 0.01
    assert np.max(np.abs(x - expected)) < 1e-7


def test_oscillator_resonates_at_its_natural_frequency():
    omega = 2 * np.pi * 3.0
    time = np.concatenate([[0.0], 20 + np.arange(32) / 32 / 3.0])
    x = response(find_model("oscillator"), OSCILLATOR, time, lambda t: [ca.sin(omega * t)])[1:]
    # at resonance: magnitude 1 / (2 zeta k), a quarter of a period late
    assert x == pytest.approx(0.01 - np.cos(omega * time[1:]) / (2 * 0.05 * 4.0), abs=1e-5)


def test_duffing_oscillator_rests_where_its_spring_carries_the_load():
    values = {**OSCILLATOR, "zeta": 0.9, "k_2": 0.5, "k_3": 3.0}
    x = response(find_model("duffing_oscillator"), values, np.array([0.0, 10.0]), lambda t: [ca.SX(2.0)])[1] - 0.01
    assert 4.0 * x + 0.5 * x**2 + 3.0 * x**3 == pytest.approx(2.0, abs=1e-8)


def test_duffing_oscillator_with_a_linear_spring_is_the_oscillator():
    time = np.linspace(0, 1, 21)
    duffing, linear = (
        response(find_model(name), OSCILLATOR, time, lambda t: [ca.sin(30 * t)])
        for name in ("duffing_oscillator", "oscillator")
    )
    assert duffing == pytest.approx(linear, abs=1e-12)
