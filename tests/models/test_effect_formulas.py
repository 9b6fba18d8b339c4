"""What each effect does, against its formula."""

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from kernel_response import output, point, transfer
from reference_response import response
from scipy.integrate import solve_ivp

from mofit.models import Channel, Equations, Model, build_system, find_effect, find_model, with_effects
from mofit.parameters import Parameter

ROLLING = {"longitudinal_velocity": 60 / 3.6, "dynamic_rolling_radius": 0.305}
TYRE = {"c_M": 2e4, "d_M": 7.5e3, "d_y": 281.0}


def extended(model: str, effect: str):
    return with_effects(find_model(model), find_effect(effect))


def stroke(t: ca.SX) -> list[ca.SX]:
    return [0.01 * ca.sin(6 * t), 0.06 * ca.cos(6 * t)]


def extra_force(effect: str, changes: dict[str, float], time) -> np.ndarray:
    """What an effect adds to the force of a damper."""
    base, model = find_model("kelvin_voigt_damper"), extended("kelvin_voigt_damper", effect)
    values = {p.name: p.nominal for p in model.parameters} | changes
    return response(model, values, time, stroke) - response(base, values, time, stroke)


def tyre_force(model, values: dict[str, float], angle: float, states: dict[str, float]) -> float:
    """Lateral force of a tyre model at a slip angle and given states."""
    system = build_system(model)
    c = [ROLLING.get(condition.name, condition.default) for condition in model.conditions]
    return float(system.out([states[name] for name in system.states], [angle], point(model, values)[0], c))


def test_effects_add_what_their_formulas_say():
    time = np.linspace(0, 1, 21)
    x, v = 0.01 * np.sin(6 * time), 0.06 * np.cos(6 * time)
    assert extra_force("cubic_stiffness", {"k_c": 2e7}, time) == pytest.approx(2e7 * x**3)
    assert extra_force("asymmetric_stiffness", {"k_a": 500}, time) == pytest.approx(500 * np.abs(x))
    assert extra_force("payne", {"c_P": 2e3, "y_P": 5e-3}, time) == pytest.approx(2e3 * x / (1 + np.abs(x) / 5e-3))
    assert extra_force("quadratic_damping", {"d_2": 300}, time) == pytest.approx(300 * v * np.abs(v))
    assert extra_force("coulomb_friction", {"F_C": 40, "v_C": 0.01}, time) == pytest.approx(40 * np.tanh(v / 0.01))
    assert extra_force("force_offset", {"F_off": 25}, time) == pytest.approx(np.full(21, 25.0))


def test_second_branch_is_the_maxwell_damper():
    time = np.linspace(0, 2, 41)
    added = extra_force("second_branch", {"c_2": 5e3, "tau_2": 0.2}, time)
    values = {"c": 0.0, "p": 0.0, "d": 0.0, "c_M": 5e3, "d_M": 1e3, "F_0": 0.0}
    assert added == pytest.approx(response(find_model("maxwell_damper"), values, time, stroke), abs=1e-7)


def test_narrow_relaxation_spectrum_is_one_branch():
    time = np.linspace(0, 2, 41)
    spectrum = extra_force("relaxation_spectrum", {"c_R": 5e3, "tau_R": 0.2, "w_R": 1e-9}, time)
    assert spectrum == pytest.approx(extra_force("second_branch", {"c_2": 5e3, "tau_2": 0.2}, time), abs=1e-6)


@pytest.mark.parametrize(
    ("effect", "force", "length"), [("dry_friction", "F_d", "delta_d"), ("bouc_wen", "F_w", "delta_w")]
)
def test_friction_saturates_at_its_force(effect, force, length):
    time = np.array([0.0, 0.2])
    assert extra_force(effect, {force: 30, length: 1e-4}, time)[1] == pytest.approx(30, rel=1e-6)


def test_bouc_wen_unloads_along_a_straight_line():
    # the stroke turns at t = pi / 12; on the way back the force falls by F / delta per length down to zero
    turn = np.pi / 12
    time = np.array([0.0, turn, *np.linspace(turn, turn + 0.05, 6)[1:]])
    force = extra_force("bouc_wen", {"F_w": 30, "delta_w": 2e-3}, time)
    back = 0.01 * (1 - np.sin(6 * time[1:]))
    inside = back < 2e-3 * force[1] / 30
    assert np.count_nonzero(inside) >= 3
    assert force[1:][inside] == pytest.approx(force[1] - 30 / 2e-3 * back[inside], rel=1e-4)


@settings(max_examples=50)
@given(
    interval=st.sampled_from([1e-6, 1e-3, 0.01, 1.0, 60.0]),
    samples=st.sampled_from([100, 1e3, 1e5]),
    place=st.floats(0, 1),
    a=st.floats(0.1, 0.6),
)
def test_springpot_follows_the_power_law(interval, samples, place, a):
    """From one period in the record to eight samples per period, on any scale of time."""
    omega = 2 * np.pi * (samples / 8) ** place / (samples * interval)
    values = {"c": 0.0, "p": 0.0, "d": 0.0, "F_0": 0.0, "c_f": 1.0, "a_f": a}
    record = {"sample_interval": interval, "record_length": samples * interval}
    ratio = transfer(extended("kelvin_voigt_damper", "springpot"), values, omega, record) / (1j * omega) ** a
    assert ratio == pytest.approx(1, abs=0.02)


DAMPER = {"c": 2e3, "p": 0.0, "d": 500.0, "F_0": 0.0}


@settings(max_examples=20)
@given(tau=st.floats(-0.01, 0.02), frequency=st.floats(0.1, 4), second=st.sampled_from([1e-3, 1.0, 60.0]))
def test_delay_shifts_a_sine(tau, frequency, second):
    """In seconds of any length."""
    omega, model = 2 * np.pi * frequency, extended("kelvin_voigt_damper", "delay")
    values, record = {**DAMPER, "d": 500.0 * second, "tau_d": tau * second}, {"sample_interval": 0.01 * second}
    ratio = transfer(model, values, omega / second, record) / (500j * omega + 2e3)
    assert ratio == pytest.approx(np.exp(-1j * omega * tau), abs=3e-3 * omega * abs(tau) + 1e-12)


def test_a_long_delay_of_a_dense_record_does_not_ring():
    """200 sampling intervals late; a chain with a washout as short as one of them would make 10^8 of a kink."""
    time = np.arange(4000) * 1e-4
    ramp, later = np.maximum(time - 0.1, 0), np.maximum(time - 0.12, 0)
    model = extended("kelvin_voigt_damper", "delay")
    values = {"c": 1.0, "p": 0.0, "d": 0.0, "F_0": 0.0, "tau_d": 0.02}
    delayed = output(model, values, {"displacement": ramp, "velocity": np.gradient(ramp, time)}, 1e-4)
    assert np.max(np.abs(delayed - later)) < 0.5 * 0.02


@settings(max_examples=20)
@given(lag=st.floats(0, 0.02), frequency=st.floats(0.1, 5))
def test_low_pass_loses_gain_and_phase(lag, frequency):
    omega = 2 * np.pi * frequency
    model = extended("kelvin_voigt_damper", "sensor_lowpass")
    ratio = transfer(model, {**DAMPER, "T_f": lag}, omega) / (500j * omega + 2e3)
    assert ratio == pytest.approx(1 / (1 + 1j * omega * lag), abs=2e-3 * omega * lag + 1e-12)


def test_a_lag_that_grows_with_the_load_is_its_own_differential_equation():
    time = np.arange(600) / 600
    x = 0.01 * np.sin(2 * np.pi * 2 * time)
    values = {"c": 1e5, "p": 0.0, "d": 0.0, "F_0": 0.0, "T_l": 0.01, "F_T": 700.0}
    channels = {"displacement": x, "velocity": np.gradient(x, 1 / 600)}
    found = output(extended("kelvin_voigt_damper", "load_dependent_lag"), values, channels, 1 / 600)

    def force(t):
        return 1e5 * 0.01 * np.sin(2 * np.pi * 2 * t)

    exact = solve_ivp(
        lambda t, f: (force(t) - f) / (0.01 * (1 + np.abs(force(t)) / 700)), (0, 1), [0.0], "RK45", time, rtol=1e-8,
        atol=1e-6,
    ).y[0]  # fmt: skip
    assert np.max(np.abs(found - exact)) < 1.0
    assert np.max(np.abs(1e5 * x - exact)) > 150


@settings(max_examples=20)
@given(sigma=st.floats(0, 0.3), frequency=st.floats(0.1, 5), speed=st.floats(5, 40))
def test_contact_patch_lags_over_a_length(sigma, frequency, speed):
    omega, conditions = 2 * np.pi * frequency, {"longitudinal_velocity": speed}
    with_lag, without = (
        transfer(model, {**TYRE, "sigma_c": sigma}, omega, conditions)
        for model in (extended("maxwell_tyre", "contact_patch_lag"), find_model("maxwell_tyre"))
    )
    lag = sigma / (speed + 0.01)
    assert with_lag / without == pytest.approx(1 / (1 + 1j * omega * lag), abs=2e-3 * omega * lag + 1e-12)


def test_turn_slip_leads_over_a_length():
    omega = 2 * np.pi * 4
    with_lead, without = (
        transfer(model, {**TYRE, "l_t": 0.02}, omega, ROLLING)
        for model in (extended("maxwell_tyre", "turn_slip"), find_model("maxwell_tyre"))
    )
    assert with_lead / without == pytest.approx(1 + 1j * omega * 0.02 / (60 / 3.6 + 0.01), abs=1e-5)


def test_inertia_is_mass_times_acceleration():
    omega = 2 * np.pi * 4
    model = extended("kelvin_voigt_damper", "inertia")
    added = transfer(model, {**DAMPER, "m_b": 5.0}, omega) - (500j * omega + 2e3)
    assert added == pytest.approx(-5 * omega**2, rel=1e-3)
    # a tyre's deflection over its force, the force itself and the mass that moves with the deflection
    tyre = extended("maxwell_tyre", "inertia")
    added = transfer(tyre, {**TYRE, "m_b": 5.0}, omega, ROLLING) - transfer(tyre, {**TYRE, "m_b": 0.0}, omega, ROLLING)
    force = transfer(tyre, {**TYRE, "m_b": 0.0}, omega, ROLLING)
    spring = 1.2e5 + 281j * omega + 2e4 * (1 - 1 / (1 + 1j * omega * 7.5e3 / 2e4))
    assert added == pytest.approx(5 * omega**2 * force / spring, rel=1e-3)


def play(signal, half):
    """The play operator, sample by sample."""
    rests = [signal[0]]
    for value in signal[1:]:
        rests.append(max(value - half, min(rests[-1], value + half)))
    return np.array(rests)


def test_backlash_is_the_play_operator():
    time = np.arange(2000) / 100
    angle = np.radians(2) * np.sin(2 * np.pi * time) * np.cos(2 * np.pi * 0.13 * time)
    model = extended("tmeasy_curve", "backlash")
    arrived = output(model, {"b_0": 2e-3}, {"slip_angle": angle}, 0.01, ROLLING)
    expected = output(find_model("tmeasy_curve"), {}, {"slip_angle": play(angle, 2e-3)}, 0.01, ROLLING)
    assert np.max(np.abs(arrived - expected)) < 0.01 * np.max(np.abs(expected))
    plain = output(find_model("tmeasy_curve"), {}, {"slip_angle": angle}, 0.01, ROLLING)
    assert np.max(np.abs(plain - expected)) > 0.04 * np.max(np.abs(expected))


def test_a_graded_play_is_the_mean_of_plays():
    time = np.arange(2000) / 1000
    x = 0.01 * np.sin(2 * np.pi * time) * np.cos(2 * np.pi * 0.3 * time)
    values = {"c": 1e3, "p": 0.0, "d": 0.0, "F_0": 0.0, "b_g": 1.5e-3}
    channels = {"displacement": x, "velocity": np.gradient(x, 1e-3)}
    arrived = output(extended("kelvin_voigt_damper", "graded_play"), values, channels, 1e-3) / 1e3
    expected = np.mean([play(x, half) for half in (0.5e-3, 1.5e-3, 2.5e-3)], axis=0)
    np.testing.assert_allclose(arrived, expected, atol=2e-5)
    assert np.max(np.abs(x - expected)) > 1e-3


def test_backlash_rests_where_a_fast_drive_turns():
    """A state that lags by a tenth of a sampling interval would rest 0.1 mrad early."""
    time = np.arange(400) / 400
    angle, between = (0.035 * np.sin(2 * np.pi * 16 * t) for t in (time, np.arange(40000) / 40000))
    expected = play(between, 5e-4)[::100]
    model = extended("tmeasy_curve", "backlash")
    arrived = output(model, {"b_0": 5e-4}, {"slip_angle": angle}, 1 / 400, ROLLING, steps=16)
    exact = output(find_model("tmeasy_curve"), {}, {"slip_angle": expected}, 1 / 400, ROLLING)
    slope = (exact[1] - exact[0]) / (expected[1] - expected[0])
    assert np.max(np.abs(arrived - exact)[50:]) < 3e-5 * slope


def test_backlash_of_a_damper_holds_its_rate_too():
    time = np.arange(4000) / 1000
    x, v = 0.01 * np.sin(2 * np.pi * time), 0.02 * np.pi * np.cos(2 * np.pi * time)
    channels = {"displacement": x, "velocity": v}
    values = {"c": 0.0, "p": 0.0, "d": 1.0, "F_0": 0.0, "b_0": 1e-3}
    rate = output(extended("kelvin_voigt_damper", "backlash"), values, channels, 1e-3)
    travelled = np.cumsum(rate) * 1e-3
    gap = (travelled - play(x, 1e-3))[1000:]
    assert np.max(np.abs(gap - np.mean(gap))) < 1e-4
    assert np.ptp(travelled[1000:]) == pytest.approx(0.018, rel=0.01)


class RateFirst(Model):
    """A dashpot and a spring whose equations use the rate, under a name of its own, before the displacement."""

    name = "rate_first"
    parameters = (Parameter("c", "N/m", 0.0, 1e4, 100.0), Parameter("d", "N s/m", 0.0, 10.0, 1.0))
    inputs = (Channel("displacement", "m"), Channel("rate", "m/s", derivative_of="displacement"))
    outputs = (Channel("force", "N"),)

    def equations(self, s):
        damping = s.d * s.rate
        return Equations(outputs={"force": damping + s.c * s.displacement})


class RateAlone(RateFirst):
    """The displacement is in the campaign, but no input of the model."""

    inputs = (Channel("rate", "m/s", derivative_of="displacement"),)

    def equations(self, s):
        return Equations(outputs={"force": s.d * s.rate})


def test_a_rate_may_be_the_only_input():
    time = np.arange(100) / 100
    found = output(RateAlone(), {"c": 0.0, "d": 2.0}, {"rate": np.sin(6 * time)}, 0.01)
    np.testing.assert_allclose(found, 2 * np.sin(6 * time), atol=1e-12)


def test_a_play_acts_on_the_rate_whatever_its_name_and_whichever_the_equations_use_first():
    time = np.arange(4000) / 1000
    x, v = 0.01 * np.sin(2 * np.pi * time), 0.02 * np.pi * np.cos(2 * np.pi * time)
    own, shipped = with_effects(RateFirst(), find_effect("backlash")), extended("kelvin_voigt_damper", "backlash")
    values = {"c": 200.0, "p": 0.0, "d": 2.0, "F_0": 0.0, "b_0": 1e-3}
    found = output(own, values, {"displacement": x, "rate": v}, 1e-3)
    np.testing.assert_allclose(found, output(shipped, values, {"displacement": x, "velocity": v}, 1e-3), atol=1e-9)


def sine(frequency: float, count: int = 4000):
    return {"slip_angle": np.radians(2) * np.sin(2 * np.pi * frequency * np.arange(count) / 100)}


def added_spectrum(effect: str, frequency: float) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies [Hz] and amplitudes [N] of what an effect adds to the settled half of 40 s of sine steer."""
    model = extended("maxwell_tyre", effect)
    with_it = output(model, TYRE, sine(frequency), 0.01, ROLLING)
    without = output(find_model("maxwell_tyre"), TYRE, sine(frequency), 0.01, ROLLING)
    window = np.hanning(2000)
    spectrum = np.fft.rfft((with_it - without)[2000:] * window) / window.sum() * 2
    return np.fft.rfftfreq(2000, 0.01), np.abs(spectrum)


def test_wheel_order_is_one_line_whatever_the_steer():
    for steer in (0.5, 2.0):
        frequency, amplitude = added_spectrum("wheel_order", steer)
        peak = np.argmax(amplitude)
        assert frequency[peak] == pytest.approx(60 / 3.6 / (2 * np.pi * 0.305), abs=0.05)
        assert amplitude[peak] == pytest.approx(14 * np.sqrt(2), rel=0.15)  # a window's loss between two lines
        assert np.all(amplitude[np.abs(frequency - frequency[peak]) > 0.2] < 0.02 * amplitude[peak])


def test_a_shaft_order_is_one_line_at_its_speed_and_its_angle_turns_it():
    time = np.arange(800) / 200
    channels = {"displacement": np.sin(time), "velocity": np.cos(time)}
    values = {"c": 1e3, "p": 0.0, "d": 0.0, "F_0": 0.0}
    plain = output(find_model("kelvin_voigt_damper"), values, channels, 1 / 200)
    for angle in (0.0, 1.0):
        turning = output(
            extended("kelvin_voigt_damper", "shaft_order"), {**values, "A_oc": 3.0, "A_os": -4.0}, channels, 1 / 200,
            {"rotational_speed": 40.0, "shaft_angle": angle},
        )  # fmt: skip
        turned = 40.0 * time + angle
        np.testing.assert_allclose(turning - plain, 3 * np.cos(turned) - 4 * np.sin(turned), atol=1e-9)
    unobserved = find_effect("shaft_order").for_tests(set())
    given = {"A_o": 5.0, "theta_o": -1.0, "e_o": 0.01}
    alone = output(
        with_effects(find_model("kelvin_voigt_damper"), unobserved), {**values, **given}, channels, 1 / 200,
        {"rotational_speed": 40.0},
    )  # fmt: skip
    np.testing.assert_allclose(alone - plain, 5 * np.cos(1.01 * 40.0 * time - 1.0), atol=1e-9)


def test_drum_runout_gives_sidebands_of_the_drum_order():
    frequency, amplitude = added_spectrum("drum_runout", 1.0)
    drum = 60 / 3.6 / (2 * np.pi * 0.61)
    strongest = sorted(frequency[np.argsort(amplitude)[-6:]])
    assert all(min(abs(f - drum - 1), abs(f - drum + 1)) < 0.1 for f in strongest)
    assert min(strongest) < drum < max(strongest)


def test_phases_turn_wheel_and_drum():
    for effect, phase in (("wheel_order", "wheel_phase"), ("drum_runout", "drum_phase")):
        model = extended("maxwell_tyre", effect)
        turned = output(model, TYRE, sine(1.0, 200), 0.01, {**ROLLING, phase: 2 * np.pi})
        same = output(model, TYRE, sine(1.0, 200), 0.01, ROLLING)
        other = output(model, TYRE, sine(1.0, 200), 0.01, {**ROLLING, phase: np.pi})
        assert turned == pytest.approx(same, abs=1e-6)
        assert np.max(np.abs(other - same)) > 5


@settings(max_examples=20)
@given(start=st.floats(0, 3600), rate=st.floats(-1e-4, 1e-4))
def test_drift_is_linear_in_the_time_since_the_campaign_began(start, rate):
    model = extended("tmeasy_curve", "drift")
    channels, time = sine(1.0, 50), np.arange(50) / 100
    plain = output(find_model("tmeasy_curve"), {}, channels, 0.01, ROLLING)
    drifted = output(model, {"k_t": rate}, channels, 0.01, {**ROLLING, "start_time": start})
    assert drifted == pytest.approx(plain * (1 + rate * (start + time)), rel=1e-12)


def test_warm_up_fades_within_the_run():
    channels, time = sine(1.0, 500), np.arange(500) / 100
    plain = output(find_model("tmeasy_curve"), {}, channels, 0.01, ROLLING)
    warm = output(extended("tmeasy_curve", "warm_up"), {"w_t": 0.1, "tau_t": 2.0}, channels, 0.01, ROLLING)
    assert warm == pytest.approx(plain * (1 + 0.1 * np.exp(-time / 2)), rel=1e-12)


@pytest.mark.parametrize(
    ("effect", "parameter", "changed"),
    [("cornering_stiffness", "e_alpha", "dF0"), ("friction_level", "e_mu", "F_M"), ("carcass_stiffness", "e_y", "c_y")],
)
def test_error_of_a_parameter_is_another_parameter(effect, parameter, changed):
    base = find_model("maxwell_tyre")
    nominal = {p.name: p.nominal for p in base.parameters}
    erroneous = output(extended("maxwell_tyre", effect), {parameter: 0.1}, sine(2.0, 300), 0.01, ROLLING)
    other = output(base, {changed: 1.1 * nominal[changed]}, sine(2.0, 300), 0.01, ROLLING)
    assert erroneous == pytest.approx(other, rel=1e-9, abs=1e-9)


def test_speed_error_is_another_speed():
    faster = {"longitudinal_velocity": 1.1 * 60 / 3.6}
    erroneous = output(extended("maxwell_tyre", "speed"), {"e_v": 0.1}, sine(2.0, 300), 0.01, ROLLING)
    other = output(find_model("maxwell_tyre"), {}, sine(2.0, 300), 0.01, faster)
    assert erroneous == pytest.approx(other, rel=1e-6, abs=1e-3)


def test_slip_offset_and_camber_shift_the_angle():
    plain = tyre_force(find_model("tmeasy_curve"), {}, 0.032, {})
    assert tyre_force(extended("tmeasy_curve", "slip_offset"), {"alpha_0": 0.002}, 0.03, {}) == pytest.approx(plain)
    inclined = output(
        extended("tmeasy_curve", "camber"), {"epsilon_c": 0.1}, {"slip_angle": np.full(3, 0.03)}, 0.01,
        {**ROLLING, "camber_angle": 0.02},
    )  # fmt: skip
    assert inclined == pytest.approx(np.full(3, plain))


def test_gain_offset_and_cross_talk_change_the_channel():
    plain = output(find_model("tmeasy_curve"), {}, sine(1.0, 50), 0.01, ROLLING)
    for effect, values, expected in (
        ("force_gain", {"g_F": 0.02}, 1.02 * plain),
        ("force_offset", {"F_off": 25.0}, plain + 25),
        ("cross_talk", {"chi_z": 0.01}, plain + 36),
    ):
        shown = output(
            extended("tmeasy_curve", effect), values, sine(1.0, 50), 0.01, {**ROLLING, "vertical_force": 3600}
        )
        assert shown == pytest.approx(expected)


AT_REST = {"lateral_deflection": 0.012, "branch_displacement": 0.01}


@settings(max_examples=20)
@given(angle=st.floats(-0.06, 0.06), kappa=st.floats(0, 2.8e-6), y=st.floats(-0.02, 0.02))
def test_compliance_turns_the_wheel_by_its_own_force(angle, kappa, y):
    states = {"lateral_deflection": y, "branch_displacement": 0.8 * y}
    force = tyre_force(extended("maxwell_tyre", "steering_compliance"), {"kappa_s": kappa}, angle, states)
    expected = tyre_force(find_model("maxwell_tyre"), {}, angle - kappa * force, states)
    assert force == pytest.approx(expected, abs=0.15)


@settings(max_examples=20)
@given(angle=st.floats(-0.06, 0.06), kappa=st.floats(-1e-5, 1e-5), y=st.floats(-0.02, 0.02))
def test_lateral_force_changes_the_load(angle, kappa, y):
    states = {"lateral_deflection": y, "branch_displacement": 0.8 * y}
    base = find_model("maxwell_tyre")
    force = tyre_force(extended("maxwell_tyre", "load_coupling"), {"kappa_z": kappa}, angle, states)
    nominal = {p.name: p.nominal * (1 + kappa * force) for p in base.parameters if p.name in ("dF0", "F_M")}
    assert force == pytest.approx(tyre_force(base, nominal, angle, states), abs=0.2)


def test_a_compliant_or_coupled_tyre_starts_at_rest():
    for effect, parameter in (("steering_compliance", "kappa_s"), ("load_coupling", "kappa_z")):
        model = extended("maxwell_tyre", effect)
        system = build_system(model)
        p, c = point(model, {}), [ROLLING.get(x.name, x.default) for x in model.conditions]
        start = system.initial([0.03], p[0], c)
        rate = float(system.rhs(start, [0.03], p[0], c)[0])
        p[0, system.parameters.index(parameter)] = 0
        without = float(system.rhs(start, [0.03], p[0], c)[0])
        assert abs(rate) < 0.02 * abs(without)
