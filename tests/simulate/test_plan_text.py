"""Plans that are written read back as they were."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mofit.simulate import plan as plans
from mofit.simulate import read_plan
from mofit.simulate.plan import EffectPlan, NoisePlan, Plan
from mofit.simulate.plan_text import plan_text

PLANS = Path(__file__).resolve().parents[2] / "data" / "plans"

numbers = st.floats(1e-3, 1e6)
words = st.text(st.characters(codec="utf-8", exclude_categories=("Cs",)), max_size=12)


def read_back(plan, tmp_path):
    path = tmp_path / "plan.toml"
    path.write_text(plan_text(plan, "one line\nand another"), encoding="utf-8")
    return read_plan(path)


@pytest.mark.parametrize("name", ["paper.toml", "table5.toml"])
def test_the_shipped_plans_survive(name, tmp_path):
    plan = read_plan(PLANS / name)
    assert read_back(plan, tmp_path) == plan


@given(words, words, numbers, st.dictionaries(words, numbers, max_size=3))
def test_any_text_and_number_survives(tmp_path_factory, title, name, number, conditions):
    plan = Plan(
        title=title,
        model="maxwell_tyre",
        seed=7,
        parameters={"c_y": number, "d_y": "281 N s/m"},
        conditions=conditions,
        effects=(EffectPlan(name="force_gain", parameters={"g_F": number}),),
        noise={"lateral_force": NoisePlan(sd="5 N", level=0.01)},
        attributes={"a key": title, "number": 3},
        pause="30 s",
        tests=(
            plans.TestPlan(
                name=f"m{name}",
                kind="multisine",
                sample_rate="100 Hz",
                amplitude=number,
                frequency="0.5 Hz",
                lines=(1, 3),
                periods=4.0,
                conditions=conditions,
            ),
            plans.TestPlan(
                name=f"s{name}", kind="step", sample_rate=100.0, amplitude="-1 deg", ramp_rate=1.0, duration=2.0
            ),
        ),
    )
    assert read_back(plan, tmp_path_factory.mktemp("plans")) == plan
