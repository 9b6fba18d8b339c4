"""The self-aligning torque against a reference integration and TMeasy's trail written out anew."""

import casadi as ca
import numpy as np
import pytest
import tyre_reference as reference
from kernel_response import point, simulator

from mofit.models import default_model, find_model
from mofit.models.library.aligning_torque import pneumatic_trail

STEP = 0.005
TIME = np.arange(241) * STEP
TRAIL = {"n_0": 0.035, "s_0": 0.15}


def steering(t: float) -> float:
    """Beyond the slip at which the trail is zero."""
    return 0.25 * np.sin(2 * np.pi * 1.3 * t) * np.exp(-t)


def trail(slip: float) -> float:
    """By Rill, s_E = 1.75 s_0."""
    first, last = TRAIL["s_0"], 1.75 * TRAIL["s_0"]
    size, weight = abs(slip), first / last
    if size <= first:
        share = size / first
        return TRAIL["n_0"] * ((1 - weight) * (1 - share) + weight * (1 - (3 - 2 * share) * share**2))
    if size < last:
        return -TRAIL["n_0"] * (1 - weight) * (size - first) / first * ((last - size) / (last - first)) ** 2
    return 0.0


def test_the_torque_is_that_of_the_reference_integration():
    model, conditions = find_model("maxwell_tyre_aligning"), {"longitudinal_velocity": reference.SPEED}
    angles = np.array([steering(t) for t in TIME])
    run = simulator(model, [({"slip_angle": angles}, conditions)], STEP, steps=8)
    force, torque = run.simulate(point(model, {**reference.LATERAL, **TRAIL}))[0][0].T
    expected = reference.forces({}, TIME, None, steering)[1]
    assert np.max(np.abs(force - expected)) < 2e-5 * np.ptp(expected)
    moment = reference.aligning_torque(expected, angles, **TRAIL)
    assert np.any(moment * expected > 0.001 * np.ptp(moment) * np.ptp(expected))  # the trail has turned round
    assert np.max(np.abs(torque - moment)) < 1e-4 * np.ptp(moment)
    assert np.corrcoef(torque, angles)[0, 1] < 0


@pytest.mark.parametrize("slip", [0.0, 0.05, 0.1499, 0.1501, 0.2, 0.2624, 0.3])
def test_the_trail_is_that_of_tmeasy(slip):
    for own in (slip, -slip):
        assert float(pneumatic_trail(ca.DM(own), **TRAIL)) == pytest.approx(trail(slip), abs=1e-12)


def test_a_campaign_with_torque_takes_it():
    assert default_model(["slip_angle", "lateral_force", "self_aligning_torque"]).name == "maxwell_tyre_aligning"
    assert default_model(["slip_angle", "lateral_force"]).name == "maxwell_tyre"
