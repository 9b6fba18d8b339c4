"""Rates of measured inputs that a model does not read: what they are, and where none are known."""

from __future__ import annotations

import numpy as np
import pytest
import strangers
from scipy.signal import lsim

from mofit.data import Campaign, Experiment, Measurement
from mofit.diagnosis.baseline import baseline_in_wide_ranges
from mofit.diagnosis.hypothesis import Hypothesis
from mofit.diagnosis.input_rates import input_rates, rates_of_inputs
from mofit.diagnosis.integration import SimulatorCache
from mofit.identification.settings import Settings
from mofit.models import find_model

SIMULATORS = SimulatorCache()


def fitted(campaign: Campaign) -> Hypothesis:
    baseline, _ = baseline_in_wide_ranges(find_model("oscillator"), campaign, Settings(jobs=1), simulators=SIMULATORS)
    return baseline.hypothesis


def test_only_what_a_model_does_not_read_is_new() -> None:
    assert [one.name for one in input_rates(find_model("oscillator"))] == ["force_rate"]
    assert input_rates(find_model("kelvin_voigt_damper")) == ()


def test_the_rate_of_a_sine_is_a_cosine() -> None:
    hypothesis = fitted(strangers.oscillator(lambda x, v: 0.0))
    (channel,), tests = rates_of_inputs(hypothesis)
    assert (channel.unit, channel.derivative_of) == ("N/s", "force")
    for found, (amplitude, frequency, _) in zip(tests, strangers.PUSHES, strict=True):
        rate, omega = found["force_rate"], 2 * np.pi * frequency
        law = amplitude * omega * np.cos(omega * np.arange(-len(rate), 0) / strangers.RATE)
        inner = slice(len(rate) // 4, -len(rate) // 4)
        np.testing.assert_allclose(rate[inner], law[inner], atol=0.01 * amplitude * omega)


@pytest.mark.parametrize("smooth", [True, False])
def test_of_what_changes_from_sample_to_sample_none_is_known(smooth: bool) -> None:
    t, rng = np.arange(1000) / 100, np.random.default_rng(2)
    force = rng.standard_normal(len(t))
    if smooth:
        force = 5 * np.convolve(force, np.hanning(41) / 20, mode="same")
    _, x, _ = lsim(([1.0], [1.0, 4.0, 400.0]), force, t)
    experiment = Experiment("random", "free", t, {"force": force}, {})
    outputs = {"displacement": x + 1e-5 * rng.standard_normal(len(t))}
    measured = Measurement(experiment, outputs, {"force": "N", "displacement": "m"})
    channels, tests = rates_of_inputs(fitted(Campaign("random", "simulated", {}, (measured,))))
    assert [one.name for one in channels] == ["force_rate"] * smooth
    assert list(tests[0]) == ["force_rate"] * smooth
