"""Every candidate ends as fitted, not needed, or could not be fitted; each with a reason."""

from types import SimpleNamespace

import numpy as np
import pytest
from damper_rig import damper_diagnosis, damper_fit

from mofit.diagnosis.accounts import accounts_of, promising
from mofit.diagnosis.candidates import prepare
from mofit.diagnosis.model_search import attribute
from mofit.diagnosis.refit import NotFittedError, is_reliable, refit
from mofit.diagnosis.result import summary
from mofit.diagnosis.score_test import score_tests
from mofit.diagnosis.settings import DiagnosisSettings
from mofit.models import Applied, Channel, Effect, find_effect
from mofit.parameters import Parameter

FRICTION = (("dry_friction", (("F_d", 30.0),)),)


def score(name, statistic, confounding=0.5, refines=""):
    effect = SimpleNamespace(refines=refines)
    return SimpleNamespace(name=name, statistic=statistic, promise=statistic, confounding=confounding, effect=effect)


def test_what_a_cut_leaves_out_has_a_reason() -> None:
    kept, passed_over = promising([score("a", 0.0), score("b", 4.0), score("c", 100.0), score("d", 50.0)], 0.1, 1)
    assert [one.name for one in kept] == ["c"]
    assert passed_over.keys() == {"a", "b", "d"}
    assert "explains nothing" in passed_over["a"]
    assert "4 % of the largest" in passed_over["b"]
    assert "from 10 % on" in passed_over["b"]
    assert "larger scores" in passed_over["d"]


def test_a_cut_does_not_part_a_law_from_the_plainer_one() -> None:
    scores = [score("plain", 0.0), score("far", 4.0), score("refined", 100.0, refines="plain"), score("other", 50.0)]
    kept, passed_over = promising(scores, 0.1, 1)
    assert [one.name for one in kept] == ["refined", "plain"]
    assert passed_over.keys() == {"far", "other"}


def test_each_outcome_has_its_reason() -> None:
    best, other, none = (
        SimpleNamespace(effects=effects, criterion=criterion)
        for effects, criterion in ((("a", "b"), 10.0), (("c",), 30.0), ((), 90.0))
    )
    scores = [score("a", 9.0), score("c", 8.0), score("d", 7.0), score("e", 0.0, confounding=0.999)]
    found = accounts_of(scores, [best, other, none], {("d",): "diverges", ("c", "d"): "no start"}, {"e": "no score"})
    assert [one.outcome for one in found] == ["fitted", "fitted", "could not be fitted", "not needed"]
    a, c, d, e = (one.reason for one in found)
    assert a == "with b the best"
    assert c == "alone: criterion 20 above the best; as c with d it could not be fitted: no start"
    assert d == "diverges"
    assert e == "no score; these tests would hardly show it"


@pytest.mark.slow
@pytest.mark.parametrize("effects", [(), FRICTION])
def test_no_candidate_is_missing_in_a_diagnosis(effects) -> None:
    found = damper_diagnosis(effects)
    accounts = summary(found)["accounts"]
    assert sorted(one["name"] for one in accounts) == sorted(one.name for one in found.attribution.score_tests)
    assert all(one["reason"] for one in accounts)
    fitted = {one["name"] for one in accounts if one["outcome"] == "fitted"}
    assert fitted == {name for one in found.attribution.models for name in one.effects}
    assert ("dry_friction" in fitted) == bool(effects)
    shown = found._repr_html_()
    assert all(one["reason"].replace("'", "&#39;") in shown or one["outcome"] == "fitted" for one in accounts)


class Fast(Effect):
    """A force behind a lag that is faster the larger the force: stable near neutral size, unstable far from it."""

    name, title, on = "fast", "a fast state", ("damper_force",)
    parameters = (Parameter("F_s", "N s/m", 0.0, 2e4, 10.0, neutral=0.0),)
    states = (Channel("lagging", "m/s"),)

    def __init__(self, rate: float) -> None:
        self.rate = rate

    def apply(self, s, value):
        rate = 20.0 + self.rate * s.F_s
        return Applied(value + s.F_s * s.lagging, {"lagging": rate * (s.velocity - s.lagging)})


def test_what_diverges_with_few_steps_is_fitted_with_more() -> None:
    baseline = damper_fit((("second_branch", (("c_2", 2000.0),)),))
    (one,) = score_tests(baseline, [prepare(baseline, Fast(30.0))])
    found = refit(baseline, one)
    assert found.hypothesis.steps > one.candidate.steps
    assert is_reliable(found)
    assert found.minimum.value < baseline.minimum.value


def test_what_diverges_with_the_most_steps_is_told() -> None:
    baseline = damper_fit(FRICTION)
    candidates = [prepare(baseline, find_effect("cubic_stiffness")), prepare(baseline, Fast(1e9))]
    by_name = {one.name: one for one in score_tests(baseline, candidates)}
    assert by_name["fast"].statistic > 0
    with pytest.raises(NotFittedError, match="steps per sampling interval"):
        refit(baseline, by_name["fast"])
    found = attribute(baseline, candidates, DiagnosisSettings())
    (fast,) = [one for one in found.accounts if one.name == "fast"]
    assert fast.outcome == "could not be fitted"
    assert np.isfinite(fast.statistic)
