"""Every effect on every model that admits it: no change at the neutral value, a change at others, exact slopes."""

from dataclasses import dataclass

import casadi as ca
import numpy as np
import pytest

from mofit.models import Channel, Effect, Equations, Model, Symbols, apart, build_system, incompatibility, with_effects
from mofit.models.registry import effect_names, find_effect, find_model, model_names
from mofit.simulation.ranges import scaled

CONDITIONS = {
    "longitudinal_velocity": 60 / 3.6,
    "start_time": 300.0,
    "vertical_force": 3600.0,
    "camber_angle": 0.03,
    "nominal_vertical_force": 4000.0,
    "frequency": 1.5,
    "rotational_speed": 55.0,
}
PAIRS = [
    (model, effect)
    for model in model_names()
    for effect in effect_names()
    if incompatibility(find_effect(effect), find_model(model)) is None
]


def nominal(owner: Model | Effect) -> dict[str, float]:
    return {p.name: p.nominal for p in owner.parameters}


class Point:
    """A model at one point: rates and initial values by state, and outputs."""

    def __init__(self, model: Model) -> None:
        self.system = build_system(model)
        self.c = [CONDITIONS.get(condition.name, condition.default) for condition in model.conditions]

    def __call__(self, values: dict[str, float], states: dict[str, float], inputs: list[float]):
        system = self.system
        inputs = [*inputs, *[1.2] * (len(system.inputs) - len(inputs))]  # an effect's own input is the time
        p, x = [values[name] for name in system.parameters], [states[name] for name in system.states]
        rates, initial = (
            system.rhs(x, inputs, p, self.c).full().ravel(),
            system.initial(inputs, p, self.c).full().ravel(),
        )
        moves = {name: (rate, start) for name, rate, start in zip(system.states, rates, initial, strict=True)}
        return moves, system.out(x, inputs, p, self.c).full().ravel()

    def slopes(self, values, states, inputs, names) -> np.ndarray:
        """Derivatives of rates and outputs by some parameters, shape (states + outputs, names)."""
        system = self.system
        inputs = [*inputs, *[1.2] * (len(system.inputs) - len(inputs))]
        p, x = ca.SX.sym("p", len(system.parameters)), [states[name] for name in system.states]
        both = ca.vertcat(system.rhs(x, inputs, p, self.c), system.out(x, inputs, p, self.c))
        jacobian = ca.Function("j", [p], [ca.jacobian(both, p)])([values[name] for name in system.parameters]).full()
        return jacobian[:, [system.parameters.index(name) for name in names]]


@dataclass
class Spring(Model):
    """A user's data class, which has no hash."""

    stiffness: float = 1e4
    name = "spring"
    inputs = (Channel("displacement", "m"),)
    outputs = (Channel("force", "N"),)

    def equations(self, s: Symbols) -> Equations:
        return Equations(outputs={"force": self.stiffness * s.displacement})


def test_a_model_without_a_hash_takes_effects():
    offset = find_effect("force_offset")
    system = build_system(with_effects(Spring(2e4), offset))
    (size,) = offset.size
    assert float(system.out([], [0.1], [3.0 if name == size else 0.0 for name in system.parameters], [])) == 2003.0


def test_every_effect_fits_some_model():
    assert {effect for _, effect in PAIRS} == set(effect_names())


@pytest.mark.parametrize(("model", "effect"), PAIRS)
def test_effect_at_points(model, effect, rng):
    """Nothing changes at neutral, something at typical size, and the slope by the size is what differences say."""
    base = find_model(model)
    plain = Point(base)
    # as a diagnosis does, for an output of this size
    _, outputs = plain(nominal(base), {state.name: 0.01 for state in base.states}, [0.03] * len(base.inputs))
    addition = scaled(apart(find_effect(effect), base), {"output": max(abs(outputs[0]), 1e-3) / 1e3})
    extended = with_effects(base, addition)
    changed = Point(extended)
    neutral = nominal(extended) | addition.neutral
    assert addition.size
    largest = 0.0
    for _ in range(3):
        states = {state.name: rng.normal(0, 0.01) for state in extended.states}
        for free in [name for name in states if name.endswith("_free")]:  # one trajectory where there is no play
            states |= dict.fromkeys((name for name in states if name.startswith(free[:-4] + "position")), states[free])
        inputs = list(rng.normal(0, 0.03, len(base.inputs)))
        moves, outputs = changed(neutral, states, inputs)
        base_moves, base_outputs = plain(neutral, states, inputs)
        assert outputs == pytest.approx(base_outputs, rel=1e-13, abs=1e-13)
        for name, expected in base_moves.items():
            assert moves[name] == pytest.approx(expected, rel=1e-12, abs=1e-13)
        typical_moves, typical = changed(nominal(extended), states, inputs)
        differences = [typical_moves[name][0] - base_moves[name][0] for name in base_moves] + list(
            typical - base_outputs
        )
        largest = max(largest, np.max(np.abs(differences)))
        slopes = changed.slopes(neutral, states, inputs, addition.size)
        for column, name in enumerate(addition.size):
            nudge = 1e-4 * addition.typical
            sides = [changed(neutral | {name: neutral[name] + side * nudge}, states, inputs) for side in (-1, 1)]
            low, high = (np.array([*(rate for rate, _ in m.values()), *y]) for m, y in sides)
            scale = np.max(np.abs(slopes[:, column])) + 1e-9
            # play is there for positive sizes only
            difference = (high - low) / (2 * nudge) if not addition.abrupt else slopes[:, column]
            assert difference == pytest.approx(slopes[:, column], rel=1e-4, abs=1e-4 * scale)
    assert largest > 1e-6


@pytest.mark.parametrize("model", ["maxwell_tyre", "maxwell_damper", "oscillator"])
def test_all_effects_at_once_build(model):
    effects = [find_effect(e) for e in effect_names() if incompatibility(find_effect(e), find_model(model)) is None]
    system = build_system(with_effects(find_model(model), *effects))
    assert len(set(system.parameters)) == len(system.parameters)


def test_forces_in_parallel_balance_at_the_contact_patch():
    # carcass + branch + damper + quadratic damper + friction = the lateral force that comes out
    model = with_effects(find_model("maxwell_tyre"), find_effect("dry_friction"), find_effect("quadratic_damping"))
    values = nominal(model)
    states = {"lateral_deflection": 0.008, "branch_displacement": 0.002, "friction": 0.6}
    moves, (force,) = Point(model)(values, states, [0.03])
    y, rate = 0.008, moves["lateral_deflection"][0]
    carcass = values["c_y"] * (1 + values["p_y"] * y) * y + values["c_M"] * (y - 0.002)
    dampers = values["d_y"] * rate + values["d_2"] * rate * abs(rate) + values["F_d"] * 0.6
    assert force == pytest.approx(carcass + dampers, rel=1e-10)
