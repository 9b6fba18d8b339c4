"""The best of all simple functions of the model's own signals: a stop that is met in a few moments is no noise."""

from __future__ import annotations

import re

import numpy as np
import pytest

from mofit.data import Campaign, Experiment, Measurement
from mofit.diagnosis.baseline import baseline_in_wide_ranges
from mofit.diagnosis.diagnose import diagnose
from mofit.diagnosis.discrepancy import Discrepancy
from mofit.diagnosis.fitting import Fitted
from mofit.diagnosis.hypothesis import hypothesis
from mofit.diagnosis.left_residual import ResidualTest
from mofit.diagnosis.projection import project
from mofit.diagnosis.residual_tests import residual_tests
from mofit.diagnosis.term_score import TermScore, best_term
from mofit.diagnosis.terms import proposed
from mofit.identification.settings import Settings
from mofit.models import find_model

RATE, COUNT = 100.0, 1200
STIFFNESS, DAMPING, NOISE = 2e4, 400.0, 2.0
SETTINGS = Settings(jobs=1, evaluations=200)


def campaign(seed: int, stop: float = 0.0) -> Campaign:
    """A spring and damper under smooth noise; a ``stop``, in N/m, is met where one record of three goes farthest."""
    rng, time = np.random.default_rng(seed), np.arange(COUNT) / RATE
    omega = 2 * np.pi * (0.05 + 0.1003 * np.arange(60))[:, None]
    size = 2e-3 / (1 + (omega / 15) ** 2)
    phases = rng.uniform(0, 2 * np.pi, (3, 60, 1))
    strokes = [np.sum(size * np.sin(omega * time + own), 0) for own in phases]
    rates = [np.sum(size * omega * np.cos(omega * time + own), 0) for own in phases]
    highest = sorted(float(x.max()) for x in strokes)
    begins = max(highest[1], highest[2] - 1.5e-3)
    measurements = []
    for k, (x, v) in enumerate(zip(strokes, rates, strict=True)):
        force = STIFFNESS * x + DAMPING * v + stop * np.maximum(x - begins, 0) + NOISE * rng.standard_normal(COUNT)
        experiment = Experiment(f"road {k + 1}", "free", time, {"displacement": x, "velocity": v}, {})
        units = {"displacement": "m", "velocity": "m/s", "force": "N"}
        measurements.append(Measurement(experiment, {"force": force}, units))
    return Campaign("spring and damper", "simulated", {}, tuple(measurements))


def baseline(data: Campaign) -> Fitted:
    return baseline_in_wide_ranges(find_model("kelvin_voigt_damper"), data, SETTINGS)[0]


def of_own_signals(data: Campaign) -> tuple[ResidualTest, float]:
    """The test of terms, and the least p-value of all others."""
    tests = residual_tests(baseline(data)).tests
    (own,) = (one for one in tests if one.name == "own signals")
    return own, min(one.p_value for one in tests if one is not own)


def rows_of(fitted: Fitted, found: TermScore) -> np.ndarray:
    """Whitened rows of the term per unit of its size, by simulating the model with it."""
    effect = proposed(found.target, [found.term], [0.0], ())
    point = {one.name: one.nominal for one in effect.parameters if one.neutral is None}
    free = len(fitted.minimum.point)
    absent = Discrepancy(effect, point, np.zeros(1), np.zeros(free), np.zeros((free, 1)))
    model = hypothesis(fitted.hypothesis.observed, [absent])
    values = [*fitted.values.values(), *(one.nominal for one in effect.parameters)]
    at = [values.copy(), values.copy()]
    at[1][free] = step = 1e-3 * found.target.scale
    outputs = [one for one, _ in model.outputs(model.space.to_unit(np.array(at)))]
    changes = [(one[1:] - one[:1])[..., None] / step for one in outputs]
    return np.asarray(model.observed.whitened(changes)[0, :, 0])


def test_the_score_is_the_decrease_of_squares_with_the_term() -> None:
    fitted = baseline(campaign(1, stop=1e4))
    found = best_term(fitted, project(fitted))
    assert found.term.x.name == "displacement"
    rows, design = rows_of(fitted, found), fitted.design
    wider = np.column_stack([design, np.r_[rows, np.zeros(len(design) - len(rows))]])
    residual = np.r_[fitted.residual, np.zeros(len(design) - len(fitted.residual))]

    def left(matrix: np.ndarray) -> np.ndarray:
        return residual - matrix @ np.linalg.lstsq(matrix, residual)[0]

    before, after = left(design), left(wider)
    assert found.statistic == pytest.approx(before @ before - after @ after, rel=1e-3)
    np.testing.assert_allclose(found.rows, (before - after)[: len(rows)], atol=1e-3 * np.abs(found.rows).max())


def test_a_stop_that_is_met_in_one_record_alone_is_a_gap() -> None:
    own, others = of_own_signals(campaign(1, stop=4e3))
    assert own.p_value < 1e-3 < others
    # above and below differ by what the spring does
    assert re.match("a part like displacement (above|below) a threshold, added to ", own.description)
    strokes = [one.experiment.inputs["displacement"] for one in campaign(1).measurements]
    assert np.argmax(own.squares) == np.argmax([stroke.max() for stroke in strokes])


@pytest.mark.parametrize("seed", range(3))
def test_noise_alone_is_none(seed: int) -> None:
    assert of_own_signals(campaign(seed))[0].p_value > 0.01


@pytest.mark.slow
def test_the_verdict_on_a_stop_that_no_effect_is_like() -> None:
    found = diagnose(campaign(1, stop=1e4), "kelvin_voigt_damper", settings=SETTINGS)
    assert found.conclusion.verdict == "unknown"
    # no other record can say whether it would be predicted
    assert "it may be chance" in found.proposed_reason
