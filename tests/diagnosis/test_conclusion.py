"""When a gap counts as explained: what is left must be significant, large enough, and more than models may leave."""

import numpy as np
import pytest

from mofit.diagnosis.conclusion import Finding, cause, doubtful_effects, nearest, unexplained
from mofit.diagnosis.residual_tests import Residuals, ResidualTest
from mofit.diagnosis.settings import DiagnosisSettings


@pytest.mark.parametrize(
    ("effects", "p", "share", "verdict"),
    [
        (("force_gain",), 1e-9, 0.03, "unknown"),
        (("force_gain",), 1e-9, 0.01, "effect"),
        (("force_gain", "warm_up"), 1e-9, 0.01, "unknown"),
        (("force_gain", "warm_up"), 1e-9, 0.001, "several"),
        (("force_gain", "warm_up"), 0.01, 0.01, "several"),
        (("drift", "force_gain", "warm_up"), 1e-9, 0.01, "unknown"),
        ((), 1e-9, 1.0, "unknown"),
        ((), 0.5, 1.0, "none"),
    ],
)
def test_several_effects_may_leave_less_than_one(effects, p, share, verdict):
    assert Finding(effects, True, p, 0.01, share).verdict(DiagnosisSettings()) == verdict


def test_without_significance_there_is_no_gap():
    assert Finding(("force_gain",), False, 1e-9, 0.01, 0.5).verdict(DiagnosisSettings()) == "none"


def test_what_is_small_beside_the_peak_does_not_count():
    assert Finding(("force_gain",), True, 1e-9, 1e-4, 0.5).verdict(DiagnosisSettings()) == "effect"


def test_indistinguishable_models_are_a_group():
    assert Finding(("delay",), True, 0.5, 0.01, 0.0, doubtful=True).verdict(DiagnosisSettings()) == "group"
    assert doubtful_effects([("delay", "drift"), ("drift", "sensor_lowpass")]) == {"delay", "sensor_lowpass"}
    assert doubtful_effects([("delay",)]) == set()


@pytest.mark.parametrize(
    ("gap", "share", "verdict"),
    [(0.03, 0.08, "unknown"), (0.06, 0.03, "effect"), (0.5, 0.3, "effect"), (0.9, 0.5, "unknown")],
)
def test_of_a_smaller_gap_more_must_be_explained(gap, share, verdict):
    relaxed = DiagnosisSettings().relaxed(gap)
    assert Finding(("dry_friction",), True, 1e-9, 0.01, share).verdict(relaxed) == verdict


def test_a_gap_that_no_effect_comes_near_is_described_by_its_residual_test():
    line = ResidualTest("highest frequency", 90.0, 2.0, 1e-9, np.array([8.0, 10.0]), 37.5)
    assert (
        unexplained(Residuals((line,), 1e-9), "N")
        == ": a line of 37.5 Hz in all tests together (3 N root mean square, p = 1e-09)"
    )


def test_sentences_say_what_is_left():
    little = nearest(["payne"], 0.0)
    assert little == ". The nearest, payne, leaves less than 0.5 % of the gap's mean square, which is significant"
    assert nearest(["drift", "payne"], 0.3) == ". The nearest, drift with payne, leaves 30 % of the gap's mean square"
    assert (
        cause(["dry friction"], ["drift"], 0.0)
        == "Dry friction causes the gap. These data cannot distinguish it from drift."
    )
    assert cause(["delay", "drift"], [], 0.05) == (
        "Several effects cause the gap: delay and drift. No known effect explains 5 % of the gap's mean square."
    )
