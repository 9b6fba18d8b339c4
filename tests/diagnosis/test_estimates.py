"""Final estimates with the remainder counted as noise, and shares of the gap on held-out tests."""

from dataclasses import replace

import numpy as np
import pytest
from damper_rig import SIMULATORS, damper_campaign, damper_diagnosis, truth

from mofit.data import Campaign
from mofit.diagnosis.baseline import fit_baseline, set_up
from mofit.diagnosis.diagnose import diagnose
from mofit.diagnosis.final_estimates import with_final_estimates
from mofit.diagnosis.fitting import Fitted, fit_to
from mofit.diagnosis.left_out import leave_out
from mofit.diagnosis.mean_squares import mean_squares
from mofit.diagnosis.model_search import attribute
from mofit.diagnosis.residual_map import residual_map
from mofit.diagnosis.settings import DiagnosisSettings
from mofit.diagnosis.whitened_data import with_discrepancy
from mofit.identification.settings import Settings
from mofit.models import find_model
from mofit.simulation.virtual_rig import plan as plans

TRUTH = {"c": 2000.0, "p": 0.0, "d": 1500.0, "F_0": 0.0}
#: amplitude of every harmonic of what the model misses, relative to the output's range: a hundred times the noise
MISSED = 0.01


def disturbed(seed: int, effects=()) -> Campaign:
    """The damper's tests with a force that repeats and that no model knows: ten harmonics of random phase."""
    rng, campaign = np.random.default_rng(seed), damper_campaign(effects, seed)
    tests = []
    for test in campaign.measurements:
        force, phase = test.channel("force"), 2 * np.pi * test.experiment.frequency * test.time
        turns = rng.normal(size=(10, 2))
        waves = sum(a * np.cos(h * phase) + b * np.sin(h * phase) for h, (a, b) in enumerate(turns, 1))
        offset = rng.normal()
        tests.append(replace(test, outputs={"force": force + MISSED * np.ptp(force) * (waves + offset)}))
    return replace(campaign, measurements=tuple(tests))


def errors(fitted: Fitted) -> np.ndarray:
    """Deviations from the truth in standard deviations."""
    space = fitted.hypothesis.space
    away = fitted.minimum.point - space.to_unit([TRUTH[name] for name in space.names])
    return away / fitted.sd()


def test_estimates_are_as_far_off_as_they_say() -> None:
    by_noise, final = [], []
    for seed in range(4):
        observed, start = set_up(
            find_model("kelvin_voigt_damper"), disturbed(seed), Settings(jobs=1), simulators=SIMULATORS
        )
        baseline = fit_baseline(observed, start, 0)
        found, left = attribute(baseline, [], DiagnosisSettings()), residual_map(baseline)
        best = with_final_estimates(found, observed, left.relative, ()).best.fitted
        by_noise.append(errors(baseline))
        final.append(errors(best))
    # 16 normal deviates: root mean square 1, give or take 0.18
    assert np.sqrt(np.mean(np.square(by_noise))) > 4
    assert 0.7 < np.sqrt(np.mean(np.square(final))) < 1.35


@pytest.mark.slow
def test_reported_sizes_and_shares_are_those_of_one_fit() -> None:
    """Friction of 100 N, and beside it what no model knows."""
    campaign = disturbed(3, (("dry_friction", (("F_d", 100.0),)),))
    found = diagnose(
        campaign, find_model("kelvin_voigt_damper"), ("dry_friction",), Settings(jobs=1), simulators=SIMULATORS
    )
    (effect,) = found.conclusion.effects
    assert found.attribution.best_residuals.p_value < 1e-6
    assert effect.size_low < 100.0 < effect.size_high
    ranges = {test.name: np.ptp(test.channel("force")) for test in campaign.measurements}
    gap, left = (
        sum((shares[name] ** 2 - found.noise_floor[name] ** 2) * size**2 for name, size in ranges.items())
        for shares in (found.nrmsd_before, found.nrmsd_after)
    )
    assert left / gap == pytest.approx(found.conclusion.residual_share, rel=0.05)
    assert f"{100 * found.conclusion.residual_share:.0f} %" in found.conclusion.sentence


FRICTION = (("dry_friction", (("F_d", 100.0),)),)


@pytest.mark.parametrize("level", [0.0, 0.2], ids=["white", "growing with the force"])
def test_every_sample_counts_alike(level: float) -> None:
    campaign = damper_campaign(noise=plans.NoisePlan(sd=1.0, level=level))
    observed, _ = set_up(find_model("kelvin_voigt_damper"), campaign, Settings(jobs=1), simulators=SIMULATORS)
    levels = [np.ptp(w.process.level) for _, _, w in observed.records]
    assert min(levels) > 0.5 if level else max(levels) < 0.1
    gaps = [with_ - without for with_, without in zip(truth(FRICTION).values(), truth().values(), strict=True)]
    rows = observed.whitened([gap[:, None, None] for gap in gaps])
    expected = sum(
        np.mean(gap[w.start : w.start + w.count] ** 2)
        / np.ptp(observed.problem.experiments[test].measured[w.start : w.start + w.count]) ** 2
        for gap, (test, _, w) in zip(gaps, observed.records, strict=True)
    )
    assert mean_squares(observed, rows, np.ones(len(rows), dtype=bool)) == pytest.approx([expected])


def test_fits_without_a_test_are_integrated_finely_enough_for_it() -> None:
    fitted = damper_diagnosis((("delay", (("tau_d", 0.01),)),), ("delay",)).attribution.best.fitted
    enough = fitted.hypothesis
    assert enough.simulator.steps is not None
    assert enough.simulator.steps > 1
    coarse = replace(fitted, hypothesis=enough.with_steps(1))
    model, points = leave_out(coarse, [[test] for test in range(len(fitted.hypothesis.observed.problem.tests))])
    assert model.simulator.steps is not None
    assert model.simulator.steps > 1
    finer = model.with_steps(2 * model.simulator.steps)
    assert np.max(np.abs(finer.linear(points).residual - model.linear(points).residual)) < 0.5


def test_final_estimates_are_exact_where_a_model_may_be_a_rival() -> None:
    found = damper_diagnosis((("dry_friction", (("F_d", 30.0),)),)).attribution
    observed, remainder = found.baseline.hypothesis.observed, 0.003
    final = with_final_estimates(found, observed, remainder, found.models)
    noisy = with_discrepancy(observed, remainder, everywhere=True)
    exact = [fit_to(noisy, one.fitted).minimum.value for one in found.models]
    least = final.baseline.minimum.value - 0.25 * (final.baseline.minimum.value - exact[0])
    near = [value <= least for value in exact]
    assert any(near[1:])
    assert not all(near)
    for one, value, rival in zip(final.models, exact, near, strict=True):
        beyond = one.fitted.minimum.value - value
        assert -1e-3 < beyond < (1e-2 if rival else 0.1 * (value - least) + 1e-2)
