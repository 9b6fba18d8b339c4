"""Every effect leaves every model as it is at its neutral value, and does what it says at others."""

import casadi as ca
import numpy as np
import pytest
from reference_response import response

from mofit.library import effect_names, find_effect, find_model, model_names
from mofit.model import Effect, Model, build_system, why_not, with_effects

CONDITIONS = {"longitudinal_velocity": 60 / 3.6, "start_time": 300.0}
PAIRS = [
    (model, effect)
    for model in model_names()
    for effect in effect_names()
    if why_not(find_effect(effect), find_model(model)) is None
]


def nominal(owner: Model | Effect) -> dict[str, float]:
    return {p.name: p.nominal for p in owner.parameters}


def at(model: Model, values: dict[str, float], states: dict[str, float], inputs: list[float]):
    """Rates by state, and outputs, at one point."""
    system = build_system(model)
    p = [values[name] for name in system.parameters]
    c = [CONDITIONS.get(condition.name, condition.default) for condition in model.conditions]
    inputs = [*inputs, *[1.2] * (len(system.inputs) - len(inputs))]  # an effect's own input is the time
    x = [states[name] for name in system.states]
    rates = system.rhs(x, inputs, p, c).full().ravel()
    return dict(zip(system.states, rates, strict=True)), system.out(x, inputs, p, c).full().ravel()


def test_every_effect_fits_some_model():
    assert {effect for _, effect in PAIRS} == set(effect_names())


@pytest.mark.parametrize(("model", "effect"), PAIRS)
def test_neutral_effect_leaves_the_model_unchanged(model, effect, rng):
    base, addition = find_model(model), find_effect(effect)
    extended = with_effects(base, addition)
    values = nominal(extended) | addition.neutral
    assert addition.size
    for _ in range(5):
        states = {state.name: rng.normal(0, 0.01) for state in extended.states}
        states["play_free"] = states.get("play_position")  # one trajectory where there is no play
        inputs = list(rng.normal(0, 0.03, len(base.inputs)))
        rates, outputs = at(extended, values, states, inputs)
        base_rates, base_outputs = at(base, values, states, inputs)
        assert outputs == pytest.approx(base_outputs, rel=1e-13, abs=1e-13)
        assert {name: rates[name] for name in base_rates} == pytest.approx(base_rates, rel=1e-12, abs=1e-13)


@pytest.mark.parametrize(("model", "effect"), PAIRS)
def test_typical_effect_changes_the_model(model, effect):
    extended = with_effects(find_model(model), find_effect(effect))
    states = {state.name: 0.004 * (k + 1) for k, state in enumerate(extended.states)}
    inputs = [0.03, 0.2][: len(find_model(model).inputs)]
    rates, outputs = at(extended, nominal(extended), states, inputs)
    base_rates, base_outputs = at(find_model(model), nominal(extended), states, inputs)
    changed = [rates[name] - base_rates[name] for name in base_rates] + list(outputs - base_outputs)
    assert np.max(np.abs(changed)) > 1e-6


@pytest.mark.parametrize("model", ["maxwell_tyre", "maxwell_damper", "oscillator"])
def test_all_effects_at_once_build(model):
    effects = [find_effect(e) for e in effect_names() if why_not(find_effect(e), find_model(model)) is None]
    system = build_system(with_effects(find_model(model), *effects))
    assert len(set(system.parameters)) == len(system.parameters)


def test_forces_in_parallel_balance_at_the_contact_patch():
    # carcass + branch + damper + quadratic damper + friction = the lateral force that comes out
    model = with_effects(find_model("maxwell_tyre"), find_effect("dry_friction"), find_effect("quadratic_damping"))
    values = nominal(model)
    states = {"lateral_deflection": 0.008, "branch_displacement": 0.002, "friction": 0.6}
    rates, (force,) = at(model, values, states, [0.03])
    y, rate = 0.008, rates["lateral_deflection"]
    carcass = values["c_y"] * (1 + values["p_y"] * y) * y + values["c_M"] * (y - 0.002)
    dampers = values["d_y"] * rate + values["d_2"] * rate * abs(rate) + values["F_d"] * 0.6
    assert force == pytest.approx(carcass + dampers, rel=1e-10)


def stroke(t: ca.SX) -> list[ca.SX]:
    return [0.01 * ca.sin(6 * t), 0.06 * ca.cos(6 * t)]


def extra_force(effect: str, changes: dict[str, float], time) -> np.ndarray:
    """What an effect adds to the force of a damper."""
    base = find_model("kelvin_voigt_damper")
    model = with_effects(base, find_effect(effect))
    values = nominal(model) | changes
    return response(model, values, time, stroke) - response(base, values, time, stroke)


def test_effects_add_what_their_formulas_say():
    time = np.linspace(0, 1, 21)
    x, v = 0.01 * np.sin(6 * time), 0.06 * np.cos(6 * time)
    assert extra_force("cubic_stiffness", {"k_c": 2e7}, time) == pytest.approx(2e7 * x**3)
    assert extra_force("asymmetric_stiffness", {"k_a": 500}, time) == pytest.approx(500 * np.abs(x))
    assert extra_force("quadratic_damping", {"d_2": 300}, time) == pytest.approx(300 * v * np.abs(v))
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


def test_dahl_friction_saturates_at_its_force():
    time = np.array([0.0, 0.2])
    assert extra_force("dry_friction", {"F_d": 30, "delta_d": 1e-4}, time)[1] == pytest.approx(30, rel=1e-6)


def test_slip_offset_shifts_the_curve():
    model = with_effects(find_model("tmeasy_curve"), find_effect("slip_offset"))
    values = nominal(model) | {"alpha_0": 0.002}
    _, shifted = at(model, values, {}, [0.03])
    _, plain = at(find_model("tmeasy_curve"), values, {}, [0.032])
    assert shifted == pytest.approx(plain, rel=1e-14)
