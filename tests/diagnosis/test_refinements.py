"""A law that refines a plainer one needs some evidence of its own."""

from dataclasses import replace

import pytest
from damper_rig import damper_diagnosis

from mofit.diagnosis.candidate_model import probabilities, rated
from mofit.models import effect_names, find_effect
from mofit.models.effects.play import GradedPlay

#: half the width, m
SMALL = 3e-5


class Unrelated(GradedPlay):
    """The same law, as if there were no plainer one."""

    refines = ""


def diagnosed(seed: int):
    """The damper behind such a play."""
    return damper_diagnosis((("backlash", (("b_0", SMALL),)),), ("backlash", "graded_play", "cubic_stiffness"), seed)


def test_a_refinement_is_a_third_as_probable_as_without_a_plainer_law() -> None:
    refining = next(one for one in diagnosed(1).attribution.models if one.effects == ("graded_play",))
    known = refining.fitted.hypothesis
    alone = replace(known, discrepancies=(replace(known.discrepancies[0], effect=Unrelated()),))
    both = [rated(replace(refining.fitted, hypothesis=model), 3) for model in (known, alone)]
    assert both[0].criterion == pytest.approx(refining.criterion)
    odds = probabilities(both)
    assert odds[0] / odds[1] == pytest.approx(1 / 3)


def test_what_an_effect_refines_is_another_of_its_family_with_as_many_parameters() -> None:
    refined = [effect for name in effect_names() if (effect := find_effect(name)).refines]
    assert refined
    for effect in refined:
        plain = find_effect(effect.refines)
        assert not plain.refines
        assert effect.family == plain.family
        assert len(effect.parameters) == len(plain.parameters)


def test_no_law_is_tried_without_the_plainer_one() -> None:
    """With this noise the score of the play is 6 % of the largest."""
    found = diagnosed(6)
    scores = {one.name: one.promise for one in found.attribution.score_tests}
    assert scores["backlash"] < 0.1 * max(scores.values()) < scores["graded_play"]
    assert ("backlash",) in {one.effects for one in found.attribution.models}
    assert found.conclusion.effects[0].name == "backlash"
    assert found.conclusion.effects[0].size == pytest.approx(SMALL, rel=0.1)
