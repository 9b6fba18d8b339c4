"""Effects of which one moves a condition that the other depends on."""

from dataclasses import replace
from pathlib import Path

import pytest

from mofit.data import Campaign
from mofit.diagnosis.diagnose import diagnose
from mofit.identification.settings import Settings
from mofit.models import find_model
from mofit.simulation.virtual_rig import plan as plans
from mofit.simulation.virtual_rig.plan import read_plan
from mofit.simulation.virtual_rig.rig import run_plan

PLAN = Path(__file__).parents[2] / "data" / "plans" / "table5.toml"
ORDERS = {"wheel_order": {"A_wc": 20.0, "A_ws": -20.0}, "drum_runout": {"m_dc": 0.01, "m_ds": -0.01}}


def with_encoder(campaign: Campaign) -> Campaign:
    """The angles of the virtual rig stated; without them the rate of an order says nothing of the speed."""
    stated = {"wheel_phase": 0.0, "drum_phase": 0.0}
    tests = [
        replace(m, experiment=replace(m.experiment, conditions={**m.experiment.conditions, **stated}))
        for m in campaign.measurements
    ]
    return replace(campaign, measurements=tuple(tests))


@pytest.mark.slow
@pytest.mark.parametrize(("order", "error"), [("wheel_order", 0.03), ("wheel_order", 0.08), ("drum_runout", 0.03)])
def test_at_another_speed_what_turns_has_another_frequency(order: str, error: float) -> None:
    """With the speed off by some percent, wheel and drum turn several times more in the longest tests."""
    hidden = (
        plans.EffectPlan(name="speed", parameters={"e_v": error}),
        plans.EffectPlan(name=order, parameters=ORDERS[order]),
    )
    campaign = with_encoder(run_plan(read_plan(PLAN).model_copy(update={"effects": hidden})))
    candidates = ("speed", order, "carcass_stiffness", "sensor_lowpass")
    found = diagnose(campaign, find_model("maxwell_tyre"), candidates, Settings(jobs=1))
    assert found.conclusion.verdict == "several"
    assert found.attribution.best.effects == tuple(sorted(("speed", order)))
    sizes = {effect.name: effect.size for effect in found.conclusion.effects}
    assert sizes["speed"] == pytest.approx(error, abs=0.001)
