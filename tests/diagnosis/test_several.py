"""The search for several effects: which sets are tried next."""

from types import SimpleNamespace

import pytest
from damper_rig import damper_fit

from mofit.diagnosis.candidates import prepare
from mofit.diagnosis.several import _best_extensions, attribute
from mofit.diagnosis.thresholds import Thresholds
from mofit.library import find_effect


def tried(criterion, *effects):
    return SimpleNamespace(criterion=criterion, effects=effects, fitted=effects)


def scores(**statistics):
    return [SimpleNamespace(name=name, statistic=value) for name, value in statistics.items()]


def extensions(level, screened, share=0.5):
    found = _best_extensions(level, screened, share)
    return {(*base, one.name): one.statistic for base, added in found for one in added}


def test_sets_follow_by_the_criterion_that_they_promise():
    level = [tried(100.0, "a"), tried(200.0, "b")]
    screened = [scores(b=10.0, c=50.0), scores(a=180.0, c=130.0)]
    # a + b is promised 20 from b, 90 from a; a + c 50, b + c 70
    assert extensions(level, screened) == {("b", "a"): 180.0, ("a", "c"): 50.0}
    assert extensions(level, screened, share=0.3) == {("b", "a"): 180.0, ("a", "c"): 50.0, ("b", "c"): 130.0}


def test_what_betters_nothing_is_not_tried():
    assert extensions([tried(100.0, "a"), tried(300.0, "b")], [scores(b=0.0), scores(a=150.0)]) == {}


def test_six_sets_at_most():
    assert len(extensions([tried(100.0, "a")], [scores(**{f"x{i}": 50.0 + i for i in range(9)})])) == 6


@pytest.mark.parametrize(("near", "most"), [((0.1, 1.0), 1), ((1.0, 0.5), 2), ((1.0, 1.0), 3)])
def test_one_more_effect_is_looked_for_only_where_little_is_left(near: tuple[float, float], most: int):
    """Of friction's gap delay and inertia leave more than half of the squares."""
    baseline = damper_fit((("dry_friction", (("F_d", 30.0),)),))
    names = ("asymmetric_stiffness", "delay", "inertia", "quadratic_damping")
    candidates = [prepare(baseline, find_effect(name)) for name in names]
    found = attribute(baseline, candidates, Thresholds(near=near))
    assert max(len(explanation.effects) for explanation in found.explanations) == most
