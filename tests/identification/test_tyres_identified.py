"""Longitudinal, combined and loaded tyres from noisy data of a simulator of its own: the truth in the intervals."""

from dataclasses import replace

import numpy as np
import pytest
import tyre_reference as reference

from mofit.models import find_model
from mofit.optimize import merge, refine
from mofit.problem import adjusted_posterior, build_problem
from mofit.sampling import laplace_covariance

STEP = 0.01
NOMINAL, PRESSURE = 4000.0, 2.5e5
LAWS = {
    "dF0_N": 66e3, "dF0_2N": 115e3, "dF0_p": 0.25, "s_M_N": 0.13, "s_M_2N": 0.15, "F_M_N": 3500.0, "F_M_2N": 6300.0,
    "F_M_p": -0.1,
}  # fmt: skip


def require_truth(tests, name, truth, widest=0.05):
    """The minimum that the nominal values lead to: the truth fits as well, and every interval holds it."""
    problem = build_problem(find_model(name), reference.campaign(*tests), jobs=1)
    start = problem.space.to_unit(problem.space.nominal)[None]
    problem = problem.with_noise_at(merge(refine(problem.evaluate, start))[0].point)
    best = merge(refine(problem.evaluate, start))[0].point
    true = problem.space.to_unit([truth[parameter] for parameter in problem.space.names])
    sd = np.sqrt(np.diag(laplace_covariance(adjusted_posterior(problem, best).normal_hessian)))
    assert np.max(np.abs(true - best) / sd) < 3.5
    # the box is one unit wide
    assert np.max(sd) < widest
    # noise alone fits better than the truth by its number of parameters
    at_truth, at_best = problem.objectives(np.stack([true, best]))
    assert np.mean(at_truth) < 1.02 * np.mean(at_best)


def test_longitudinal_tyre(rng):
    time, tests = np.arange(200) * STEP, []
    for amplitude, frequency in ((0.15, 1.0), (0.04, 2.0), (0.02, 5.0), (0.05, 8.0)):
        ratio = reference.ratio_of(amplitude, frequency)
        forces = reference.forces({}, time, ratio, None)
        tests.append(reference.measurement(f"{frequency} Hz", time, {"slip_ratio": ratio}, forces, 10.0, rng))
    require_truth(tests, "maxwell_tyre_longitudinal", reference.LONGITUDINAL)


def test_self_aligning_torque(rng):
    """The trail from the torque; the force is that of the tyre without."""
    time, tests, model = np.arange(200) * STEP, [], find_model("maxwell_tyre_aligning")
    truth = {**reference.LATERAL, "n_0": 0.035, "s_0": 0.18}
    for amplitude, frequency in ((0.15, 1.0), (0.04, 2.0), (0.02, 5.0), (0.05, 8.0)):
        angle = reference.ratio_of(amplitude, frequency)
        forces = reference.forces({}, time, None, angle)
        test = reference.measurement(f"{frequency} Hz", time, {"slip_angle": angle}, forces, 10.0, rng)
        torque = reference.aligning_torque(forces[1], angle(time), truth["n_0"], truth["s_0"])
        outputs = {**test.outputs, "self_aligning_torque": torque + 0.5 * rng.normal(size=len(time))}
        tests.append(replace(test, outputs=outputs, units={**test.units, "self_aligning_torque": "N m"}))
    require_truth(tests, model.name, truth)


def test_turn_slip(rng):
    """Lever and torque of turn slip beside the trail."""
    time, tests, lever, twist = np.arange(250) * 2 * STEP, [], 0.03, 170.0
    for turn, angle, first, second in ((0.04, 0.03, 0.3, 0.5), (0.08, 0.05, 1.7, 1.1), (0.06, 0.12, 2.9, 4.3)):
        signals = {"slip_angle": reference.ratio_of(angle, second), "turn_slip": reference.ratio_of(turn, first)}
        angles, turned = (one(time) for one in signals.values())
        forces = reference.forces({"l_phi": lever}, time, None, signals["slip_angle"], turn_slip=signals["turn_slip"])
        test = reference.measurement(str(len(tests)), time, signals, forces, 10.0, rng)
        torque = reference.aligning_torque(forces[1], angles, 0.035, 0.18, turned=lever * turned) + twist * turned
        outputs = {**test.outputs, "self_aligning_torque": torque + 0.5 * rng.normal(size=len(time))}
        tests.append(replace(test, outputs=outputs, units={**test.units, "self_aligning_torque": "N m"}))
    truth = {**reference.LATERAL, "n_0": 0.035, "s_0": 0.18, "l_phi": lever, "m_phi": twist}
    require_truth(tests, "maxwell_tyre_turning", truth, widest=0.08)


@pytest.mark.slow
def test_combined_slip(rng):
    """Both slips at frequencies that have no common period in the record."""
    time, tests = np.arange(250) * 2 * STEP, []
    for ratio, angle, first, second in ((0.04, 0.03, 0.3, 0.5), (0.03, 0.05, 1.7, 1.1), (0.12, 0.12, 2.9, 4.3)):
        signals = {
            "slip_ratio": reference.ratio_of(ratio, first),
            "slip_angle": reference.ratio_of(angle, second),
        }
        forces = reference.forces({}, time, *signals.values())
        tests.append(reference.measurement(str(len(tests)), time, signals, forces, 10.0, rng))
    require_truth(tests, "maxwell_tyre_combined", {**reference.LATERAL, **reference.LONGITUDINAL}, widest=0.2)


def curve_at(load, pressure):
    """Initial slope, slip at the maximum and maximum force by Lagrange through the nodes."""
    q, e = load / NOMINAL, pressure / PRESSURE - 1
    one, two = q * (2 - q), q * (q - 1) / 2
    slope = (LAWS["dF0_N"] * one + LAWS["dF0_2N"] * two) * (1 + LAWS["dF0_p"] * e)
    maximum = (LAWS["F_M_N"] * one + LAWS["F_M_2N"] * two) * (1 + LAWS["F_M_p"] * e)
    return slope, LAWS["s_M_N"] + (LAWS["s_M_2N"] - LAWS["s_M_N"]) * (q - 1), maximum


def test_steady_state_curves_of_five_loads_and_three_pressures(rng):
    """Slow sweeps of ± 10 degrees, all at once."""
    time, tests = np.arange(120) * 0.05, []
    sweep = reference.ratio_of(np.deg2rad(10), 1 / 6)
    for load in (1500.0, 2800.0, 4000.0, 5500.0, 7500.0):
        for pressure in (2.0e5, 2.5e5, 3.0e5):
            curve, values = curve_at(load, pressure), []
            for t in time:
                slip = reference.SPEED * np.sin(sweep(t)) / (reference.SPEED * np.cos(sweep(t)) + 0.01)
                values.append(np.sign(slip) * reference.tmeasy(abs(slip), *curve))
            force = np.array([np.zeros_like(time), values])
            test = reference.measurement(f"{load:g} N, {pressure:g} Pa", time, {"slip_angle": sweep}, force, 20.0, rng)
            conditions = {
                "longitudinal_velocity": reference.SPEED,
                "vertical_force": load,
                "inflation_pressure": pressure,
                "nominal_vertical_force": NOMINAL,
            }
            tests.append(replace(test, experiment=replace(test.experiment, conditions=conditions)))
    require_truth(tests, "tmeasy_curve_over_load", LAWS)
