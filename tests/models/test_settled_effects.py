"""Effects on a settled tyre, which the calibration tests may have had too: known forces, and the sign of the slope."""

import numpy as np
import pytest
from kernel_response import point, simulator
from scipy.optimize import brentq

from mofit.models import find_effect, find_model, with_effects

STEP = 0.01
CURVE = {"dF0": 62e3, "s_M": 0.13, "F_M": 3100.0}
CONDITIONS = {"longitudinal_velocity": 60 / 3.6, "dynamic_rolling_radius": 0.305}
ANGLE = np.radians(2.0)


def held(effect: str = "", **values: float) -> float:
    """Force [N] at the end of a ramp to two degrees that is held for two seconds."""
    model = find_model("tmeasy_curve")
    model = with_effects(model, find_effect(effect)) if effect else model
    return forces(model, CURVE | values)[0]


def forces(model, values, free=()) -> tuple[float, np.ndarray]:
    time = STEP * np.arange(300)
    angle = values.pop("angle", ANGLE) * np.sin(0.5 * np.pi * np.minimum(time, 1.0)) ** 2
    rig = simulator(model, [({"slip_angle": angle}, CONDITIONS)], STEP, free)
    output, slopes = rig.sensitivities(point(model, values))[0]
    return float(output[0, -1, 0]), slopes[0, -1, 0]


def test_compliance_is_the_implicit_solution() -> None:
    kappa = 3e-6

    def gap(force: float) -> float:
        return forces(find_model("tmeasy_curve"), CURVE | {"angle": ANGLE - kappa * force})[0] - force

    assert held("steering_compliance", kappa_s=kappa) == pytest.approx(brentq(gap, 0, 4000, xtol=1e-6), rel=1e-4)


def test_load_goes_with_the_force() -> None:
    assert held("load_coupling", kappa_z=1e-5) == pytest.approx(held() * (1 + 1e-5 * held()), rel=1e-9)


@pytest.mark.parametrize("width", [0.0, 1e-4])
def test_play_takes_off_a_held_angle_on_the_side_it_came_from(width: float) -> None:
    model = with_effects(find_model("tmeasy_curve"), find_effect("backlash"))
    force, (slope,) = forces(model, CURVE | {"b_0": width}, ("b_0",))
    assert force == pytest.approx(held(angle=ANGLE - width), rel=3e-5)  # the ramp ends within the play's millisecond
    by_angle = (held(angle=ANGLE + 1e-5) - held(angle=ANGLE - 1e-5)) / 2e-5
    assert slope == pytest.approx(-by_angle, rel=0.02)
