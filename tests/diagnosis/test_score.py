"""The score test against what it stands for: the drop of the squares, chance, and where parameters hide an effect."""

from dataclasses import replace

import numpy as np
import pytest
from damper_rig import damper_campaign, damper_fit
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import chi2, norm

from mofit.diagnosis.candidates import choose_effects, prepare
from mofit.diagnosis.projection import project
from mofit.diagnosis.refit import refit
from mofit.diagnosis.score_test import holm, score_tests, supremum_p_value
from mofit.models import find_effect, find_model

EFFECTS = (("cubic_stiffness", (("k_c", 2e6),)),)


@pytest.fixture(scope="module")
def fitted():
    return damper_fit(EFFECTS)


def test_projection_is_orthogonal_to_the_parameters(fitted) -> None:
    projection = project(fitted)
    rows = len(fitted.hypothesis.observed.measured)
    rest = projection.apply(-fitted.jacobian[:rows, :1])
    # but for the weight of the box, a row of unit weight
    assert np.linalg.norm(rest) < 1e-2 * np.linalg.norm(fitted.jacobian[:rows, 0])
    assert np.abs(projection.basis.T @ projection.residual).max() < 1e-6


def test_statistic_and_size_are_those_of_the_refit(fitted) -> None:
    """Cubic stiffness is linear in its size: the score test must predict the fit exactly."""
    candidate = prepare(fitted, find_effect("cubic_stiffness"))
    (found,) = score_tests(fitted, [candidate])
    better = refit(fitted, found)
    assert better is not None
    drop = fitted.residual @ fitted.residual - better.residual @ better.residual
    assert found.statistic == pytest.approx(drop, rel=0.01)
    assert found.size[0] == pytest.approx(better.values["k_c"], rel=0.01)
    assert found.size[0] == pytest.approx(2e6, abs=4 * found.size_sd[0])
    moved = np.array(list(fitted.values.values())) - np.array([better.values[name] for name in fitted.values])
    expected = found.bias * fitted.derivative
    np.testing.assert_allclose(moved, expected, rtol=0.05, atol=1e-3 * np.abs(expected).max())


def test_an_offset_that_the_model_has_is_absorbed(fitted) -> None:
    (found,) = score_tests(fitted, [prepare(fitted, find_effect("force_offset"))])
    assert found.confounding > 0.999
    assert found.p_value == 1.0 or found.statistic < 1e-3 or not np.isfinite(found.size_sd[0])


def test_the_wrong_sign_is_no_evidence(fitted) -> None:
    candidate = prepare(fitted, find_effect("dry_friction"))
    turned = replace(candidate, sensitivities=-candidate.sensitivities)
    right, wrong = score_tests(fitted, [candidate])[0], score_tests(fitted, [turned])[0]
    assert min(right.statistic, wrong.statistic) == 0.0
    assert max(right.p_value, wrong.p_value) == 1.0


def test_holm_by_hand() -> None:
    assert holm([0.01, 0.02, 0.5]) == pytest.approx([0.03, 0.04, 0.5])
    assert holm([0.5, 0.6]) == [1.0, 1.0]


@given(st.floats(0.1, 40.0))
def test_p_value_of_one_point_is_chi_square(statistic: float) -> None:
    direction = [np.array([[1.0], [0.0]])]
    assert supremum_p_value(statistic, (0,), direction, 1e9) == pytest.approx(chi2.sf(statistic, 1), rel=1e-6)
    assert supremum_p_value(statistic, (1,), direction, 1e9) == pytest.approx(norm.sf(np.sqrt(statistic)), rel=1e-6)


def test_p_value_over_a_grid_holds_its_level(rng: np.random.Generator) -> None:
    """The supremum over directions that turn by a right angle, by simulation."""
    angles = np.linspace(0, np.pi / 2, 7)
    paths = [np.array([[np.cos(a)], [np.sin(a)]]) for a in angles]
    largest = np.max(np.concatenate(paths, axis=1).T @ rng.standard_normal((2, 400_000)), axis=0)
    for level in (4.0, 9.0):
        chance = np.mean(largest > np.sqrt(level))
        bound = supremum_p_value(level, (1,), paths, 1e9)
        assert chance * 0.9 <= bound <= 1.5 * chance


def test_effects_that_do_not_fit_are_left_out_with_a_reason() -> None:
    model = find_model("kelvin_voigt_damper")
    chosen, left_out = choose_effects(model, damper_campaign())
    names = {effect.name for effect in chosen}
    assert {"dry_friction", "delay", "cubic_stiffness"} <= names
    assert "slip_angle" in left_out["slip_offset"]
    only, _ = choose_effects(model, damper_campaign(), ["delay"])
    assert [effect.name for effect in only] == ["delay"]
