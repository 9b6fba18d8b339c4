import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter

from mofit.data import Experiment, Measurement
from mofit.data.signals import analyse, find_transient, smooth_derivative, steady_samples


def test_analyse_a_periodic_test():
    rng = np.random.default_rng(0)
    time = np.arange(4000) * 0.01
    phase = 2 * np.pi * 1.017 * time
    force = 80 * np.sin(phase + 0.3) + 2 * rng.normal(size=4000) + 400 * np.exp(-time / 0.3)
    experiment = Experiment("a", "sine", time, {"displacement": 0.01 * np.sin(phase)}, frequency=1.0, amplitude=0.01)
    record = analyse(Measurement(experiment, {"force": force}, {"displacement": "m", "force": "N"}))
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
    experiment = Experiment("a", "sine", time, {"displacement": np.sin(phase)}, frequency=1.0)
    test = Measurement(experiment, {"force": np.sin(2 * phase)}, {"displacement": "m", "force": "N"})
    record = analyse(test, driver="force", output="displacement")
    assert record.period == pytest.approx(0.5, rel=1e-6)
    assert set(record.noise_floor) == {"force", "displacement"}


@pytest.mark.parametrize(("other", "period"), [(2.0, 1.0), (0.7, None)])
def test_a_period_is_one_of_all_inputs_that_a_model_reads(other, period):
    rng, time = np.random.default_rng(0), np.arange(500) * 0.01
    inputs = {"slip_angle": np.sin(2 * np.pi * time), "slip_ratio": np.sin(2 * np.pi * other * time)}
    force = 900 * inputs["slip_ratio"] + 3 * rng.normal(size=500)
    units = {"slip_angle": "rad", "slip_ratio": "1", "longitudinal_force": "N"}
    test = Measurement(Experiment("a", "free", time, inputs), {"longitudinal_force": force}, units)
    record = analyse(test, driver="slip_angle", beside=("slip_ratio",))
    assert record.period == (period and pytest.approx(period, rel=1e-4))
    assert record.transient == 0
    assert record.noise_sd["longitudinal_force"] == pytest.approx(3.0, rel=0.1)


def test_analyse_a_step_and_a_stated_transient():
    time = np.arange(800) * 0.01
    steer = np.where(time > 1, 0.02, 0.0)
    force = 900 * (1 - np.exp(-np.clip(time - 1, 0, None) / 0.2)) + 3 * np.random.default_rng(0).normal(size=800)
    experiment = Experiment("step", "step", time, {"slip_angle": steer}, transient=0.5)
    record = analyse(Measurement(experiment, {"lateral_force": force}, {"slip_angle": "rad", "lateral_force": "N"}))
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


@settings(deadline=None, max_examples=50)
@given(
    n=st.integers(8, 90),
    kind=st.sampled_from(["sine", "multisine", "step", "free", "chirp", "quasi_static"]),
    experiment=st.sampled_from(sorted(SIGNALS)),
    answer=st.sampled_from(sorted(set(SIGNALS) - {"constant", "zero"})),
    seed=st.integers(0, 99),
)
def test_analyse_gives_finite_numbers_for_whatever_a_sound_test_holds(n, kind, experiment, answer, seed):
    rng = np.random.default_rng(seed)
    time = 7.0 + np.arange(n) * 0.01
    inputs, outputs = {"displacement": SIGNALS[experiment](time, rng)}, {"force": SIGNALS[answer](time, rng)}
    experiment = Experiment("a", kind, time, inputs, frequency=1.0)
    record = analyse(Measurement(experiment, outputs, {"displacement": "m", "force": "N"}))
    assert np.all(np.isfinite([*record.noise_sd.values(), *record.noise_floor.values()]))
    assert min(record.noise_sd.values()) >= 0
    assert record.period is None or 0 < record.period < 10
    assert 0 <= record.transient <= time[-1] - time[0]
    for values in (*inputs.values(), *outputs.values()):
        assert np.all(np.isfinite(smooth_derivative(time, values)))


def response(periods, decay=None, noise=0.005, seed=0):
    time = np.arange(round(periods * 101.3)) / 101.3
    phase = 2 * np.pi * time
    wave = np.sin(phase) + 0.1 * np.sin(3 * phase)
    wave += 0.0 if decay is None else 2 * np.exp(-time / decay)
    return time, wave + noise * np.random.default_rng(seed).normal(size=len(time))


@pytest.mark.parametrize("decay", [0.2, 0.4, 0.8])
@pytest.mark.parametrize("seed", range(3))
def test_a_decaying_transient_ends_where_it_drowns_in_noise(decay, seed):
    time, values = response(12, decay, seed=seed)
    transient, tail = find_transient(time, values, 1.0)
    # it is 3 % at the start of the first window that passes, and 1 % a window later at the latest
    assert decay * np.log(2 / 0.03) < transient < decay * np.log(2 / 0.005) + 0.25
    assert tail == 0


@pytest.mark.parametrize("periods", [2.0, 2.5, 3.0, 7.4, 20.0])
@pytest.mark.parametrize("seed", range(3))
def test_a_steady_record_has_none(periods, seed):
    time, values = response(periods, seed=seed)
    assert find_transient(time, values, 1.0) == (0.0, 0.0)


def test_a_slow_drift_is_none():
    time, values = response(12)
    assert find_transient(time, values + 0.01 * time, 1.0) == (0.0, 0.0)


@pytest.mark.parametrize("seed", range(30))
def test_noise_that_depends_on_what_it_was_before_is_none(seed):
    # 25 samples per period: of so coloured a noise they are worth five
    time, wave = np.arange(500) / 100, 3000 * np.sin(8 * np.pi * np.arange(500) / 100)
    noise = lfilter([12.0], [1, -0.8], np.random.default_rng(seed).normal(size=1000))[500:]
    assert find_transient(time, wave + noise, 0.25) == (0.0, 0.0)


def test_a_transient_shows_through_such_noise():
    time, wave = np.arange(500) / 100, 3000 * np.sin(8 * np.pi * np.arange(500) / 100)
    noise = lfilter([12.0], [1, -0.8], np.random.default_rng(1).normal(size=1000))[500:]
    transient, tail = find_transient(time, wave + noise + 600 * np.exp(-time / 0.3), 0.25)
    assert 0.3 * np.log(600 / 60) < transient < 0.3 * np.log(600 / 15) + 0.5
    assert tail == 0


def test_a_rig_that_stops_before_the_end_of_the_record():
    time, values = response(9)
    values[time > 7.5] = 0.0
    transient, tail = find_transient(time, values, 1.0)
    assert transient == 0
    assert tail == pytest.approx(1.5, abs=0.15)
    kept = steady_samples(time, transient, tail)
    assert time[kept][-1] == pytest.approx(7.5, abs=0.15)
    assert time[kept][0] == 0


def test_less_than_two_periods_show_no_transient():
    time, values = response(1.9, 0.3)
    assert find_transient(time, values, 1.0) == (0.0, 0.0)


def test_kept_samples_are_whole_periods_where_the_transient_is_one():
    time = 5 + np.arange(300) * 0.01
    assert np.count_nonzero(steady_samples(time, 1.0)) == 200
    assert np.count_nonzero(steady_samples(time, 1.0, 1.0)) == 100


@pytest.mark.parametrize(("steady", "repeats"), [(2, False), (40, True)])
def test_a_sine_that_ramps_in_and_out_is_used_for_what_it_holds(steady, repeats):
    # ramps of 2.5 periods: a record with two steady periods repeats nowhere, one with forty repeats between them
    time = np.arange(0, 5 + steady, 0.01)
    stroke = np.clip(np.minimum(time, time[-1] - time) / 2.5, 0, 1) * np.sin(2 * np.pi * time)
    force = 3 * stroke + 0.06 * np.random.default_rng(4).standard_normal(len(time))
    experiment = Experiment(name="a", kind="sine", time=time, inputs={"displacement": stroke}, frequency=1.0)
    record = analyse(Measurement(experiment=experiment, outputs={"force": force}, units={}))
    assert record.noise_sd["force"] == pytest.approx(0.06, rel=0.1)
    assert record.frequency == pytest.approx(1.0, rel=1e-3)
    assert (record.period is not None) == repeats
    assert record.transient == (pytest.approx(2.5, abs=0.5) if repeats else 0)


def test_a_record_of_one_and_a_half_periods_that_is_all_transient():
    time = np.arange(0, 1.5, 0.005)
    stroke = np.sin(2 * np.pi * time)
    force = 3 * stroke + 0.06 * np.random.default_rng(4).standard_normal(len(time))
    experiment = Experiment(name="a", kind="sine", time=time, inputs={"displacement": stroke}, transient=2.0)
    record = analyse(Measurement(experiment=experiment, outputs={"force": force}, units={}))
    assert record.period == pytest.approx(1.0, rel=1e-3)
    assert record.noise_sd["force"] == pytest.approx(0.06, rel=0.3)
