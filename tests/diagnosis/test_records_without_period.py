"""Records that do not repeat: what past inputs predict of a residual is a gap, coloured noise beside that is none."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy.linalg import solve_triangular, toeplitz
from scipy.signal import lfilter

from mofit.data import Campaign, Experiment, Measurement
from mofit.diagnosis.baseline import baseline_in_wide_ranges
from mofit.diagnosis.causal_filter import CausalFilter
from mofit.diagnosis.diagnose import diagnose
from mofit.diagnosis.fitting import Fitted
from mofit.diagnosis.residual_tests import residual_tests
from mofit.identification.settings import Settings
from mofit.models import find_model

RATE, COUNT = 100.0, 1200
STIFFNESS, DAMPING = 2e4, 400.0


def spectrum(pole: float, count: int) -> np.ndarray:
    omega = 2 * np.pi * np.arange(count // 2 + 1) / count
    return 1 / np.abs(1 - pole * np.exp(-1j * omega)) ** 2


@pytest.mark.parametrize("count", [300, 301])
@pytest.mark.parametrize("pole", [0.0, 0.8, -0.5])
def test_the_filter_is_the_cholesky_factor_of_the_noise(count: int, pole: float, rng: np.random.Generator) -> None:
    covariance = toeplitz(pole ** np.arange(count) / (1 - pole**2))
    values = rng.standard_normal((2, count))
    exact = solve_triangular(np.linalg.cholesky(covariance), values.T, lower=True).T
    found = CausalFilter.whitening(spectrum(pole, count), count)
    np.testing.assert_allclose(found.apply(values), exact, atol=1e-9)
    np.testing.assert_allclose(found.undo(found.apply(values)), values, atol=1e-9)


def presliding(v: np.ndarray, length: float = 5e-4, parts: int = 20) -> np.ndarray:
    """State of a friction that builds up over a length in m, explicit Euler between samples of the rate."""
    z, states = 0.0, [0.0]
    for low, high in pairwise(v):
        for rate in np.linspace(low, high, parts, endpoint=False):
            z += (rate - abs(rate) * z) / length / parts / RATE
        states.append(z)
    return np.array(states)


def campaign(seed: int, colour: float, extra: float = 0.0) -> Campaign:
    """A spring and damper, driven by a chirp and by noise that is smooth; ``extra`` is friction, in N."""
    rng, time = np.random.default_rng(seed), np.arange(COUNT) / RATE
    measurements = []
    for k in range(3):
        phases = rng.uniform(0, 2 * np.pi, 60)[:, None]
        omega = 2 * np.pi * (0.05 + 0.1003 * np.arange(60))[:, None]
        size = 2e-3 / (1 + (omega / 15) ** 2)
        x, v = np.sum(size * np.sin(omega * time + phases), 0), np.sum(size * omega * np.cos(omega * time + phases), 0)
        clean = STIFFNESS * x + DAMPING * v + extra * presliding(v)
        noise = lfilter([1.0], [1.0, -colour], rng.standard_normal(COUNT + 200))[200:] * np.sqrt(1 - colour**2)
        force = clean + 0.03 * clean.std() * noise
        experiment = Experiment(f"free {k + 1}", "free", time, {"displacement": x, "velocity": v}, {})
        units = {"displacement": "m", "velocity": "m/s", "force": "N"}
        measurements.append(Measurement(experiment, {"force": force}, units))
    return Campaign("spring and damper", "simulated", {}, tuple(measurements))


SETTINGS = Settings(fixed={"p": 0.0, "c_M": 0.0, "d_M": 100.0}, jobs=1, evaluations=200)
SETTINGS_HELD = Settings(jobs=1, evaluations=200)


def baseline(data: Campaign) -> Fitted:
    return baseline_in_wide_ranges(find_model("maxwell_damper"), data, SETTINGS)[0]


def past_inputs(data: Campaign) -> float:
    """p-value of what past inputs predict."""
    return next(one.p_value for one in residual_tests(baseline(data)).tests if one.name == "past inputs")


def swept(half: float) -> Campaign:
    """The same under two chirps; ``half`` is a line at half their frequency, relative to the force."""
    rng, time = np.random.default_rng(3), np.arange(COUNT) / RATE
    measurements = []
    for k, (low, high) in enumerate(((0.3, 4.0), (4.0, 0.3))):
        phase = 2 * np.pi * (low * time + (high - low) * time**2 / 2 / time[-1])
        rate = 2 * np.pi * (low + (high - low) * time / time[-1])
        x, v = 2e-3 * np.sin(phase), 2e-3 * rate * np.cos(phase)
        clean = STIFFNESS * x + DAMPING * v
        force = clean + clean.std() * (half * np.sin(phase / 2 + 0.5) + 0.02 * rng.standard_normal(COUNT))
        experiment = Experiment(f"chirp {k + 1}", "chirp", time, {"displacement": x, "velocity": v}, {})
        units = {"displacement": "m", "velocity": "m/s", "force": "N"}
        measurements.append(Measurement(experiment, {"force": force}, units))
    return Campaign("spring and damper", "simulated", {}, tuple(measurements))


def test_what_answers_at_half_the_frequency_is_a_gap() -> None:
    assert past_inputs(swept(0.0)) > 1e-3
    found = baseline(swept(0.05))
    assert residual_tests(found).p_value < 1e-6
    # and no part of the noise
    for i, (_, _, w) in enumerate(found.hypothesis.observed.records):
        expected = 0.02 * float(found.hypothesis.observed.used_samples(i).std())
        assert w.noise_sd == pytest.approx(expected, rel=0.1)


@pytest.mark.slow
def test_coloured_noise_is_no_gap() -> None:
    p_values = [past_inputs(campaign(seed, 0.9)) for seed in range(5)]
    assert min(p_values) > 1e-3
    assert max(p_values) > 0.2


def test_rows_of_coloured_noise_are_white() -> None:
    data = campaign(1, 0.9)
    fitted = baseline(data)
    observed = fitted.hypothesis.observed
    rows = fitted.residual[: len(observed.measured)]
    frequency = np.concatenate([w.frequencies[w.line_of_row] for _, _, w in observed.records])
    for low, high in ((0.0, 2.0), (2.0, 10.0), (10.0, 60.0)):
        band = rows[(frequency >= low) & (frequency < high)]
        assert np.mean(band**2) == pytest.approx(1.0, abs=4 * np.sqrt(2 / len(band)))


@pytest.mark.slow
def test_friction_under_coloured_noise_is_a_gap_and_named() -> None:
    data = campaign(1, 0.9, extra=4.0)
    assert past_inputs(data) < 1e-6
    found = diagnose(data, "maxwell_damper", ("dry_friction", "cubic_stiffness", "quadratic_damping"), SETTINGS)
    assert found.conclusion.verdict == "effect"
    assert found.conclusion.effects[0].name == "dry_friction"
    assert found.after.gap < 0.3 * found.before.gap
    alone = found.shrinkage and found.shrinkage.of("test")
    assert alone
    assert alone.low < alone.observed + 0.05
    assert alone.share > 0.9


def in_a_narrow_band(seed: int, colour: float, noise_sd: float) -> Campaign:
    """One slow chirp: past inputs predict all that is on its lines, the noise too."""
    rng, time = np.random.default_rng(seed), np.arange(COUNT) / RATE
    phase, omega = 2 * np.pi * (0.4 * time + 0.1 * time**2 / time[-1]), 2 * np.pi * (0.4 + 0.2 * time / time[-1])
    x, v = 2e-3 * np.sin(phase), 2e-3 * omega * np.cos(phase)
    noise = lfilter([1.0], [1.0, -colour], rng.standard_normal(COUNT + 200))[200:] * np.sqrt(1 - colour**2)
    experiment = Experiment("chirp", "chirp", time, {"displacement": x, "velocity": v}, {})
    units = {"displacement": "m", "velocity": "m/s", "force": "N"}
    measured = Measurement(experiment, {"force": STIFFNESS * x + DAMPING * v + noise_sd * noise}, units)
    return Campaign("spring and damper", "simulated", {}, (measured,))


def test_noise_is_known_where_past_inputs_predict_all() -> None:
    found = []
    for seed in range(8):
        ((_, _, w),) = baseline(in_a_narrow_band(seed, 0.8, 1.0)).hypothesis.observed.records
        truth = (1 - 0.8**2) * spectrum(0.8, w.count)
        found.append(np.log(w.process.spectrum / truth)[1:20].mean())
    assert np.abs(np.mean(found)) < 0.25


def test_a_constant_input_predicts_nothing(rng: np.random.Generator) -> None:
    held = {"displacement": np.full(COUNT, 0.01), "velocity": np.zeros(COUNT)}
    force = STIFFNESS * held["displacement"] + rng.standard_normal(COUNT)
    units = {"displacement": "m", "velocity": "m/s", "force": "N"}
    only = Measurement(Experiment("hold", "free", np.arange(COUNT) / RATE, held, {}), {"force": force}, units)
    found = diagnose(Campaign("held still", "simulated", {}, (only,)), "kelvin_voigt_damper", settings=SETTINGS_HELD)
    assert found.conclusion.verdict == "none"
