"""When what is left of a gap is unknown: significant, felt in the output, and more than models may differ by."""

from types import SimpleNamespace

import numpy as np
import pytest

from mofit.diagnosis import verdict
from mofit.diagnosis.remaining import Clue, Remaining
from mofit.diagnosis.thresholds import Thresholds


def left(p, *squares):
    return Remaining((Clue("odd", 0.0, 1.0, p, np.array(squares)),), p)


def where(*squares):
    names = [f"sine_{i}" for i in range(len(squares))]
    peaks = dict.fromkeys(names, 1000.0)
    return SimpleNamespace(squares=dict(zip(names, squares, strict=True)), peaks=peaks, unit="N")


@pytest.fixture(autouse=True)
def names_only(monkeypatch):
    """No fits behind these explanations."""
    monkeypatch.setattr(
        verdict, "named", lambda explanation, name, probability: SimpleNamespace(name=name, title=name, probability=1.0)
    )


@pytest.mark.parametrize(
    ("effects", "p", "share", "said"),
    [
        (("force_gain",), 1e-9, 0.03, "unknown"),
        (("force_gain",), 1e-9, 0.01, "effect"),
        (("force_gain", "warm_up"), 1e-9, 0.01, "unknown"),
        (("force_gain", "warm_up"), 1e-9, 0.001, "several"),
        (("force_gain", "warm_up"), 0.01, 0.01, "several"),
        (("drift", "force_gain", "warm_up"), 1e-9, 0.01, "unknown"),
    ],
)
def test_what_several_effects_leave_counts_sooner_than_what_one_does(effects, p, share, said):
    best = SimpleNamespace(effects=effects, criterion=0.0)
    found = SimpleNamespace(
        best=best, explanations=(best,), screened=(), left=left(1e-30, 800.0, 200.0), best_left=left(p, 1000 * share, 0)
    )
    concluded = verdict.conclude(found, where(800.0, 200.0), where(1000 * share, 0.0), Thresholds())
    assert concluded.verdict == said
    assert concluded.left_share == pytest.approx(share)


def test_a_pattern_without_power_is_told_as_one():
    best = SimpleNamespace(effects=("payne",), criterion=0.0)
    gap = left(1e-30, 800.0, 200.0)
    found = SimpleNamespace(best=best, explanations=(best,), screened=(), left=gap, best_left=left(1e-9, 30.0, 0.0))
    concluded = verdict.conclude(found, where(800.0, 200.0), where(0.0, 0.0), Thresholds(), told=0.0)
    assert concluded.sentence == (
        "None of the known effects explains the gap; the nearest, payne, leaves a pattern of little power."
    )


@pytest.mark.parametrize(
    ("coarseness", "share", "said"),
    [(0.03, 0.08, "unknown"), (0.06, 0.03, "effect"), (0.5, 0.3, "effect"), (0.9, 0.5, "unknown")],
)
def test_the_finer_a_coarse_gap_is_the_more_of_it_must_be_explained(coarseness, share, said):
    best = SimpleNamespace(effects=("dry_friction",), criterion=0.0)
    gap = left(1e-30, 800.0, 200.0)
    rest = left(1e-9, 1000 * share, 0)
    found = SimpleNamespace(best=best, explanations=(best,), screened=(), left=gap, best_left=rest)
    roughly = Thresholds().roughly(coarseness)
    assert verdict.conclude(found, where(800.0, 200.0), where(1000 * share, 0.0), roughly).verdict == said


def test_a_gap_that_no_effect_comes_near_is_told_by_what_shows_it():
    best = SimpleNamespace(effects=(), criterion=0.0)
    line = Clue("highest frequency", 90.0, 2.0, 1e-9, np.array([8.0, 10.0]), 37.5)
    hum = Remaining((line,), 1e-9)
    found = SimpleNamespace(best=best, explanations=(best,), screened=(), left=hum, best_left=hum)
    concluded = verdict.conclude(found, where(8.0, 10.0), where(8.0, 10.0), Thresholds())
    assert concluded.sentence == (
        "None of the known effects explains the gap: a line of 37.5 Hz in all tests together "
        "(3 N root mean square, p = 1e-09)."
    )
