"""Tyre models against published values and against each other."""

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from reference_response import response

from mofit.models import Symbols, build_system, find_model
from mofit.models.library.steady_state import SLIDING_FORCE, SLIDING_SLIP, lateral_slip

CURVE = {"dF0": 62e3, "s_M": 0.13, "F_M": 3100.0}
TABLE_5 = {"c_y": 121_819.0, "p_y": -7.547, "d_y": 281.0, "c_M": 19_910.0, "d_M": 7_535.0}
ROLLING = {"longitudinal_velocity": 60 / 3.6}


SYSTEM = build_system(find_model("tmeasy_curve"))


def curve(slip: float, values: dict[str, float] = CURVE) -> float:
    """Steady-state force at a slip, without the fictitious velocity."""
    p = [values[name] for name in SYSTEM.parameters]
    return float(SYSTEM.out([], [np.arctan(slip)], p, [20.0, 1.0, 0.0]))


def steer(frequency: float):
    return lambda t: [np.deg2rad(2) * ca.sin(2 * np.pi * frequency * t)]


def test_curve_rises_with_dF0_and_has_its_maximum_at_s_M():
    step = 1e-7
    assert curve(step) / step == pytest.approx(CURVE["dF0"], rel=1e-5)
    assert curve(CURVE["s_M"]) == pytest.approx(CURVE["F_M"], rel=1e-12)
    slips = np.linspace(0, 0.6, 601)
    assert slips[np.argmax([curve(s) for s in slips])] == pytest.approx(CURVE["s_M"], abs=1e-3)


@settings(max_examples=25)
@given(
    dF0=st.floats(4e4, 2e5), s_M=st.floats(0.05, 0.3), F_M=st.floats(1e3, 1e4), at=st.sampled_from([1.0, SLIDING_SLIP])
)
def test_curve_and_its_slope_are_continuous_where_the_pieces_meet(dF0, s_M, F_M, at):
    values = {"dF0": dF0, "s_M": s_M, "F_M": F_M}
    edge, h = at * s_M, 1e-5 * s_M
    below, here, above = (curve(edge + shift, values) for shift in (-h, 0, h))
    assert here == pytest.approx((below + above) / 2, rel=1e-6)
    # both one-sided slopes vanish there
    assert abs(above - here) / h < 1e-3 * F_M / s_M
    assert abs(here - below) / h < 1e-3 * dF0


def test_curve_slides_at_a_constant_force():
    assert curve(SLIDING_SLIP * 0.13 * 1.5) == pytest.approx(SLIDING_FORCE * 3100)


@settings(max_examples=25)
@given(st.floats(-0.5, 0.5))
def test_curve_is_odd_and_has_the_sign_of_the_slip_angle(slip):
    assert curve(-slip) == -curve(slip)
    assert curve(slip) * slip >= 0


def test_slip_is_rills():
    angle, speed, normalisation, fictitious = 0.07, 12.0, 0.8, 0.05
    values = {
        "slip_angle": angle,
        "longitudinal_velocity": speed,
        "slip_normalisation": normalisation,
        "fictitious_velocity": fictitious,
    }
    slip, velocity = lateral_slip(Symbols({name: ca.SX(value) for name, value in values.items()}))
    transport = speed * np.cos(angle) * normalisation + fictitious
    assert float(velocity) == pytest.approx(transport)
    assert float(slip) == pytest.approx(speed * np.sin(angle) / transport)


def test_spring_of_table_5():
    system = build_system(find_model("quasi_static_spring"))
    force = [float(system.out([], [y], [121_819, -7.547], [])) for y in (0.01, -0.01, 0.02)]
    # c y + c p |y| y by hand
    assert force == pytest.approx([1218.19 - 91.9368, -(1218.19 - 91.9368), 2436.38 - 367.7472], abs=1e-3)


def test_equations_5_and_6_of_the_paper_hold_as_printed():
    system = build_system(find_model("maxwell_tyre"))
    values = {**CURVE, **TABLE_5}
    y, y_M, angle, v = 0.011, 0.004, 0.03, 60 / 3.6
    p, c = [values[name] for name in system.parameters], [v, 1.0, 0.01]
    y_rate, y_M_rate = system.rhs([y, y_M], [angle], p, c).full().ravel()
    transport = v * np.cos(angle) + 0.01
    slip = v * np.sin(angle) / transport
    f_G = curve(slip) / slip
    spring = 121_819 * (1 - 7.547 * y)
    left = (transport * 281 + f_G) * y_rate
    right = -transport * spring * y - transport * 19_910 * (y - y_M) + f_G * transport * slip
    assert left == pytest.approx(right, rel=1e-12)
    assert 7_535 * y_M_rate == pytest.approx(19_910 * (y - y_M), rel=1e-12)
    force = float(system.out([y, y_M], [angle], p, c))
    assert force == pytest.approx(spring * y + 19_910 * (y - y_M) + 281 * y_rate, rel=1e-12)


@pytest.mark.parametrize("name", ["maxwell_tyre", "kelvin_voigt_tyre"])
@pytest.mark.parametrize("degrees", [-4.0, 0.0, 1.0, 2.0])
def test_tyre_at_rest_gives_the_steady_force(name, degrees):
    model = find_model(name)
    system = build_system(model)
    values, c = {**CURVE, **TABLE_5}, [60 / 3.6, 1.0, 0.01]
    p, u = [values[q] for q in system.parameters], [np.deg2rad(degrees)]
    x = system.initial(u, p, c)
    static = build_system(find_model("tmeasy_curve"))
    expected = float(static.out([], u, [CURVE[q] for q in static.parameters], c))
    assert np.max(np.abs(system.rhs(x, u, p, c).full())) < 1e-12
    assert float(system.out(x, u, p, c)) == pytest.approx(expected, rel=1e-12, abs=1e-12)


@pytest.mark.parametrize("frequency", [0.25, 4.0])
def test_maxwell_tyre_without_a_branch_is_the_kelvin_voigt_tyre(frequency):
    time = np.linspace(0, 2 / frequency, 101)
    with_branch = response(
        find_model("maxwell_tyre"), {**CURVE, **TABLE_5, "c_M": 1e-9}, time, steer(frequency), ROLLING
    )
    without = response(find_model("kelvin_voigt_tyre"), {**CURVE, **TABLE_5}, time, steer(frequency), ROLLING)
    assert np.max(np.abs(with_branch - without)) < 1e-6 * np.ptp(without)


def test_branch_hardens_the_tyre_at_high_frequency_only():
    def lag(name: str, frequency: float) -> float:
        time = np.linspace(2 / frequency, 3 / frequency, 201)
        time = np.concatenate([[0.0], time])
        force = response(find_model(name), {**CURVE, **TABLE_5}, time, steer(frequency), ROLLING)[1:]
        first = np.trapezoid(force * np.exp(-2j * np.pi * frequency * time[1:]), time[1:])
        return float(-np.angle(first * 1j))

    # a stiffer carcass follows sooner
    assert lag("maxwell_tyre", 4.0) < lag("kelvin_voigt_tyre", 4.0) - np.deg2rad(2)
    assert lag("maxwell_tyre", 0.05) == pytest.approx(lag("kelvin_voigt_tyre", 0.05), abs=np.deg2rad(0.5))


def test_degressive_spring_holds_its_largest_force():
    system = build_system(find_model("quasi_static_spring"))
    stiffness, degression = 1e5, -10.0
    force = [float(system.out([], [y], [stiffness, degression], [])) for y in (0.02, 0.05, 0.2, -0.2)]
    assert force[0] == pytest.approx(stiffness * (1 + degression * 0.02) * 0.02)
    assert force[1:] == pytest.approx([stiffness / (4 * 10), stiffness / (4 * 10), -stiffness / (4 * 10)])
