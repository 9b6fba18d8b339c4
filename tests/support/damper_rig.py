"""A quick rig: a Kelvin–Voigt damper on four sines, with effects of our choice."""

from functools import cache

import numpy as np

from mofit.data import Campaign
from mofit.diagnosis.baseline import fit_baseline, set_up
from mofit.diagnosis.diagnose import diagnose
from mofit.diagnosis.fitting import Fitted
from mofit.diagnosis.integration import SimulatorCache
from mofit.diagnosis.result import Diagnosis
from mofit.identification.settings import Settings
from mofit.models import find_model
from mofit.simulation.virtual_rig import plan as plans
from mofit.simulation.virtual_rig.rig import run_plan

STROKES = ((0.02, 0.5, 4), (0.02, 1.0, 6), (0.01, 2.0, 8), (0.005, 4.0, 12))
NOISE = 2.0
SIMULATORS = SimulatorCache()


def damper_campaign(effects=(), seed: int = 1, noise: plans.NoisePlan | None = None) -> Campaign:
    """Four sines of a damper of 2 kN/m and 1.5 kN s/m; ``effects``: pairs of a name and its parameters."""
    return run_plan(
        plans.Plan(
            title="damper",
            model="kelvin_voigt_damper",
            seed=seed,
            parameters={"c": 2000.0, "p": 0.0, "d": 1500.0, "F_0": 0.0},
            noise={"force": noise or plans.NoisePlan(sd=NOISE)},
            effects=tuple(plans.EffectPlan(name=name, parameters=dict(values)) for name, values in effects),
            tests=tuple(
                plans.TestPlan(name=f"{f:g}Hz", kind="sine", sample_rate=100.0, amplitude=a, frequency=f, periods=n)
                for a, f, n in STROKES
            ),
        )
    )


@cache
def damper_fit(effects=(), seed: int = 1) -> Fitted:
    """The model without effects, fitted."""
    campaign = damper_campaign(effects, seed)
    observed, start = set_up(find_model("kelvin_voigt_damper"), campaign, Settings(jobs=1), simulators=SIMULATORS)
    return fit_baseline(observed, start, 0)


@cache
def damper_diagnosis(effects=(), candidates=(), seed: int = 1) -> Diagnosis:
    """The whole diagnosis."""
    model = find_model("kelvin_voigt_damper")
    return diagnose(damper_campaign(effects, seed), model, candidates, Settings(jobs=1), simulators=SIMULATORS)


def truth(effects=()) -> dict[str, np.ndarray]:
    """Force of every test without noise."""
    clean = damper_campaign(effects, noise=plans.NoisePlan(sd=1e-9))
    return {m.name: m.outputs["force"] for m in clean.measurements}
