"""What is missing in a model, and how its states move with it: dense Gaussian inference, and a known motion."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.stats import multivariate_normal
from strangers import PUSHES, RATE, beyond, oscillator

from mofit.diagnosis.baseline import baseline_in_wide_ranges
from mofit.diagnosis.fitting import Fitted
from mofit.diagnosis.inner_signals import inner_signals
from mofit.diagnosis.linear_response import LinearResponse
from mofit.diagnosis.missing_signal import MissingSignal
from mofit.diagnosis.proposal import Proposal, propose
from mofit.diagnosis.settings import DiagnosisSettings
from mofit.diagnosis.smoothed_motion import fitted_readings, readings_without, smoothed_readings
from mofit.diagnosis.term_rows import term_columns
from mofit.diagnosis.term_selection import selections
from mofit.diagnosis.terms import static_terms
from mofit.identification.settings import Settings
from mofit.models import find_model
from mofit.runtime.progress import silent

SAMPLES, STATES, QUANTITIES, OUTPUTS = 12, 2, 2, 2
SPREAD, SCALES, VARIANCE = np.array([3.0, 0.2]), np.array([5.0, 40.0]), np.array([0.04, 0.5])
STOP, AT = 4000.0, 0.02


def a_response(random: np.random.Generator) -> LinearResponse:
    steps = SAMPLES - 1
    return LinearResponse(
        ("a", "b"),
        0.5 * random.standard_normal((steps, STATES, STATES)),
        0.3 * random.standard_normal((steps, STATES, STATES)),
        0.3 * random.standard_normal((steps, STATES, STATES)),
        random.standard_normal((SAMPLES, STATES, QUANTITIES)),
        random.standard_normal((SAMPLES, OUTPUTS, STATES)),
        random.standard_normal((SAMPLES, OUTPUTS, QUANTITIES)),
        np.zeros((STATES, QUANTITIES)),
    )


def dense(response: LinearResponse, quantity: int, step: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """States (n, x, k) and outputs (n, y, k) by unit normal variables k: the first states, w, and its steps."""
    count = STATES + SAMPLES
    start = np.diag([*SPREAD, SCALES[quantity]])
    w = np.zeros((SAMPLES, count))
    w[:, STATES] = SCALES[quantity]
    for k in range(1, SAMPLES):
        w[k:, STATES + k] = step * SCALES[quantity]
    x = np.zeros((SAMPLES, STATES, count))
    x[0, :, :STATES] = start[:STATES, :STATES]
    for k in range(SAMPLES - 1):
        here = response.here[k] @ response.driven[k, :, quantity]
        there = response.there[k] @ response.driven[k + 1, :, quantity]
        x[k + 1] = response.advance[k] @ x[k] + np.outer(here, w[k]) + np.outer(there, w[k + 1])
    seen = response.seen @ x + response.direct[:, :, quantity, None] * w[:, None]
    return x, seen, w


def test_states_and_probabilities_are_those_of_dense_gaussian_inference() -> None:
    random = np.random.default_rng(4)
    response = a_response(random)
    errors = random.standard_normal((SAMPLES, OUTPUTS))
    errors[[0, 5], 1], errors[7] = np.nan, np.nan
    told = np.isfinite(errors)
    steps = np.array([0.02, 0.7])
    missing = MissingSignal.of(response, [0, 1], SCALES, SPREAD, errors, VARIANCE)
    found, moved = missing.log_likelihoods(steps), missing.smoothed(steps)
    for quantity in range(QUANTITIES):
        for g, step in enumerate(steps):
            x, seen, _ = dense(response, quantity, step)
            rows = seen[told]
            covariance = rows @ rows.T + np.diag(np.broadcast_to(VARIANCE, errors.shape)[told])
            normal = multivariate_normal.logpdf(errors[told], cov=covariance)
            assert found[quantity, g] == pytest.approx(normal + 0.5 * told.sum() * np.log(2 * np.pi), rel=1e-9)
            if g == quantity:  # one step per quantity
                expected = x @ rows.T @ np.linalg.solve(covariance, errors[told])
                np.testing.assert_allclose(moved[:, quantity], expected, atol=1e-9)


def force_of_stops(x: float, v: float) -> float:
    return float(STOP * beyond(np.array(x), AT))


@cache
def fitted_oscillator() -> Fitted:
    return baseline_in_wide_ranges(find_model("oscillator"), oscillator(force_of_stops), Settings(jobs=1))[0]


def velocity(amplitude: float, frequency: float, periods: int) -> np.ndarray:
    t = np.arange(round(periods / frequency * RATE)) / RATE
    omega = 2 * np.pi * frequency

    def rates(now: float, s: np.ndarray) -> tuple[float, float]:
        return s[1], amplitude * np.sin(omega * now) - 400 * s[0] - 4 * s[1] - force_of_stops(s[0], s[1])

    return np.asarray(solve_ivp(rates, (t[0], t[-1]), [0.0, 0.0], t_eval=t, rtol=1e-9, atol=1e-12).y[1])


@pytest.mark.slow
def test_the_smoothed_motion_comes_near_that_of_the_rig_in_states_that_nothing_measures() -> None:
    signals = inner_signals(fitted_oscillator())
    target = next(one for one in signals.targets() if one.name == "damper_force")
    (reading,) = smoothed_readings(fitted_readings(signals, [target]))
    for push, used, fitted, smoothed in zip(PUSHES, signals.used, signals.signals, reading.motion.signals, strict=True):
        whole = velocity(*push)
        truth = whole[used.start - (len(fitted["velocity"]) - len(whole)) :][: used.stop - used.start]
        before, after = (np.std(own["velocity"][used] - truth) / np.std(truth) for own in (fitted, smoothed))
        assert after < 0.05
        assert before < 0.1 or after < 0.1 * before  # the smallest stroke does not reach the stops


@pytest.mark.slow
def test_strong_stops_are_found_where_they_stand() -> None:
    found = propose(fitted_oscillator(), None, DiagnosisSettings(), 0, silent)
    assert isinstance(found, Proposal), found
    assert found.law == "position beyond a threshold, added to damper_force"
    (term,) = found.effect.terms
    assert term.term.point is not None
    assert term.term.point * term.term.x.scale == pytest.approx(AT, rel=0.01)
    assert found.removed > 0.999
    # what replaces the term along its own motion is the term
    signals = inner_signals(found.fitted)
    (smoothed,) = smoothed_readings(fitted_readings(signals, [found.target]))
    readings = readings_without(signals, smoothed, [(term.term, term.value)], [found.target])
    (columns,) = term_columns(readings, [*static_terms(signals.variables()), term.term])
    best = selections(found.fitted.hypothesis.observed, columns, 0.0, 1)[0]
    assert best.terms == (term.term,)
    assert best.sizes[0] == pytest.approx(term.value, rel=0.02)
