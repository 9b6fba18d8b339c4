"""Effects on a user's model that happens to use their names: the same effects, by names of their own."""

import dataclasses

import casadi as ca
import numpy as np
import pytest
from damper_rig import damper_campaign

from mofit.diagnosis.candidates import choose_effects
from mofit.errors import InputError
from mofit.models import Applied, Effect, Equations, Model, apart, build_system, incompatibility, with_effects
from mofit.models.registry import effect_names, find_effect, find_model
from mofit.parameters import Parameter

BASE = find_model("kelvin_voigt_damper")
ADMITTED = [name for name in effect_names() if incompatibility(find_effect(name), BASE) is None]


class Crowded(Model):
    """The damper with one more constant and one more state for every name that an effect uses."""

    title, inputs, outputs, conditions = BASE.title, BASE.inputs, BASE.outputs, BASE.conditions

    def __init__(self, effect: Effect) -> None:
        self.name = "crowded"
        own = tuple(dataclasses.replace(one, neutral=None, scales=()) for one in effect.parameters)
        self.parameters, self.states = (*BASE.parameters, *own), (*BASE.states, *effect.states)
        self._added = [state.name for state in effect.states]

    def equations(self, s):
        """The damper's, and constant states."""
        found = BASE.equations(s)
        return Equations(found.outputs, {**found.derivatives, **dict.fromkeys(self._added, ca.SX(0))})


def simulated(model: Model, values: dict[str, float], states: dict[str, float]) -> dict[str, float]:
    system = build_system(model)
    p, x = [values[name] for name in system.parameters], [states[name] for name in system.states]
    inputs, c = np.linspace(0.1, 0.3, len(system.inputs)), [one.default or 7.0 for one in model.conditions]
    rates = dict(zip(system.states, system.rhs(x, inputs, p, c).full().ravel(), strict=True))
    return {"force": float(system.out(x, inputs, p, c)), **rates}


@pytest.mark.parametrize("name", ADMITTED)
def test_the_effect_is_the_same_beside_the_models_own_names(name: str) -> None:
    effect = find_effect(name)
    own = {one.name: f"{name}_{one.name}" for group in (effect.parameters, effect.states) for one in group}
    values = {one.name: one.nominal for one in with_effects(BASE, effect).parameters}
    states = {one.name: 0.3 for one in with_effects(BASE, effect).states}
    expected = simulated(with_effects(BASE, effect), values, states)

    def renamed(named: dict[str, float]) -> dict[str, float]:
        return {own.get(key, key): value for key, value in named.items()}

    model = with_effects(Crowded(effect), effect)
    others = dict.fromkeys(own, 5.0)  # the model's own things of these names change nothing
    found = simulated(model, others | renamed(values), others | renamed(states))
    assert {key: found[key] for key in renamed(expected)} == pytest.approx(renamed(expected), rel=1e-12)


def test_a_diagnosis_tries_it_all_the_same() -> None:
    effect = find_effect("dry_friction")
    chosen, left_out = choose_effects(Crowded(effect), damper_campaign())
    assert "dry_friction" in [one.name for one in chosen]
    assert "dry_friction" not in left_out


def test_an_effect_that_the_model_has_is_left_out() -> None:
    _, left_out = choose_effects(with_effects(BASE, find_effect("dry_friction")), damper_campaign())
    assert left_out["dry_friction"] == "the model has it already"


def test_it_stays_as_it_is_where_no_name_meets() -> None:
    effect = find_effect("dry_friction")
    assert apart(effect, BASE) is effect


class Offset(Effect):
    """A user's effect with an error in its equations."""

    name, on = "offset", ("output",)
    parameters = (Parameter("c", "N", -1.0, 1.0, 0.1, neutral=0.0),)

    def apply(self, s, value: ca.SX) -> Applied:
        """Reads no number."""
        return Applied(value + s.c * int("none"))


def test_what_is_wrong_in_it_is_told_with_its_line() -> None:
    with pytest.raises(InputError, match=r"ValueError in line \d+"):
        build_system(with_effects(BASE, Offset()))
