"""The baseline is found from the best points of a sample, and by a search where the descents from there disagree."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from mofit.data import Campaign, Experiment, Measurement
from mofit.diagnosis.baseline import baseline_in_wide_ranges
from mofit.identification.settings import Settings
from mofit.models import Channel, Equations, Model
from mofit.parameters import Parameter


class Fringes(Model):
    """Force a sin(w x): over w one deep valley, and a shallow one beside the other."""

    name = "fringes"
    parameters = (Parameter("a", "N", 0.0, 2.0, 1.0), Parameter("w", "1/m", 1.0, 2000.0, 10.0))
    inputs = (Channel("displacement", "m"),)
    outputs = (Channel("force", "N"),)

    def equations(self, s):
        return Equations(outputs={"force": s.a * ca.sin(s.w * s.displacement)})


def test_a_minimum_that_the_sample_misses_is_searched() -> None:
    """All descents from the sample end in different minima, the best far above the noise."""
    w = 970.0
    rng, time = np.random.default_rng(0), np.arange(1000) / 100
    measurements = []
    for k, frequency in enumerate((0.5, 1.0)):
        x = np.sin(2 * np.pi * frequency * time)
        force = 1.5 * np.sin(w * x) + 0.01 * rng.standard_normal(len(x))
        experiment = Experiment(f"sine {k}", "sine", time, {"displacement": x}, {}, frequency=frequency)
        measurements.append(Measurement(experiment, {"force": force}, {"displacement": "m", "force": "N"}))
    campaign = Campaign("fringes", "simulated", {}, tuple(measurements))
    found, _ = baseline_in_wide_ranges(Fringes(), campaign, Settings(jobs=1, evaluations=2000))
    assert found.values["w"] == pytest.approx(w, rel=1e-3)
    assert found.values["a"] == pytest.approx(1.5, rel=1e-2)
