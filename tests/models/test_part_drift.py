"""The drift of a part of a model: of an announced force, or of a parameter that belongs to none."""

import casadi as ca
import numpy as np
import pytest

from mofit.errors import InputError
from mofit.models import Channel, Equations, Model, build_system, drifts_of, find_effect, find_model, with_effects
from mofit.parameters import Parameter


class TwoSprings(Model):
    """Announces one of its two springs."""

    name = "two_springs"
    parameters = (
        Parameter("k", "N/m", 0.0, 1e4, 1e3),
        Parameter("k_2", "N/m", 0.0, 1e4, 1e3),
        Parameter("F_0", "N", -1e3, 1e3, 0.0),
    )
    inputs = (Channel("displacement", "m"),)
    outputs = (Channel("force", "N"),)

    def equations(self, s):
        x = s.displacement
        s.quantity("damper_force", s.k_2 * x)  # for information only
        return Equations(outputs={"force": s.quantity("spring_force", s.k * x) + s.k_2 * x + s.F_0})


def force(rate, time, start, now, target="spring_force"):
    system = build_system(with_effects(TwoSprings(), find_effect(f"drift:{target}")))
    known = {"k": 100.0, "k_2": 10.0, "F_0": 1.0, f"drift_{target}": rate, f"drift_time_{target}": time}
    known |= {"displacement": 0.5, "time": now, "start_time": start}
    values = [[known[name] for name in names] for names in (system.inputs, system.parameters, system.conditions)]
    return float(ca.DM(system.out([], *values)))


def test_a_part_changes_from_the_start_of_the_campaign_and_settles() -> None:
    for start, now in ((0.0, 0.0), (0.0, 7.0), (30.0, 5.0), (1e5, 0.0)):
        change = 0.01 * 20.0 * (1 - np.exp(-(start + now) / 20.0))
        assert force(0.01, 20.0, start, now) == pytest.approx(0.5 * (100.0 * (1 + change) + 10.0) + 1.0)
    # one that takes long is linear in time
    assert force(1e-4, 1e7, 50.0, 5.0) == pytest.approx(0.5 * (100.0 * (1 + 1e-4 * 55.0) + 10.0) + 1.0)


def test_a_parameter_drifts_too() -> None:
    assert force(0.01, 1e7, 10.0, 0.0, "k_2") == pytest.approx(0.5 * (100.0 + 10.0 * 1.1) + 1.0)


def test_the_output_as_a_whole_drifts_too() -> None:
    change = 0.01 * 20.0 * (1 - np.exp(-30.0 / 20.0))
    assert force(0.01, 20.0, 25.0, 5.0, "output") == pytest.approx((0.5 * 110.0 + 1.0) * (1 + change))


def test_a_model_has_a_drift_per_part_and_of_positive_parameters_that_belong_to_none() -> None:
    assert drifts_of(TwoSprings()) == ("drift:spring_force", "drift:k_2", "drift:output")
    assert drifts_of(find_model("kelvin_voigt_damper")) == ("drift:spring_force", "drift:damper_force", "drift:output")
    assert {"drift:carcass_force", "drift:slip_stiffness"} < {*drifts_of(find_model("maxwell_tyre"))}
    included = with_effects(find_model("oscillator"), find_effect("delay"))
    assert drifts_of(included) == drifts_of(find_model("oscillator"))


def test_its_family_is_drift_and_an_unknown_part_is_refused() -> None:
    assert find_effect("drift:k").family == find_effect("drift").family
    with pytest.raises(InputError, match="acts on hinge, which model 'two_springs' does not have"):
        with_effects(TwoSprings(), find_effect("drift:hinge"))
