"""Longitudinal tyres and combined slip against a reference integration, and against their twins."""

import numpy as np
import pytest
import tyre_reference as reference
from kernel_response import point, simulator

from mofit.models import build_system, default_model, find_model

STEP = 0.005
TIME = np.arange(241) * STEP
CONDITIONS = {"longitudinal_velocity": reference.SPEED}
VALUES = {**reference.LATERAL, **reference.LONGITUDINAL}


def braking(t: float) -> float:
    """Up to beyond the maximum of the curve, both ways."""
    return 0.16 * np.sin(2 * np.pi * 1.7 * t) * np.exp(-t)


def steering(t: float) -> float:
    return 0.12 * np.sin(2 * np.pi * 2.3 * t + 0.4) - 0.12 * np.sin(0.4)


def simulated(name, **signals):
    """All outputs (n, ny)."""
    model = find_model(name)
    channels = {channel: np.array([signal(t) for t in TIME]) for channel, signal in signals.items()}
    run = simulator(model, [(channels, CONDITIONS)], STEP, steps=8)
    return run.simulate(point(model, VALUES))[0][0]


def test_longitudinal_tyre_is_the_reference_integration():
    force = simulated("maxwell_tyre_longitudinal", slip_ratio=braking)[:, 0]
    expected = reference.forces({}, TIME, braking, None)[0]
    assert np.ptp(expected) > 5e3
    assert np.max(np.abs(force - expected)) < 2e-5 * np.ptp(expected)


def test_combined_slip_is_the_reference_integration():
    forces = simulated("maxwell_tyre_combined", slip_angle=steering, slip_ratio=braking)
    expected = reference.forces({}, TIME, braking, steering)
    for k, values in ((1, forces[:, 0]), (0, forces[:, 1])):
        assert np.max(np.abs(values - expected[k])) < 1e-4 * np.ptp(expected[k]), k
    # they do couple: neither force is that of its own slip alone
    alone = reference.forces({}, TIME, braking, None)[0], reference.forces({}, TIME, None, steering)[1]
    for k in (0, 1):
        assert np.max(np.abs(alone[k] - expected[k])) > 0.05 * np.ptp(expected[k])


@pytest.mark.parametrize(
    ("twin", "slip", "other", "output"),
    [("maxwell_tyre", "slip_angle", "slip_ratio", 0), ("maxwell_tyre_longitudinal", "slip_ratio", "slip_angle", 1)],
)
def test_combined_slip_in_one_direction_is_the_twin(twin, slip, other, output):
    """But for the velocity that keeps the slip finite, which is beside the normalised transport velocity."""
    signal = {"slip_angle": steering, "slip_ratio": braking}[slip]
    both = simulated("maxwell_tyre_combined", **{slip: signal, other: lambda t: 0.0})
    alone = simulated(twin, **{slip: signal})[:, 0]
    assert np.max(np.abs(both[:, output] - alone)) < 1e-3 * np.ptp(alone)
    assert np.max(np.abs(both[:, 1 - output])) < 1e-6 * np.ptp(alone)


def settled(name, inputs):
    """Forces at rest under constant inputs, from the initial state."""
    model = find_model(name)
    system = build_system(model)
    p = [VALUES[parameter] for parameter in system.parameters]
    c = [CONDITIONS.get(one.name, one.default) for one in model.conditions]
    x = system.initial(inputs, p, c)
    assert np.max(np.abs(system.rhs(x, inputs, p, c).full())) < 1e-9
    return system.out(x, inputs, p, c).full().ravel()


@pytest.mark.parametrize("ratio", [-1.0, -0.05, 0.0, 0.02, 0.3])
def test_longitudinal_tyre_at_rest_gives_the_steady_force(ratio):
    """A locked wheel slides: its force is finite."""
    (force,) = settled("maxwell_tyre_longitudinal", [ratio])
    slip = reference.SPEED * ratio / (reference.SPEED * abs(1 + ratio) + 0.01)
    curve = [reference.LONGITUDINAL[name] for name in ("dF0_x", "s_Mx", "F_Mx")]
    assert force == pytest.approx(np.sign(ratio) * reference.tmeasy(abs(slip), *curve), rel=1e-9)


def test_combined_force_points_along_the_normalised_slip():
    """On an ellipse of maximum forces: 3400 N along, 3100 N across."""
    across, along = settled("maxwell_tyre_combined", [0.5, -0.6])
    assert along < 0 < across
    sliding = 0.95**2
    assert (along / 3400) ** 2 + (across / 3100) ** 2 == pytest.approx(sliding, rel=0.02)


def test_channels_choose_the_model():
    lateral, along = {"slip_angle", "lateral_force"}, {"slip_ratio", "longitudinal_force"}
    assert default_model(lateral).name == "maxwell_tyre"
    assert default_model(along).name == "maxwell_tyre_longitudinal"
    assert default_model(lateral | along).name == "maxwell_tyre_combined"
