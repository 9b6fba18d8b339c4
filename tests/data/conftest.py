"""Campaigns that the tests of this folder share."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import rig_files

from mofit.data import Campaign, Experiment, Measurement
from mofit.data.importers.contained import Contained, ContainedLimits


def sine_test(name: str = "sine_1Hz", frequency: float = 1.0, label: float | None = None, noise: float = 0.01,
              periods: float = 6.0, rate: float = 100.0, seed: int = 0) -> Measurement:  # fmt: skip
    time = np.arange(round(periods / frequency * rate)) / rate
    phase = 2 * np.pi * frequency * time
    force = 100 * np.sin(phase + 0.4) + 8 * np.sin(3 * phase)
    force += noise * 100 * np.random.default_rng(seed).standard_normal(len(time))
    experiment = Experiment(
        name, "sine", time, {"slip_angle": 0.02 * np.sin(phase)}, frequency=label or frequency, amplitude=0.02
    )
    return Measurement(experiment, {"lateral_force": force}, {"slip_angle": "rad", "lateral_force": "N"})


@pytest.fixture
def make_test() -> Callable[..., Measurement]:
    return sine_test


@pytest.fixture
def campaign() -> Campaign:
    conditions = {"vertical_force": 3000.0, "longitudinal_velocity": 2.0, "dynamic_rolling_radius": 0.3}
    tests = (sine_test(), sine_test("sine_2Hz", 2.0, seed=1))
    return Campaign("A tyre", "simulated", conditions, tests, {"note": "made for tests"})


@pytest.fixture(params=list(rig_files.WRITERS))
def format(request):
    """Every format that files are imported from, by its name in `rig_files`."""
    if package := rig_files.PACKAGES.get(request.param):
        pytest.importorskip(package, reason=f"{package}, which an extra installs, is not here")
    return request.param


@pytest.fixture(scope="session")
def reader():
    """One process for all files that a library parses."""
    with Contained(ContainedLimits(seconds=20)) as contained:
        yield contained
