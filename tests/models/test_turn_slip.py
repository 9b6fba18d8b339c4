"""Turn slip against a reference integration, and against bristles that stick to a road under a turning wheel."""

import numpy as np
import pytest
import tyre_reference as reference
from kernel_response import point, simulator

from mofit.models import default_model, find_model

STEP = 0.005
TIME = np.arange(201) * STEP
OWN = {"n_0": 0.035, "s_0": 0.15, "l_phi": 0.04, "m_phi": 170.0}


def steering(t):
    return 0.08 * np.sin(2 * np.pi * 1.3 * t)


def turning(t):
    """Curves of 5 m and more."""
    return 0.2 * np.sin(2 * np.pi * 2.1 * t)


def simulated(angles, turns, values):
    """Force and torque."""
    model, conditions = find_model("maxwell_tyre_turning"), {"longitudinal_velocity": reference.SPEED}
    run = simulator(model, [({"slip_angle": angles, "turn_slip": turns}, conditions)], STEP, steps=8)
    return run.simulate(point(model, {**reference.LATERAL, **OWN, **values}))[0][0].T


def test_force_and_torque_are_those_of_the_reference_integration():
    angles, turns = steering(TIME), turning(TIME)
    force, torque = simulated(angles, turns, {})
    expected = reference.forces(OWN, TIME, None, steering, turn_slip=turning)[1]
    without = reference.forces({}, TIME, None, steering)[1]
    assert np.max(np.abs(expected - without)) > 0.05 * np.ptp(expected)
    assert np.max(np.abs(force - expected)) < 2e-5 * np.ptp(expected)
    trail = reference.aligning_torque(expected, angles, OWN["n_0"], OWN["s_0"], turned=OWN["l_phi"] * turns)
    moment = trail + OWN["m_phi"] * turns
    assert np.max(np.abs(torque - moment)) < 1e-4 * np.ptp(moment)


@pytest.mark.parametrize(("alpha", "phi"), [(1e-4, 0.0), (0.0, 2e-3), (1e-4, 2e-3), (-1e-4, 1e-3)])
def test_little_slip_is_that_of_a_brush(alpha, phi):
    """Its lever and its torque are those of the docstring, for a contact of 12 cm by 10 cm."""
    a, b, stiffness = 0.06, 0.05, reference.LATERAL["dF0"]
    expected = brush(alpha, phi, a, b, stiffness)
    lever = a / 3
    own = {"n_0": lever, "l_phi": lever, "m_phi": lever**2 * stiffness + b**2 / 3 * stiffness}
    found = simulated(np.full(5, alpha), np.full(5, phi), own)[:, -1]
    assert found == pytest.approx(expected, rel=3e-3, abs=5e-4)  # the parts of the torque nearly cancel


def brush(alpha, phi, a, b, stiffness, count=200):
    """Force and torque of bristles over a rectangle, 2 a by 2 b, whose tips stay where they touched the road.

    The wheel rolls freely along a circle; places are complex numbers, of the road and of the wheel (x + i y).
    """
    speed, (along, across) = 1.0, (((np.arange(count) + 0.5) / count * 2 - 1) * half for half in (a, b))
    x, y = np.meshgrid(along, across)
    per_area = stiffness / (4 * a**2 * b)  # the cornering stiffness of a brush is 4 a² b k

    def pose(time):
        heading = -phi * speed * time
        travelled = speed * time if phi == 0 else (1 - np.exp(1j * heading)) / (1j * phi)
        return travelled * np.exp(-1j * alpha), np.exp(1j * heading)

    now = 1.0
    touched = pose(now - (a - x) / (speed * np.cos(alpha)))
    tip = touched[0] + touched[1] * (a + 1j * y)
    place, heading = pose(now)
    deflection = (tip - place) / heading - (x + 1j * y)
    force = per_area * deflection * (2 * a / count) * (2 * b / count)
    return np.sum(force.imag), np.sum(x * force.imag - y * force.real)


def test_a_campaign_with_turn_slip_takes_it():
    channels = ["slip_angle", "turn_slip", "lateral_force", "self_aligning_torque"]
    assert default_model(channels).name == "maxwell_tyre_turning"
