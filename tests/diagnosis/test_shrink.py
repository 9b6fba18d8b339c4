"""Shares of a gap are shares of its mean square in the output, whatever the noise."""

from dataclasses import replace

import numpy as np
import pytest
from damper_rig import WORKSHOP, damper_campaign, damper_diagnosis, truth

from mofit.diagnosis.baseline import pose
from mofit.diagnosis.shrink import leave_one_out, mean_squares
from mofit.library import find_model
from mofit.settings import Settings
from mofit.simulate import plan as plans

FRICTION = (("dry_friction", (("F_d", 100.0),)),)


@pytest.mark.parametrize("level", [0.0, 0.2], ids=["white", "growing with the force"])
def test_every_sample_counts_alike(level: float) -> None:
    campaign = damper_campaign(noise=plans.NoisePlan(sd=1.0, level=level))
    observed, _ = pose(find_model("kelvin_voigt_damper"), campaign, Settings(jobs=1), workshop=WORKSHOP)
    levels = [np.ptp(w.process.level) for _, _, w in observed.parts]
    assert min(levels) > 0.5 if level else max(levels) < 0.1
    gaps = [with_ - without for with_, without in zip(truth(FRICTION).values(), truth().values(), strict=True)]
    rows = observed.white([gap[:, None, None] for gap in gaps])
    expected = sum(
        np.mean(gap[w.start : w.start + w.count] ** 2)
        / np.ptp(observed.problem.drives[test].measured[w.start : w.start + w.count]) ** 2
        for gap, (test, _, w) in zip(gaps, observed.parts, strict=True)
    )
    assert mean_squares(observed, rows, np.ones(len(rows), dtype=bool)) == pytest.approx([expected])


def test_fits_without_a_test_are_integrated_finely_enough_for_it() -> None:
    fitted = damper_diagnosis((("delay", (("tau_d", 0.01),)),), ("delay",)).attribution.best.fitted
    enough = fitted.hypothesis
    assert enough.simulator.steps is not None
    assert enough.simulator.steps > 1
    coarse = replace(fitted, hypothesis=enough.with_steps(1))
    model, points = leave_one_out(coarse)
    assert model.simulator.steps is not None
    assert model.simulator.steps > 1
    finer = model.with_steps(2 * model.simulator.steps)
    assert np.max(np.abs(finer.linear(points).residual - model.linear(points).residual)) < 0.5
