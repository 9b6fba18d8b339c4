"""Every effect leaves every model as it is at its neutral value, and does what it says at others."""

import numpy as np
import pytest

from mofit.library import effect_names, find_effect, find_model, model_names
from mofit.model import Effect, Model, build_system, why_not, with_effects

CONDITIONS = {
    "longitudinal_velocity": 60 / 3.6,
    "start_time": 300.0,
    "vertical_force": 3600.0,
    "camber_angle": 0.03,
}
PAIRS = [
    (model, effect)
    for model in model_names()
    for effect in effect_names()
    if why_not(find_effect(effect), find_model(model)) is None
]


def nominal(owner: Model | Effect) -> dict[str, float]:
    return {p.name: p.nominal for p in owner.parameters}


def at(model: Model, values: dict[str, float], states: dict[str, float], inputs: list[float]):
    """Rates and initial values by state, and outputs, at one point."""
    system = build_system(model)
    p = [values[name] for name in system.parameters]
    c = [CONDITIONS.get(condition.name, condition.default) for condition in model.conditions]
    inputs = [*inputs, *[1.2] * (len(system.inputs) - len(inputs))]  # an effect's own input is the time
    x = [states[name] for name in system.states]
    rates, initial = system.rhs(x, inputs, p, c).full().ravel(), system.initial(inputs, p, c).full().ravel()
    by_state = {name: (rate, start) for name, rate, start in zip(system.states, rates, initial, strict=True)}
    return by_state, system.out(x, inputs, p, c).full().ravel()


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
        moves, outputs = at(extended, values, states, inputs)
        base_moves, base_outputs = at(base, values, states, inputs)
        assert outputs == pytest.approx(base_outputs, rel=1e-13, abs=1e-13)
        for name, expected in base_moves.items():
            assert moves[name] == pytest.approx(expected, rel=1e-12, abs=1e-13)


@pytest.mark.parametrize(("model", "effect"), PAIRS)
def test_typical_effect_changes_the_model(model, effect, rng):
    extended = with_effects(find_model(model), find_effect(effect))
    states = {state.name: rng.normal(0, 0.01) for state in extended.states}
    inputs = [0.03, 0.2][: len(find_model(model).inputs)]
    moves, outputs = at(extended, nominal(extended), states, inputs)
    base_moves, base_outputs = at(find_model(model), nominal(extended), states, inputs)
    changed = [moves[name][0] - base_moves[name][0] for name in base_moves] + list(outputs - base_outputs)
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
    moves, (force,) = at(model, values, states, [0.03])
    y, rate = 0.008, moves["lateral_deflection"][0]
    carcass = values["c_y"] * (1 + values["p_y"] * y) * y + values["c_M"] * (y - 0.002)
    dampers = values["d_y"] * rate + values["d_2"] * rate * abs(rate) + values["F_d"] * 0.6
    assert force == pytest.approx(carcass + dampers, rel=1e-10)


def test_slip_offset_shifts_the_curve():
    model = with_effects(find_model("tmeasy_curve"), find_effect("slip_offset"))
    values = nominal(model) | {"alpha_0": 0.002}
    _, shifted = at(model, values, {}, [0.03])
    _, plain = at(find_model("tmeasy_curve"), values, {}, [0.032])
    assert shifted == pytest.approx(plain, rel=1e-14)
