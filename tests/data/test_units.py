import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mofit.units import SI_UNITS, UnitError, base_units, normal, si_unit, to_si

FACTORS = [
    ("deg", "rad", np.pi / 180),
    ("°", "rad", np.pi / 180),
    ("deg/s", "rad/s", np.pi / 180),
    ("rpm", "rad/s", np.pi / 30),
    ("kN", "N", 1e3),
    ("km/h", "m/s", 1 / 3.6),
    ("bar", "Pa", 1e5),
    ("mm", "m", 1e-3),
    ("µm", "m", 1e-6),
    ("ms", "s", 1e-3),
    ("N/mm", "N/m", 1e3),
    ("N s/mm", "N s/m", 1e3),
    ("N*s/mm", "N s/m", 1e3),
    ("m s-1", "m/s", 1.0),
    ("%", "1", 0.01),
    ("-", "1", 1.0),
]


@pytest.mark.parametrize(("unit", "si", "factor"), FACTORS)
def test_units_convert(unit, si, factor):
    np.testing.assert_allclose(to_si([1.0, -2.5], unit, si), [factor, -2.5 * factor], rtol=1e-12)
    assert si_unit(unit) == si


@given(values=st.lists(st.floats(-1e9, 1e9), min_size=1, max_size=20), row=st.sampled_from(FACTORS))
def test_conversion_is_linear_and_exact_to_rounding(values, row):
    unit, si, factor = row
    np.testing.assert_allclose(to_si(values, unit, si), np.array(values) * factor, rtol=1e-12, atol=1e-300)


def test_temperature_has_an_offset():
    np.testing.assert_allclose(to_si([20.0], "degC", "K"), [293.15])


@pytest.mark.parametrize("unit", SI_UNITS)
def test_si_units_stay_as_they_are(unit):
    assert normal(unit) == unit
    assert si_unit(unit) == unit
    values = np.array([1.5, -3.0])
    assert to_si(values, unit, unit) is values


@pytest.mark.parametrize(("unit", "si"), [("deg", "N"), ("1", "rad"), ("Hz", "rad/s"), ("kg", "N"), ("N", "Pa")])
def test_a_unit_that_does_not_fit_names_both(unit, si):
    with pytest.raises(UnitError, match=f"'{unit}'.*'{si}'"):
        to_si([1.0], unit, si)


@pytest.mark.parametrize("unit", ["furlongs per", "xyzzy", "N /", "3 N m"])
def test_an_unknown_unit_is_named(unit):
    with pytest.raises(UnitError):
        si_unit(unit)


@pytest.mark.parametrize(
    ("unit", "factor", "powers"),
    [
        ("N s/m", 1.0, {"kg": 1, "s": -1}),
        ("N m/rad", 1.0, {"kg": 1, "m": 2, "s": -2, "rad": -1}),
        ("V", 1.0, {"kg": 1, "m": 2, "s": -3, "A": -1}),
        ("Hz", 1.0, {"s": -1}),
        ("1", 1.0, {}),
        ("kN", 1e3, {"kg": 1, "m": 1, "s": -2}),
        ("g", 1e-3, {"kg": 1}),
        ("m/s/s^2", 1.0, {"m": 1, "s": -3}),
    ],
)
def test_units_are_powers_of_the_base_units(unit, factor, powers):
    found = base_units(unit)
    assert found[0] == pytest.approx(factor, rel=1e-12)
    assert found[1] == powers


@pytest.mark.parametrize("unit", ["mystery", "bit/s", "degC"])
def test_a_unit_of_something_else_or_with_an_offset_has_no_base_units(unit):
    with pytest.raises(UnitError):
        base_units(unit)
