"""Input signals and noise of the virtual rig."""

import numpy as np
import pytest

from mofit.simulation.virtual_rig.signals import excitation, noise


def make(kind: str, lines=None, **values):
    return excitation(kind, {"sample_rate": 100.0, **values}, lines, np.random.default_rng(0))


def test_step_waits_ramps_and_holds():
    signal = make("step", amplitude=-0.04, ramp_rate=0.4, delay=0.5, duration=2.0)
    assert signal.interpolation == "linear"
    assert len(signal.time) == 200
    at = np.interp([0.5, 0.55, 0.6, 1.9], signal.time, signal.values)
    assert at == pytest.approx([0, -0.02, -0.04, -0.04])


def test_quasi_static_path_returns_at_constant_speed():
    signal = make("quasi_static", amplitude=0.02, ramp_rate=0.01)
    assert np.abs(np.diff(signal.values)) == pytest.approx(np.full(len(signal.time) - 1, 1e-4))
    assert (signal.values.max(), signal.values.min()) == pytest.approx((0.02, -0.02))
    assert (signal.values[0], signal.values[-1]) == pytest.approx((0, 0), abs=1e-12)


def test_sine_has_whole_periods():
    signal = make("sine", amplitude=0.1, frequency=2.0, periods=3)
    assert len(signal.time) == 150
    assert signal.values == pytest.approx(0.1 * np.sin(4 * np.pi * signal.time))


def test_chirp_sweeps_between_its_frequencies():
    signal = make("chirp", amplitude=1.0, frequency=0.5, last_frequency=8.0, duration=60.0)
    crossings = signal.time[1:][np.diff(np.signbit(signal.values).astype(int)) != 0]
    assert 0.5 / np.diff(crossings)[0] == pytest.approx(0.5, rel=0.1)
    assert 0.5 / np.mean(np.diff(crossings)[-8:]) == pytest.approx(8.0, rel=0.1)


def test_multisine_has_its_lines_and_peak():
    signal = make("multisine", lines=(1, 3, 7), amplitude=2.0, frequency=0.5, periods=4)
    spectrum = np.abs(np.fft.rfft(signal.values))
    assert set(np.flatnonzero(spectrum > 1e-6 * spectrum.max())) == {4, 12, 28}
    assert np.max(np.abs(signal.values)) == pytest.approx(2.0)


def test_noise_has_the_variances_asked_for(rng):
    signal = np.linspace(-50, 50, 200_000)
    assert np.std(noise(signal, rng, sd=3.0)) == pytest.approx(3.0, rel=0.01)
    assert np.std(noise(signal, rng, fraction=0.02)) == pytest.approx(2.0, rel=0.01)
    growing = noise(signal, rng, level=0.1)
    assert np.std(growing[np.abs(signal) > 49]) == pytest.approx(4.95, rel=0.05)
    assert np.std(growing[np.abs(signal) < 1]) < 0.1
    coloured = noise(signal, rng, coloured_sd=5.0, coefficient=0.8)
    assert np.std(coloured) == pytest.approx(5.0, rel=0.02)
    assert np.corrcoef(coloured[1:], coloured[:-1])[0, 1] == pytest.approx(0.8, abs=0.01)
    assert not np.any(noise(signal, rng))
