"""When a gap counts as explained: what is left must be significant, large enough, and more than models may leave."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from mofit.diagnosis.conclusion import (
    WITHOUT_SHAPE,
    Conclusion,
    NamedEffect,
    doubtful_effects,
    in_order,
    replaced_by_term,
)
from mofit.diagnosis.grades import Finding
from mofit.diagnosis.left_residual import Residuals, ResidualTest
from mofit.diagnosis.residual_map import Location
from mofit.diagnosis.sentences import cause, contradicted, left_over, nearest, refuted, unexplained
from mofit.diagnosis.settings import DiagnosisSettings
from mofit.diagnosis.shrinkage import HoldOut, Share, Shrinkage
from mofit.models.registry import effect_names, find_effect


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


def named(name, probability, of_rig):
    return NamedEffect(name, name, name, probability, 1.0, 0.9, 1.1, "1", {}, False, of_rig)


def ordered(effects, doubtful):
    return in_order(effects, doubtful, {one.name: 1 - one.probability for one in effects})


def test_what_the_model_lacks_is_named_before_what_the_rig_adds():
    offset, drift = named("test_offset", 1.0, True), named("drift", 1.0 - 1e-9, False)
    lag, speed = named("delay", 0.7, False), named("speed", 0.3, True)
    assert ordered([offset, drift], set()) == (drift, offset)
    assert ordered([speed, lag, offset], {"delay", "speed"}) == (offset, lag, speed)
    assert ordered([lag, speed], {"delay", "speed"}) == (lag, speed)


def test_what_the_stages_told_wrongly_is_named_behind_what_is_surer():
    order, level = named("wheel_order", 1.0, True), replace(named("level", 1.0, False), family="calibration error")
    lag, sure = named("delay", 1.0, False), {"wheel_order": 0.0, "calibration error": 1e-30, "delay": 1e-9}
    assert in_order([level, order, lag], set(), sure) == (lag, order, level)


def test_of_causes_beyond_doubt_the_surest_comes_first():
    offset, order = named("test_offset", 1.0, True), named("wheel_order", 1.0, True)
    assert in_order([offset, order], set(), {"test_offset": 1e-30, "wheel_order": 1e-200}) == (order, offset)


def test_laws_that_cannot_be_told_apart_of_a_family_beyond_doubt_come_first():
    play, graded = (replace(named(name, p, False), family="play") for name, p in (("backlash", 0.4), ("graded", 0.6)))
    stiffness = named("stiffness", 0.98, False)
    assert in_order([stiffness, play, graded], set(), {"stiffness": 0.02, "play": 1e-30}) == (graded, play, stiffness)


@pytest.mark.parametrize(
    ("effects", "share", "removed", "verdict"),
    [
        (("dry_friction",), 0.2, 0.8, "partly"),
        (("dry_friction",), 0.2, 0.59, "unknown"),
        (("dry_friction",), 0.2, 0.0, "unknown"),
        (("dry_friction",), 0.01, 0.99, "effect"),
        (("drift", "second_branch"), 0.1, 0.9, "partly"),
        ((), 1.0, 0.0, "unknown"),
    ],
)
def test_a_cause_that_explains_most_on_tests_left_out_is_named_partly(effects, share, removed, verdict):
    assert Finding(effects, True, 1e-9, 0.01, share, removed=removed).verdict(DiagnosisSettings()) == verdict


def test_what_is_left_but_hidden_by_the_noise_is_no_part():
    assert Finding(("dry_friction",), True, 0.1, 0.01, 0.2, removed=0.8).verdict(DiagnosisSettings()) == "effect"


@pytest.mark.parametrize(
    ("p_value", "share", "verdict"), [(3e-3, 0.99, "unknown"), (3e-3, 0.3, "effect"), (6e-3, 0.99, "effect")]
)
def test_what_leaves_most_of_a_gap_is_asked_as_a_gap_is(p_value, share, verdict):
    assert Finding(("warm_up",), True, p_value, 0.01, share).verdict(DiagnosisSettings()) == verdict


def left_out(*gains, kind="test"):
    hold_outs = tuple(HoldOut(f"{k}", (f"{k}",), 0.5, 0.4, 0.6, gain=gain) for k, gain in enumerate(gains))
    return Shrinkage((Share(kind, 0.5, 0.4, 0.6, 0.5, hold_outs),))


@pytest.mark.parametrize(
    ("held_out", "verdict"),
    [
        (left_out(5.0, -1.0), "effect"),
        (left_out(5.0, -6.0), "unknown"),
        # 2 log 2000 = 15.2
        (left_out(100.0, -15.0), "effect"),
        (left_out(100.0, -15.5), "unknown"),
        (left_out(100.0, -15.5, kind="group"), "unknown"),
        (left_out(1.0, -5.0, kind="group"), "effect"),
    ],
)
def test_tests_left_out_that_are_less_probable_contradict_a_cause(held_out, verdict):
    finding = Finding(("dry_friction",), True, 0.5, 0.01, 0.9, refuted=held_out.refutes)
    assert finding.verdict(DiagnosisSettings()) == verdict
    main = replace(finding, removed=0.7)
    assert main.verdict(DiagnosisSettings()) == ("effect" if verdict == "effect" else "partly")


@pytest.mark.parametrize(("high", "verdict"), [(0.49, "unknown"), (0.51, "effect")])
@pytest.mark.parametrize("kind", ["test", "group"])
def test_a_cause_that_leaves_most_of_the_gap_on_tests_left_out_is_none(kind, high, verdict):
    alike, other = (left_out(5.0, kind=one).shares[0] for one in ("test", "group"))
    alike = replace(alike, share=0.9, low=-2.0, high=1.0)
    some = replace(alike if kind == "test" else other, share=0.1, low=-2.0, high=high)
    held_out = Shrinkage((some,) if kind == "test" else (alike, some))
    finding = Finding(("warm_up",), True, 0.5, 0.01, 0.9, removed=held_out.of_cause, refuted=held_out.refutes)
    assert finding.verdict(DiagnosisSettings()) == verdict


@pytest.mark.parametrize(("share", "verdict"), [(0.45, "unknown"), (0.55, "partly")])
def test_a_main_cause_explains_most_of_the_gap_on_whole_groups_too(share, verdict):
    alike, group = (left_out(5.0, kind=one).shares[0] for one in ("test", "group"))
    held_out = Shrinkage((replace(alike, share=0.9), replace(group, share=share, low=-2.0, high=0.98)))
    assert not held_out.refutes
    finding = Finding(("asymmetric_stiffness",), True, 0.0, 0.01, 0.2, removed=held_out.of_cause)
    assert finding.verdict(DiagnosisSettings()) == verdict


def test_records_of_another_kind_on_which_most_of_a_gap_stays_refute_no_cause():
    """How far its law reaches is another question."""
    alike, records = (left_out(5.0, kind=one).shares[0] for one in ("test", "records"))
    held_out = Shrinkage((replace(alike, share=0.9), replace(records, share=0.1, high=0.2)))
    assert not held_out.refutes
    assert held_out.of_cause == 0.9


@pytest.mark.parametrize(("later", "runs_away", "of_cause"), [(0.3, False, 0.3), (0.9, False, 0.5), (0.0, True, 0.0)])
def test_a_law_of_the_time_is_graded_by_later_tests_too(later, runs_away, of_cause):
    (alike,) = left_out(5.0).shares
    last = HoldOut("latest start", ("3",), later, 0.0, 1.0, ran_away=runs_away, later=True)
    group = Share("group", later, 0.0, 1.0, later, (last,))
    # a group that runs away has no share
    found = Shrinkage((alike,), ran_away=(last,)) if runs_away else Shrinkage((alike, group))
    assert found.of_cause == of_cause


@pytest.mark.parametrize(
    ("shares", "runs_away", "reaches"), [((0.9, 0.6), False, True), ((0.9, 0.5), False, False), ((0.9,), True, False)]
)
def test_laws_of_one_family_must_hold_on_every_hold_out(shares, runs_away, reaches):
    """As a series fitted to a curve, they stand for a law that is none of them."""
    hold_out = HoldOut("3", ("3",), 0.0, 0.0, 0.0, ran_away=True)
    kinds = [Share(kind, share, 0.0, 1.0, share, ()) for kind, share in zip(("test", "group"), shares, strict=False)]
    found = Shrinkage(tuple(kinds), ran_away=(hold_out,) * runs_away)
    assert found.reaches == reaches
    finding = Finding(("cubic_stiffness", "payne"), True, 0.5, 0.01, 0.01, removed=0.9, stretched=not found.reaches)
    assert finding.verdict(DiagnosisSettings()) == ("several" if reaches else "partly")


def test_a_hold_out_that_contradicts_is_told_once():
    alone = HoldOut("sine_1", ("sine_1",), 0.5, 0.4, 0.6, gain=-50.0)
    group = HoldOut("largest amplitude", ("sine_1",), 0.5, 0.4, 0.6, gain=-50.0)
    other = HoldOut("highest frequency", ("sine_2", "sine_3"), 0.5, 0.4, 0.6, gain=-50.0)
    kinds = [Share(kind, 0.5, 0.4, 0.6, 0.5, some) for kind, some in (("test", (alone,)), ("group", (group, other)))]
    found = [one.in_words for one in Shrinkage(tuple(kinds)).contradicting]
    assert found == ["sine_1", "the tests of highest frequency (sine_2, sine_3)"]


def test_a_contradicted_cause_is_told():
    assert refuted(["payne"], (), ()) == ". Tests left out in turn are predicted no better with the nearest, payne"
    assert refuted(["payne"], ["sine_1", "sine_2"], ()) == (
        ". Without the nearest, payne, sine_1 and sine_2 would be predicted better from the other tests"
    )
    assert refuted(["warm_up"], (), ["tests left out in turn", "whole groups of tests left out"]) == (
        ". On tests left out in turn and whole groups of tests left out most of the gap stays with the nearest, warm_up"
    )
    assert contradicted([]) == ""
    assert contradicted(["sine_1"]) == (
        " Its law does not hold throughout: from the other tests it predicts sine_1 worse."
    )
    assert contradicted(["sine_1"], 2) == (
        " Their laws do not hold throughout: from the other tests they predict sine_1 worse."
    )


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
    assert left_over(0.18, Location("sine_3Hz", "odd", 0.7)) == (
        "18 % of its mean square is left in the fit to all tests, most of it on odd harmonics of sine_3Hz"
    )
    assert left_over(0.18, Location("", "dc", 0.7)).endswith("most of it on the constant")
    assert left_over(0.18, Location("sine_3Hz", "", 0.7)).endswith("most of it in sine_3Hz")
    assert left_over(0.18, None) == "18 % of its mean square is left in the fit to all tests"


DAHL, DRIFT = ("friction", "dry friction (Dahl)"), ("drift", "drift over the campaign")


def test_sentences_name_the_family_first():
    assert cause([DAHL]) == "Friction causes the gap (best law: dry friction (Dahl))."
    assert cause([("play", "play")]) == "Play causes the gap."
    assert cause([DAHL], left="18 % of its mean square is left") == (
        "Friction causes most of the gap (best law: dry friction (Dahl)); 18 % of its mean square is left."
    )
    assert cause([("play", "play"), DRIFT]) == (
        "Several effects cause the gap: play and drift (best law: drift over the campaign)."
    )


def test_a_family_that_all_candidates_share_is_named_without_doubt():
    other = ("friction", "Coulomb friction")
    assert cause([DAHL], [other]).endswith("These data cannot distinguish this law from Coulomb friction.")
    assert cause([DAHL], [other, DRIFT]).endswith(
        "These data cannot distinguish it from Coulomb friction or drift over the campaign."
    )
    assert cause([DRIFT, DAHL], [other]).endswith("distinguish dry friction (Dahl) from Coulomb friction.")
    assert cause([DRIFT, DAHL], [other, ("play", "play")]).endswith("distinguish them from Coulomb friction or play.")


@pytest.mark.parametrize(
    ("effects", "left", "low", "low_of_groups", "verdict"),
    [
        (("drift",), 0.3, 0.1, 0.1, "partly"),
        (("drift",), 0.3, -0.1, 0.1, "unknown"),
        (("drift",), 0.3, 0.1, -0.1, "unknown"),
        (("drift",), 0.0, -0.1, -0.1, "effect"),
        (("dry_friction",), 0.3, -0.1, -0.1, "partly"),
        (("dry_friction", "delay"), 0.0, 0.1, -0.1, "several"),
        (("dry_friction", "delay"), 0.0, -0.1, 0.1, "unknown"),
    ],
)
def test_flexible_causes_must_be_seen_to_help(effects, left, low, low_of_groups, verdict):
    """And where a law of the time leaves something, on whole groups of tests, too."""
    kinds = (("test", low), ("group", low_of_groups))
    found = Shrinkage(tuple(Share(kind, 0.8, one, 0.9, 0.8, ()) for kind, one in kinds))
    shown = {"shown": found.shows_help(), "shown_in_groups": found.shows_help("group")}
    finding = Finding(effects, True, 1e-9, 0.01, left, removed=0.8, **shown, in_time="drift" in effects)
    assert finding.verdict(DiagnosisSettings()) == verdict


def test_what_tests_left_out_do_not_confirm_is_told():
    told = nearest(["drift", "payne"], 0.01, unconfirmed=True)
    assert told == nearest(["drift", "payne"], 0.01) + ", but tests left out do not confirm it"


def like(*sets, left=0.06):
    """A main cause, indistinguishable from others, whose families are named as their effects."""
    models = tuple(SimpleNamespace(effects=one, families=frozenset(one)) for one in sets)
    effects = tuple(named(name, 0.5, False) for name in dict.fromkeys(name for one in sets for name in one))
    return Conclusion("partly", "One causes most of the gap.", effects, (), models, left, ())


@pytest.mark.parametrize(
    ("sets", "in_doubt"),
    [
        ((("compliance",),), False),
        ((("compliance",), ("gain",)), True),
        ((("compliance", "drift"), ("drift", "gain")), False),
        ((), False),
    ],
)
def test_a_cause_is_in_doubt_if_no_family_is_sure(sets, in_doubt):
    assert like(*sets).in_doubt == in_doubt


@pytest.mark.parametrize(
    ("sets", "replaceable"),
    [
        ((("calibration error",),), True),
        ((("calibration error", "friction"),), False),
        ((("calibration error",), ("calibration error", "friction")), False),
        ((("load coupling",),), True),
        ((("load coupling", "friction"),), False),
        ((("friction",),), False),
        ((("friction",), ("drift",)), True),
        ((), False),
    ],
)
def test_what_has_no_shape_is_not_refined_by_a_term(sets, replaceable):
    assert like(*sets).replaceable_by(0.001) == replaceable


@pytest.mark.parametrize(
    ("left", "left_by_term", "replaceable"),
    [(0.15, 0.001, True), (0.15, 0.016, False), (0.08, 0.001, False), (0.08, 0.0, False)],
)
def test_a_law_that_leaves_much_is_another_one_where_a_term_leaves_hardly_anything(left, left_by_term, replaceable):
    """As a cubic does for a stop; for a hyperbolic sine it leaves less, and a term refines it."""
    assert like(("friction",), left=left).replaceable_by(left_by_term) == replaceable


def test_families_without_shape_are_families_of_the_catalogue():
    assert {find_effect(name).cause for name in effect_names()} >= WITHOUT_SHAPE


def test_a_wrong_constant_that_a_term_replaces_is_none():
    found = replaced_by_term(like(("calibration error",)))
    assert found.verdict == "unknown"
    assert found.sentence == (
        "None of the known effects explains the gap. The nearest, calibration error, explains most of it, but a term "
        "explains more without it."
    )


def test_a_cause_in_doubt_that_a_term_replaces_is_none():
    found = replaced_by_term(like(("compliance",), ("gain",)))
    assert found.verdict == "unknown"
    assert found.sentence == (
        "None of the known effects explains the gap. The nearest, compliance, cannot be told from gain, and a term "
        "explains more without it."
    )
