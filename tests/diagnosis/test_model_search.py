"""The search for several effects: which sets are tried next, and which refits count."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from damper_rig import damper_fit

from mofit.diagnosis.candidates import prepare
from mofit.diagnosis.extensions import best_extensions
from mofit.diagnosis.fitting import Fitted
from mofit.diagnosis.left_residual import Residuals
from mofit.diagnosis.model_search import Attribution, attribute
from mofit.diagnosis.refit import is_reliable, refit, refit_from, settled
from mofit.diagnosis.remembered import Remembered
from mofit.diagnosis.score_test import score_tests
from mofit.diagnosis.settings import DiagnosisSettings
from mofit.models import find_effect
from mofit.optimize import Minimum


def model(criterion, *effects):
    return SimpleNamespace(criterion=criterion, effects=effects, fitted=effects)


def scores(**statistics):
    return [SimpleNamespace(name=name, statistic=value, promise=value) for name, value in statistics.items()]


def extensions(level, tests, share=0.5):
    found = best_extensions(level, tests, DiagnosisSettings(extension_promising=share))
    return {(*base, one.name): one.statistic for base, one in found}


def test_sets_follow_by_the_criterion_that_they_promise():
    level = [model(100.0, "a"), model(200.0, "b")]
    tests = [scores(b=10.0, c=50.0), scores(a=180.0, c=130.0)]
    # a + b is promised 20 from b, 90 from a; a + c 50, b + c 70
    assert extensions(level, tests) == {("b", "a"): 180.0, ("a", "c"): 50.0}
    assert extensions(level, tests, share=0.3) == {("b", "a"): 180.0, ("a", "c"): 50.0, ("b", "c"): 130.0}


def test_what_betters_nothing_is_not_tried():
    assert extensions([model(100.0, "a"), model(300.0, "b")], [scores(b=0.0), scores(a=150.0)]) == {}


def test_six_sets_at_most():
    assert len(extensions([model(100.0, "a")], [scores(**{f"x{i}": 50.0 + i for i in range(9)})])) == 6


@pytest.mark.parametrize(("unexplained", "most"), [((0.1, 1.0), 1), ((1.0, 0.5), 2), ((1.0, 1.0), 3)])
def test_one_more_effect_is_tried_only_where_little_is_left(unexplained: tuple[float, float], most: int):
    """Of friction's gap delay and inertia leave more than half of the squares."""
    baseline = damper_fit((("dry_friction", (("F_d", 30.0),)),))
    names = ("asymmetric_stiffness", "delay", "inertia", "quadratic_damping")
    candidates = [prepare(baseline, find_effect(name)) for name in names]
    found = attribute(baseline, candidates, DiagnosisSettings(unexplained=unexplained))
    assert max(len(one.effects) for one in found.models) == most


def test_where_none_explains_most_of_the_gap_all_are_fitted():
    """Of friction's gap these explain little, and some score nothing."""
    baseline = damper_fit((("dry_friction", (("F_d", 30.0),)),))
    names = ("asymmetric_stiffness", "delay", "inertia", "payne", "force_offset")
    found = attribute(baseline, [prepare(baseline, find_effect(name)) for name in names], DiagnosisSettings())
    assert {one.name: one.outcome for one in found.accounts} == dict.fromkeys(names, "fitted")


def test_with_what_scores_most_alone_the_search_ends():
    baseline = damper_fit((("dry_friction", (("F_d", 30.0),)),))
    names = ("asymmetric_stiffness", "delay", "inertia", "payne", "force_offset")
    candidates = [prepare(baseline, find_effect(name)) for name in names]
    found = attribute(baseline, candidates, DiagnosisSettings(), promising_only=True)
    first = found.score_tests[0]
    assert max(len(one.effects) for one in found.models) == 1
    fitted = {name for one in found.models for name in one.effects}
    assert fitted == {one.name for one in found.score_tests if one.promise >= 0.1 * first.promise} != {*names}


def test_a_fit_goes_on_from_where_another_model_ended():
    """One that went astray ends in the minimum of its own, from the parameters that it shares with a larger model."""
    baseline = damper_fit((("dry_friction", (("F_d", 30.0),)),))
    friction = score_tests(baseline, [prepare(baseline, find_effect("dry_friction"))])[0]
    right = refit(baseline, friction)
    larger = refit(right, score_tests(right, [prepare(baseline, find_effect("asymmetric_stiffness"))])[0])
    own = np.arange(len(right.minimum.point)) < right.hypothesis.own
    off = np.where(own, np.random.default_rng(1).uniform(size=len(own)), right.minimum.point)
    astray = replace(right, minimum=replace(right.minimum, point=off))
    assert right.minimum.value < Remembered(astray.hypothesis).evaluate(off[None])[0][0] - 1e3
    assert right.minimum.value == pytest.approx(refit_from(astray, larger).minimum.value, abs=1e-2)


@pytest.mark.parametrize(
    ("residuals", "score", "gain", "gap"),
    [(0.5, 1e-3, -1.0, False), (0.5, 1e-3, 1.0, True), (1e-3, 1.0, -1.0, True), (0.5, 0.5, 9.0, False)],
    ids=["by chance", "an effect gains", "residual tests", "nothing significant"],
)
def test_a_score_alone_shows_no_gap_that_its_effect_does_not_gain(residuals, score, gain, gap):
    left, tests = Residuals((), residuals), (SimpleNamespace(p_holm=score),)
    models = sorted((model(100.0), model(100.0 - gain, "a")), key=lambda one: one.criterion)
    found = Attribution(None, left, tests, tuple(models), left)
    assert found.has_gap(DiagnosisSettings()) is gap


def fitted(steps, diverges_from, slope=1.0):
    """A minimum of a model that diverges with so many steps, and its derivatives."""

    def model(steps):
        finite = np.array([steps < diverges_from])
        # of a user's simulator, which is never cut to a few periods
        observed = SimpleNamespace(problem=SimpleNamespace(evaluations=object()))
        simulator = SimpleNamespace(experiments=())
        rest = {"observed": observed, "simulator": simulator}
        return SimpleNamespace(steps=steps, with_steps=model, stays_finite=lambda u: finite, **rest)

    minimum = SimpleNamespace(point=np.zeros(2))
    return SimpleNamespace(hypothesis=model(steps), minimum=minimum, jacobian=np.full((3, 2), slope))


def test_a_minimum_that_diverges_at_half_the_step_is_dropped():
    assert is_reliable(fitted(steps=4, diverges_from=16))
    assert not is_reliable(fitted(steps=4, diverges_from=8))


@pytest.mark.parametrize("slope", [1e71, np.nan])
def test_a_minimum_with_divergent_derivatives_is_dropped(slope):
    assert not is_reliable(fitted(steps=4, diverges_from=16, slope=slope))


def test_standard_deviation_with_derivatives_of_all_sizes():
    """Squared, the largest would leave nothing of the others."""
    jacobian = np.array([[1e10, 1e10], [0.0, 1.0]])
    point = np.full(2, 0.5)
    minimum = Minimum(point, 0.0, point, np.eye(2), True, np.zeros(2, dtype=np.int64), ())
    # along (1, -1): one row of slope 1, and twice the box
    assert Fitted(None, minimum, np.zeros(2), jacobian).sd() == pytest.approx(np.full(2, 1 / np.sqrt(3)), rel=1e-5)


def settle(values, limit, present=True, converged=True):
    """The value kept of fits made one after the other, the effect being present in the calibration tests or not."""
    left = iter(values)

    def again(_=None):
        discrepancies = [SimpleNamespace(present_in_calibration=present)]
        minimum = SimpleNamespace(value=next(left), point=np.zeros(1), converged=converged)
        return SimpleNamespace(minimum=minimum, hypothesis=SimpleNamespace(discrepancies=discrepancies))

    return settled(again(), limit, again).minimum.value


@pytest.mark.parametrize(("values", "kept"), [([1.0, 5.0] * 6, 5.0), ([5.0, 1.0, 1.05, 9.0], 1.05)])
def test_of_alternating_minima_the_worse_counts(values, kept):
    assert settle(values, np.inf) == kept


@pytest.mark.parametrize(("values", "converged", "kept"), [([5.0, 3.0], True, 3.0), ([5.0, 3.0, 1.0, 0.5], False, 1.0)])
def test_a_fit_that_ends_before_its_minimum_goes_on(values, converged, kept):
    assert settle(values, np.inf, present=False, converged=converged) == kept


@pytest.mark.parametrize(
    ("values", "kept"),
    [([1000.0], 1000.0), ([400.0, 399.0], 399.0), ([400.0, 380.0, 349.0, 348.9, 348.85], 348.85)],
    ids=["far off", "too slow", "within reach"],
)
def test_what_would_not_reach_the_limit_is_not_fitted_further(values, kept):
    # a sum of squares of 700 is a value of 350; another round would find nothing
    assert settle(values, 700.0) == kept
