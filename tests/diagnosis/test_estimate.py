"""What an explanation leaves counts as noise in the parameters that are told."""

from dataclasses import replace

import numpy as np
import pytest
from damper_rig import WORKSHOP, damper_campaign

from mofit.campaign import Campaign
from mofit.diagnosis.baseline import Fitted, fit_baseline, pose
from mofit.diagnosis.diagnose import diagnose
from mofit.diagnosis.estimate import counting_remainder
from mofit.diagnosis.locate import locate
from mofit.diagnosis.several import attribute
from mofit.diagnosis.thresholds import Thresholds
from mofit.library import find_model
from mofit.settings import Settings

TRUTH = {"c": 2000.0, "p": 0.0, "d": 1500.0, "F_0": 0.0}
#: amplitude of every harmonic of what the model misses, relative to the output's range: a hundred times the noise
MISSED = 0.01


def disturbed(seed: int, effects=()) -> Campaign:
    """The damper's tests with a force that repeats and that no model knows: ten harmonics of random phase."""
    rng, campaign = np.random.default_rng(seed), damper_campaign(effects, seed)
    tests = []
    for test in campaign.measurements:
        force, phase = test.channel("force"), 2 * np.pi * test.procedure.frequency * test.time
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
    by_noise, told = [], []
    for seed in range(6):
        observed, start = pose(find_model("kelvin_voigt_damper"), disturbed(seed), Settings(jobs=1), workshop=WORKSHOP)
        baseline = fit_baseline(observed, start, 0)
        found, left = attribute(baseline, [], Thresholds()), locate(baseline)
        best = counting_remainder(observed, left.relative, found, ()).best.fitted
        by_noise.append(errors(baseline))
        told.append(errors(best))
    # 24 normal deviates: root mean square 1, give or take 0.15
    assert np.sqrt(np.mean(np.square(by_noise))) > 4
    assert 0.7 < np.sqrt(np.mean(np.square(told))) < 1.35


def test_sizes_and_shares_told_are_those_of_one_fit() -> None:
    """Friction of 100 N, and beside it what no model knows."""
    campaign = disturbed(3, (("dry_friction", (("F_d", 100.0),)),))
    found = diagnose(
        campaign, find_model("kelvin_voigt_damper"), ("dry_friction",), Settings(jobs=1), workshop=WORKSHOP
    )
    (effect,) = found.conclusion.effects
    assert found.attribution.best_left.p < 1e-6
    assert effect.size_low < 100.0 < effect.size_high
    ranges = {test.name: np.ptp(test.channel("force")) for test in campaign.measurements}
    gap, left = (
        sum((shares[name] ** 2 - found.noise_floor[name] ** 2) * size**2 for name, size in ranges.items())
        for shares in (found.nrmsd_before, found.nrmsd_after)
    )
    assert left / gap == pytest.approx(found.conclusion.left_share, rel=0.05)
    assert f"{100 * found.conclusion.left_share:.0f} %" in found.conclusion.sentence
