"""Noise of records that do not repeat is what the best effects leave: part of a gap that drifts was taken for it."""

from __future__ import annotations

import numpy as np
import pytest

from mofit.data import Campaign, Experiment, Measurement
from mofit.diagnosis.baseline import baseline_in_wide_ranges
from mofit.diagnosis.candidates import ranged
from mofit.diagnosis.main_cause import investigate
from mofit.diagnosis.settings import DiagnosisSettings
from mofit.identification.settings import Settings
from mofit.models import find_effect, find_model
from mofit.runtime.progress import silent
from mofit.simulation.ranges import data_scales

STEP, COUNT, FINE = 0.04, 500, 5
STIFFNESS, FREQUENCY, DAMPING = 1e3, 2.0, 0.02
#: Standard deviation of the noise, relative to that of the displacement.
NOISE = 0.01


def response(force: np.ndarray, start: float, loss: float, fading: float) -> np.ndarray:
    """Displacement of an oscillator whose stiffness falls over the campaign, by Runge-Kutta on a fine grid."""
    omega = 2 * np.pi * FREQUENCY

    def rates(time: float, state: np.ndarray) -> np.ndarray:
        left = 1 - loss * (1 - np.exp(-(start + time) / fading))
        push = np.interp(time, STEP * np.arange(COUNT), force) / STIFFNESS
        return np.array([state[1], omega**2 * (push - left * state[0]) - 2 * DAMPING * omega * state[1]])

    state, found, h = np.zeros(2), [0.0], STEP / FINE
    for k in range(FINE * (COUNT - 1)):
        a = rates(k * h, state)
        b = rates((k + 0.5) * h, state + 0.5 * h * a)
        c = rates((k + 0.5) * h, state + 0.5 * h * b)
        d = rates((k + 1) * h, state + h * c)
        state = state + h / 6 * (a + 2 * b + 2 * c + d)
        if (k + 1) % FINE == 0:
            found.append(state[0])
    return np.array(found)


def campaign(loss: float, fading: float) -> Campaign:
    """Two records under a smooth random force, one after the other."""
    rng, time, measurements = np.random.default_rng(2), STEP * np.arange(COUNT), []
    for k in range(2):
        omega = 2 * np.pi * (0.1 + 0.1007 * np.arange(40))[:, None]
        force = np.sum(np.sin(omega * time + rng.uniform(0, 2 * np.pi, (40, 1))), axis=0)
        clean = response(force, k * COUNT * STEP, loss, fading)
        noisy = clean + NOISE * clean.std() * rng.standard_normal(COUNT)
        experiment = Experiment(f"free {k + 1}", "free", time, {"force": force}, {}, start_time=k * COUNT * STEP)
        measurements.append(Measurement(experiment, {"displacement": noisy}, {"force": "N", "displacement": "m"}))
    return Campaign("softening oscillator", "simulated", {}, tuple(measurements))


@pytest.mark.slow
@pytest.mark.parametrize(("loss", "fading"), [(0.4, 40.0), (0.3, 15.0)], ids=["part of the gap", "all of it"])
def test_the_noise_is_what_the_best_effect_leaves(loss: float, fading: float) -> None:
    """It is taken for more than ten times what it is, with part of a gap in it, or so much that none is left."""
    model, data = find_model("oscillator"), campaign(loss, fading)
    baseline, _ = baseline_in_wide_ranges(model, data, Settings(jobs=1))
    drift = ranged(find_effect("drift:spring_force"), data_scales(model, data), {})
    case = investigate(baseline, [drift], DiagnosisSettings(most_effects=1), 0, silent)
    before, after = (
        np.array([w.noise_sd for _, _, w in one.hypothesis.observed.records]) for one in (baseline, case.found.baseline)
    )
    truth = NOISE * np.array([m.channel("displacement").std() for m in data.measurements])
    # else there is nothing to find again
    assert np.all(before > 10 * truth)
    assert np.all(after > 0.8 * truth)
    assert np.all(after < 1.5 * truth)
    assert case.found.best.effects == ("drift:spring_force",)
