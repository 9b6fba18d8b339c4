import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mofit.campaign import Measurement, Procedure
from mofit.signals import analyse, overlap_noise, quantum, repeat_noise, residual_noise, smooth_derivative


def white(rng, n):
    return rng.normal(size=n)


def coloured(rng, n):
    """First-order noise with a memory of 20 samples, unit standard deviation."""
    a = np.exp(-1 / 20)
    values = rng.normal(size=n + 200)
    for i in range(1, n + 200):
        values[i] = a * values[i - 1] + np.sqrt(1 - a**2) * values[i]
    return values[200:]


@pytest.mark.parametrize("noise", [white, coloured])
@pytest.mark.parametrize("samples_per_period", [100.0, 100.37])
@pytest.mark.parametrize("periods", [2.0, 4.5, 30.2])
def test_noise_from_repeated_periods(noise, samples_per_period, periods):
    n = round(samples_per_period * periods)
    time = np.arange(n) * 0.01
    period = samples_per_period * 0.01
    phase = 2 * np.pi * time / period
    # a waveform with kinks, as friction makes
    signal = 50 * np.sin(phase) + 20 * np.clip(5 * np.sin(phase + 1), -1, 1)
    runs = 60 if noise is white else 40
    levels = [repeat_noise(time, signal + noise(np.random.default_rng(k), n), period) for k in range(runs)]
    mean_square = np.mean(np.square(levels))
    # coloured noise has few independent samples: the scatter of the mean is wider
    allowed = 0.04 if noise is white else 0.12
    assert np.sqrt(mean_square) == pytest.approx(1.0, abs=allowed)


@pytest.mark.parametrize("level", [1e-3, 0.05, 1.0])
def test_noise_of_a_smooth_signal_that_does_not_repeat(level):
    time = np.arange(2000) * 0.01
    signal = 10 * (1 - np.exp(-time / 0.7)) + np.sin(time)
    levels = [residual_noise(signal + level * np.random.default_rng(k).normal(size=2000))[0] for k in range(10)]
    assert np.mean(levels) == pytest.approx(level, rel=0.03)


def test_noise_of_a_broad_signal_that_does_not_repeat():
    rng = np.random.default_rng(0)
    # white up to 0.6 of the Nyquist frequency
    spectrum = np.fft.rfft(rng.normal(size=8192))
    spectrum[int(0.6 * len(spectrum)) :] = 0
    level, method = residual_noise(np.fft.irfft(spectrum) + 0.02 * rng.normal(size=8192))
    assert method == "top of spectrum"
    assert level == pytest.approx(0.02, rel=0.1)


def test_noise_of_one_period_and_its_lead_in():
    rng = np.random.default_rng(0)
    period = rng.normal(size=3000)
    values = np.concatenate([period[-1000:], period]) + 0.02 * rng.normal(size=4000)
    time = np.arange(4000) * 0.01
    assert overlap_noise(time, values, 30.0) == pytest.approx(0.02, rel=0.1)


def test_the_resolution_of_a_quantised_signal():
    time = np.arange(1000) * 0.01
    rounded = np.round(np.sin(time) / 0.02) * 0.02 + 7
    assert quantum(rounded) == pytest.approx(0.02)
    assert quantum(np.sin(time)) == 0
    assert residual_noise(rounded)[0] >= 0.0057


def test_analyse_a_periodic_test():
    rng = np.random.default_rng(0)
    time = np.arange(4000) * 0.01
    phase = 2 * np.pi * 1.017 * time
    force = 80 * np.sin(phase + 0.3) + 2 * rng.normal(size=4000) + 400 * np.exp(-time / 0.3)
    procedure = Procedure("a", "sine", time, {"displacement": 0.01 * np.sin(phase)}, frequency=1.0, amplitude=0.01)
    record = analyse(Measurement(procedure, {"force": force}, {"displacement": "m", "force": "N"}))
    assert record.period == pytest.approx(1 / 1.017, rel=1e-5)
    assert 0.8 < record.transient < 2.0
    assert record.tail == 0
    assert record.periods == int((40 - record.transient) * 1.017)
    assert record.noise_method == "period to period"
    assert record.noise_sd["force"] == pytest.approx(2.0, rel=0.05)
    assert record.noise_floor == pytest.approx({"force": record.noise_sd["force"] / np.ptp(force)})


def test_analyse_takes_the_channels_that_a_model_names():
    time = np.arange(1200) * 0.01
    phase = 2 * np.pi * time
    procedure = Procedure("a", "sine", time, {"displacement": np.sin(phase)}, frequency=1.0)
    test = Measurement(procedure, {"force": np.sin(2 * phase)}, {"displacement": "m", "force": "N"})
    record = analyse(test, driver="force", output="displacement")
    assert record.period == pytest.approx(0.5, rel=1e-6)
    assert set(record.noise_floor) == {"force", "displacement"}


def test_analyse_a_step_and_a_stated_transient():
    time = np.arange(800) * 0.01
    steer = np.where(time > 1, 0.02, 0.0)
    force = 900 * (1 - np.exp(-np.clip(time - 1, 0, None) / 0.2)) + 3 * np.random.default_rng(0).normal(size=800)
    procedure = Procedure("step", "step", time, {"slip_angle": steer}, transient=0.5)
    record = analyse(Measurement(procedure, {"lateral_force": force}, {"slip_angle": "rad", "lateral_force": "N"}))
    assert (record.period, record.periods, record.transient) == (None, 0, 0.5)
    assert record.noise_sd["lateral_force"] == pytest.approx(3.0, rel=0.1)


SIGNALS = {
    "constant": lambda t, rng: np.full(len(t), 3.0),
    "zero": lambda t, rng: np.zeros(len(t)),
    "step": lambda t, rng: np.where(t > t.mean(), 1.0, 0.0),
    "ramp": lambda t, rng: t,
    "sine": lambda t, rng: np.sin(rng.uniform(0.5, 40) * t),
    "noise": lambda t, rng: rng.normal(size=len(t)),
    "pulse": lambda t, rng: (np.arange(len(t)) == len(t) // 2).astype(float),
    "huge": lambda t, rng: 1e12 * np.sin(9 * t) + 1e14,
    "tiny": lambda t, rng: 1e-12 * np.sin(9 * t),
}


@settings(deadline=None, max_examples=150)
@given(
    n=st.integers(8, 90),
    kind=st.sampled_from(["sine", "multisine", "step", "free", "chirp", "quasi_static"]),
    drive=st.sampled_from(sorted(SIGNALS)),
    answer=st.sampled_from(sorted(set(SIGNALS) - {"constant", "zero"})),
    seed=st.integers(0, 99),
)
def test_analyse_gives_finite_numbers_for_whatever_a_sound_test_holds(n, kind, drive, answer, seed):
    rng = np.random.default_rng(seed)
    time = 7.0 + np.arange(n) * 0.01
    inputs, outputs = {"displacement": SIGNALS[drive](time, rng)}, {"force": SIGNALS[answer](time, rng)}
    procedure = Procedure("a", kind, time, inputs, frequency=1.0)
    record = analyse(Measurement(procedure, outputs, {"displacement": "m", "force": "N"}))
    assert np.all(np.isfinite([*record.noise_sd.values(), *record.noise_floor.values()]))
    assert min(record.noise_sd.values()) >= 0
    assert record.period is None or 0 < record.period < 10
    assert 0 <= record.transient <= time[-1] - time[0]
    for values in (*inputs.values(), *outputs.values()):
        assert np.all(np.isfinite(smooth_derivative(time, values)))
