"""Models and effects by name."""

from pathlib import Path

import casadi as ca
import pytest

from mofit.errors import InputError
from mofit.models import build_system, with_effects
from mofit.models.registry import effect_names, find_effect, find_model, model_names
from mofit.parameters import ParameterSpace

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


@pytest.mark.parametrize("name", model_names())
def test_every_model_builds_under_its_name(name):
    model = find_model(name)
    assert model.name == name
    assert model.title
    assert len(ParameterSpace(model.parameters)) == len(build_system(model).parameters)
    assert all(p.description for p in model.parameters)


@pytest.mark.parametrize("name", model_names())
def test_baseline_and_stages_are_shipped_models_with_parameters_of_the_model(name):
    model = find_model(name)
    own = {p.name for p in model.parameters}
    if model.baseline:
        assert find_model(model.baseline).outputs == model.outputs
    for stage in model.stages:
        assert {p.name for p in find_model(stage.model).parameters} <= own


@pytest.mark.parametrize("name", effect_names())
def test_every_effect_is_found_under_its_name(name):
    effect = find_effect(name)
    assert effect.name == name
    assert effect.title
    assert len(ParameterSpace(effect.parameters)) > 0


@pytest.mark.parametrize(
    ("find", "name", "hint"), [(find_model, "maxwel_tyre", "maxwell_tyre"), (find_effect, "dry_fric", "dry_friction")]
)
def test_unknown_name_gets_the_closest_one(find, name, hint):
    with pytest.raises(InputError, match=rf"{name}.*unknown name.*Did you mean '{hint}'"):
        find(name)


def test_own_model_and_effect_come_from_a_file():
    model = find_model(f"{EXAMPLES / 'own_model.py'}:ZenerDamper")
    assert build_system(model).states == ("branch_force",)
    effect = find_effect(f"{EXAMPLES / 'own_effect.py'}:DeadZone")
    extended = with_effects(model, effect)
    assert next(p.unit for p in extended.parameters if p.name == "gap") == "m"
    system = build_system(extended)
    values = [{"k": 800.0, "gap": 2e-3}.get(name, 1.0) for name in system.parameters]
    for stroke, force in ((0.5e-3, 0.0), (3e-3, 800.0 * 2e-3), (-3e-3, -800.0 * 2e-3)):
        inputs = [stroke if name == "displacement" else 0.0 for name in system.inputs]
        assert float(ca.DM(system.out([0.0], inputs, values, []))) == pytest.approx(force)


def test_missing_file_is_named():
    with pytest.raises(InputError, match=r"nowhere\.py"):
        find_model("nowhere.py:Model")
