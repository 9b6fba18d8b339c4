"""Load and pressure in the tyre models: Rill's interpolation, and effects at the load of a test."""

import numpy as np
import pytest

from mofit.models import build_system, find_effect, find_model, model_names, with_effects

LAWS = {
    "dF0_N": 60e3, "dF0_2N": 100e3, "dF0_p": 0.2, "s_M_N": 0.13, "s_M_2N": 0.15, "F_M_N": 3500.0, "F_M_2N": 6200.0,
    "F_M_p": -0.1, "c_y_N": 120e3, "c_y_2N": 140e3, "c_y_p": 0.6,
}  # fmt: skip
REST = {"p_y": -7.5, "d_y": 280.0, "c_M": 2e4, "d_M": 7500.0}
NOMINAL, PRESSURE = 4000.0, 2.5e5


def at(load, pressure):
    """TMeasy quantities and stiffness by hand."""
    q, e = load / NOMINAL, pressure / PRESSURE - 1

    def parabola(one, two):
        # through 0, one at q = 1 and two at q = 2, by Lagrange
        return -one * q * (q - 2) + two * q * (q - 1) / 2

    return {
        "dF0": parabola(60e3, 100e3) * (1 + 0.2 * e),
        "s_M": 0.13 + 0.02 * (q - 1),
        "F_M": parabola(3500.0, 6200.0) * (1 - 0.1 * e),
        "c_y": (120e3 + 20e3 * (q - 1)) * (1 + 0.6 * e),
    }


def outputs(model, values, conditions):
    """Rates and outputs at one state."""
    system = build_system(model)
    given = {"longitudinal_velocity": 60 / 3.6, "nominal_vertical_force": NOMINAL, **conditions}
    c = [given.get(one.name, one.default) for one in model.conditions]
    p = [values[name] for name in system.parameters]
    x = [0.006, 0.002][: len(system.states)]
    u = [0.04]
    return np.concatenate([system.rhs(x, u, p, c).full().ravel(), system.out(x, u, p, c).full().ravel()])


@pytest.mark.parametrize(("load", "pressure"), [(4000.0, 2.5e5), (8000.0, 2.5e5), (1500.0, 2.0e5), (5600.0, 3.1e5)])
@pytest.mark.parametrize("name", ["tmeasy_curve", "quasi_static_spring", "kelvin_voigt_tyre", "maxwell_tyre"])
def test_model_over_load_is_the_model_with_the_values_at_that_load(name, load, pressure):
    conditions = {"vertical_force": load, "inflation_pressure": pressure}
    found = outputs(find_model(f"{name}_over_load"), LAWS | REST, conditions)
    assert found == pytest.approx(outputs(find_model(name), at(load, pressure) | REST, {}), rel=1e-12)


def test_effects_see_the_values_at_the_load():
    """An error of the initial slope scales it at any load."""
    model = with_effects(find_model("maxwell_tyre_over_load"), find_effect("cornering_stiffness"))
    conditions = {"vertical_force": 5600.0, "inflation_pressure": 3.1e5}
    found = outputs(model, LAWS | REST | {"e_alpha": 0.1}, conditions)
    values = at(5600.0, 3.1e5) | REST
    expected = outputs(find_model("maxwell_tyre"), values | {"dF0": 1.1 * values["dF0"]}, {})
    assert found == pytest.approx(expected, rel=1e-12)


def test_laws_stay_positive_far_off_their_loads():
    """A parabola that has turned round at three times the nominal load, and a line that has crossed zero at none."""
    steep = LAWS | {"dF0_2N": 30e3, "s_M_2N": 0.5}
    for load in (100.0, 16_000.0):
        force = outputs(find_model("tmeasy_curve_over_load"), steep, {"vertical_force": load})
        assert np.isfinite(force).all()
        assert force[0] > 0


def test_every_rolling_tyre_has_a_model_over_load():
    tyres = [name for name in model_names() if "tyre" in name and not name.endswith("_over_load")]
    assert {f"{name}_over_load" for name in tyres} <= set(model_names())
