import numpy as np
import pytest

from mofit.errors import InputError
from mofit.models import FORMS, Law, build_system, find_model, law_parameters, laws_of, values_under, with_laws
from mofit.parameters import Parameter

STIFFNESS = Parameter("c", "N/m", 1e3, 1e6, 1e4, "log")
OFFSET = Parameter("F_0", "N", -100.0, 100.0, 0.0)
#: at 310 K, half way from the centre (300 K) to the end (320 K), with coefficients 0.4 and 0.2
EXPECTED = {
    "linear": 1 + 0.4 * 0.5,
    "quadratic": 1 + 0.4 * 0.5 + 0.2 * 0.25,
    "exponential": np.exp(0.4 * 0.5),
    "power": (310 / 300) ** 0.4,
    "arrhenius": np.exp(0.4 * (1 / 310 - 1 / 300)),
    "wlf": np.exp(0.4 * 0.5 / (1 + 0.2 * 0.5)),
}


def law(form: str, parameter: str = "c") -> Law:
    return Law(parameter, "temperature", form, 300.0, 20.0, "K")


@pytest.mark.parametrize("form", FORMS)
def test_a_parameter_follows_the_formula_of_its_law(form):
    own = law(form)
    coefficients = dict(zip(own.coefficients, (0.4, 0.2), strict=False))
    values = {"c": 2e4, **coefficients}
    at = {"temperature": np.array([300.0, 310.0])}
    assert values_under(STIFFNESS, [own], values, at) == pytest.approx([2e4, 2e4 * EXPECTED[form]])


def test_a_parameter_that_may_be_negative_is_shifted():
    own = law("quadratic", "F_0")
    values = {"F_0": -5.0, "F_0_temperature": 4.0, "F_0_temperature_2": -8.0}
    at = {"temperature": np.array([280.0, 310.0])}
    assert values_under(OFFSET, [own], values, at) == pytest.approx([-5 - 4 - 8, -5 + 2 - 2])
    assert [one.upper for one in law_parameters(own, OFFSET)] == [100.0, 100.0]


def test_laws_over_two_conditions_multiply():
    laws = [law("linear"), Law("c", "vertical_force", "linear", 3000.0, 1000.0, "N")]
    values = {"c": 1e4, "c_temperature": -0.5, "c_vertical_force": 0.3}
    at = {"temperature": 320.0, "vertical_force": 4000.0}
    assert values_under(STIFFNESS, laws, values, at) == pytest.approx(1e4 * 0.5 * 1.3)


def test_a_law_keeps_what_cannot_be_negative_above_zero():
    values = {"c": 1e4, "c_temperature": -1.0}
    beyond = values_under(STIFFNESS, [law("linear")], values, {"temperature": np.array([320.0, 400.0])})
    assert np.all(beyond > 0)


def test_the_system_of_a_model_with_laws_reads_the_condition():
    base = find_model("kelvin_voigt_damper")
    model = with_laws(base, [law("linear"), law("linear", "F_0")])
    system, plain = build_system(model), build_system(base)
    assert (model.name, system.conditions) == (base.name, ("temperature",))
    values = {"c": 2e4, "p": 0.0, "d": 5e2, "F_0": 3.0, "c_temperature": 0.25, "F_0_temperature": 2.0}
    p = [values[name] for name in system.parameters]
    with_law = system.out([], [0.01, 0.2], p, [310.0])
    without = plain.out([], [0.01, 0.2], [2e4 * 1.125, 0.0, 5e2, 4.0], [])
    assert float(with_law) == pytest.approx(float(without))
    assert laws_of(model) == (law("linear"), law("linear", "F_0"))


def test_ranges_of_a_law_stay_in_the_parameters_range():
    (slope,) = law_parameters(law("exponential"), STIFFNESS)
    assert np.exp(slope.upper) == pytest.approx(np.sqrt(1e6 / 1e3))
    (relative,) = law_parameters(law("linear"), STIFFNESS)
    assert relative.possible == (-1.0, 1.0)


@pytest.mark.parametrize(
    ("own", "message"),
    [
        (law("cubic"), "unknown law"),
        (law("power", "F_0"), "log scale"),
        (Law("c", "temperature", "arrhenius", 10.0, 20.0, "K"), "above 0"),
    ],
)
def test_a_law_that_does_not_suit_is_refused(own, message):
    with pytest.raises(InputError, match=message):
        with_laws(find_model("kelvin_voigt_damper"), [own])
