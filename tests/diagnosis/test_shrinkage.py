"""How far the gap shrinks where fits without a test run away, or tests disagree."""

from dataclasses import replace

import damper_rig
import pytest
from damper_rig import damper_diagnosis

from mofit.diagnosis.diagnose import diagnose
from mofit.diagnosis.result import summary
from mofit.diagnosis.shrinkage import HoldOut, Share, Shrinkage
from mofit.identification.settings import Settings
from mofit.models import find_model
from mofit.simulation.virtual_rig import plan as plans
from mofit.simulation.virtual_rig.rig import run_plan

FRICTION = (("dry_friction", (("F_d", 30.0),)),)
SMALL = ((0.0005, 0.5, 4), (0.0005, 1.0, 6), (0.0005, 2.0, 8))


def campaign(strokes, cubic, seed=1, noise=damper_rig.NOISE):
    return run_plan(
        plans.Plan(
            title="damper",
            model="kelvin_voigt_damper",
            seed=seed,
            parameters={"c": 2000.0, "p": 0.0, "d": 1500.0, "F_0": 0.0},
            noise={"force": plans.NoisePlan(sd=noise)},
            effects=(plans.EffectPlan(name="cubic_stiffness", parameters={"k_c": cubic}),),
            tests=tuple(
                plans.TestPlan(name=f"{i}", kind="sine", sample_rate=100.0, amplitude=a, frequency=f, periods=n)
                for i, (a, f, n) in enumerate(strokes)
            ),
        )
    )


def test_where_one_test_alone_shows_the_effect_no_share_is_reported() -> None:
    """Small strokes say nothing of a cubic spring: fits to them alone run away."""
    data = campaign((*SMALL, (0.02, 1.0, 6)), 3e7, noise=20.0)
    found = diagnose(data, find_model("kelvin_voigt_damper"), ("cubic_stiffness", "delay"), Settings(jobs=1))
    assert found.conclusion.verdict == "effect"
    assert found.shrinkage is None
    assert found.shrinkage_reason.startswith("without 3 the fit to the other tests runs away")
    assert found.shrinkage_reason in found._repr_html_()


def test_a_fit_that_runs_away_is_told_beside_the_shares_of_the_others() -> None:
    found = damper_diagnosis(FRICTION)
    assert found.shrinkage is not None
    assert found.shrinkage.caveat == ""
    away = HoldOut("4Hz", ("4Hz",), 0.0, 0.0, 0.0, ran_away=True)
    one_away = replace(found, shrinkage=replace(found.shrinkage, ran_away=(away,)))
    caveat = summary(one_away)["shrinkage"]["caveat"]
    assert caveat.startswith("Not determined without 4Hz: ")
    assert caveat in one_away._repr_html_()
    assert "noise" not in caveat


def test_the_interval_is_as_wide_as_the_tests_disagree() -> None:
    """Strokes of 2 mm in much noise predict one of 20 mm badly, but it predicts them well."""
    small = tuple((0.002, frequency, periods) for _, frequency, periods in SMALL)
    data = campaign((*small, (0.02, 1.0, 6)), 3e7, seed=2, noise=20.0)
    model, names = find_model("kelvin_voigt_damper"), ("cubic_stiffness", "delay")
    found = diagnose(data, model, names, Settings(jobs=1))
    doubtful, exact = (one and one.of("test") for one in (found.shrinkage, damper_diagnosis(FRICTION).shrinkage))
    assert exact
    assert exact.low <= exact.share <= exact.high < exact.low + 0.05
    # it depends on the noise whether the fit to the small strokes alone runs away
    if doubtful is None:
        assert found.shrinkage_reason.startswith("without 3 the fit to the other tests runs away")
    else:
        assert doubtful.low + 0.5 < doubtful.high


def test_where_a_fit_runs_away_nothing_counts_as_removed() -> None:
    """Without the large strokes the small ones say little of a cubic spring: the lower end counts that, by name."""
    strokes = (*((0.0005, frequency, periods) for _, frequency, periods in SMALL), (0.02, 1.0, 6), (0.02, 0.5, 4))
    data = campaign(strokes, 3e7, noise=20.0)
    found = diagnose(data, find_model("kelvin_voigt_damper"), ("cubic_stiffness", "delay"), Settings(jobs=1))
    assert found.shrinkage is not None
    assert found.shrinkage.caveat.startswith("Not determined without the tests of largest amplitude (3, 4): ")
    # the group holds nearly all of the gap, so that no share of groups is left to tell
    assert found.shrinkage.of("group") is None
    assert found.shrinkage.headline.kind == "test"
    assert found.shrinkage.headline.share > 0.9


def test_probabilities_tell_of_a_weak_effect_where_its_share_does_not() -> None:
    """Friction of a quarter of the noise: it may remove nothing, yet tests left out are predicted better."""
    found = damper_diagnosis((("dry_friction", (("F_d", damper_rig.NOISE / 4),)),))
    alike = found.shrinkage.of("test")
    assert alike.low < 0 < alike.gain
    assert "That it helps, they do: tests left out in turn are " in summary(found)["shrinkage"]["caveat"]
    assert [one.name for one in found.conclusion.effects] == ["dry_friction"]


@pytest.mark.parametrize(("gain", "times"), [(9.0, "90 times"), (35.0, "10^8 times"), (2000.0, "10^434 times")])
def test_how_much_more_probable_tests_are_is_told_in_plain_numbers(gain, times) -> None:
    share = Share("test", 0.1, -0.2, 0.5, 0.1, (HoldOut("4Hz", ("4Hz",), 0.1, 0.0, 0.2, gain=gain),))
    assert f"are {times} as probable with it." in Shrinkage((share,)).caveat
