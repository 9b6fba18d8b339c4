"""A rig of which everything is known: a force that is linear in slope, offset and lever, with white noise."""

import numpy as np

from mofit.data import Campaign, Experiment, Measurement
from mofit.models import Channel, Equations, Model
from mofit.parameters import Parameter

TRUTH = {"k": 2.0, "b": 0.5}
NOISE = 0.3
UNITS = {"displacement": "m", "force": "N"}


class StraightLine(Model):
    """F = k x + b."""

    name = "straight_line"
    parameters = (Parameter("k", "N/m", -10.0, 10.0, 1.0), Parameter("b", "N", -10.0, 10.0, 0.0))
    inputs = (Channel("displacement", "m"),)
    outputs = (Channel("force", "N"),)

    def equations(self, s):
        """No state."""
        return Equations(outputs={"force": s.k * s.displacement + s.b})


class Leaning(Model):
    """F = k x + b + c z, with b per test and c per load."""

    name = "leaning"
    parameters = (
        Parameter("k", "N/m", -10.0, 10.0, 1.0),
        Parameter("b", "N", -10.0, 10.0, 0.25, per="test"),
        Parameter("c", "N/m", -10.0, 10.0, 0.0, per="load"),
    )
    inputs = (Channel("displacement", "m"), Channel("lever", "m"))
    outputs = (Channel("force", "N"),)

    def equations(self, s):
        """No state."""
        return Equations(outputs={"force": s.k * s.displacement + s.b + s.c * s.lever})


def sine_test(name="sine", *, periods=20, samples=50, size=1.0, seed=0, noise=NOISE) -> Measurement:
    """A sine of 1 Hz through the straight line; of size 0 the noise would be all."""
    time = np.arange(periods * samples) / samples
    x = size * np.sin(2 * np.pi * time)
    force = TRUTH["k"] * x + TRUTH["b"] + noise * np.random.default_rng(seed).normal(size=len(time))
    return Measurement(Experiment(name, "sine", time, {"displacement": x}, {}, 1.0, size), {"force": force}, UNITS)


def leaning_test(name: str, load: float, b: float, c: float, seed=0, k=2.0, noise=NOISE) -> Measurement:
    """A sine of the displacement under a slower one of the lever."""
    time = np.arange(1000) / 50
    inputs = {"displacement": np.sin(2 * np.pi * time), "lever": np.sin(np.pi * time + 0.3)}
    force = k * inputs["displacement"] + b + c * inputs["lever"]
    force = force + noise * np.random.default_rng(seed).normal(size=len(time))
    experiment = Experiment(name, "free", time, inputs, {"load": load})
    return Measurement(experiment, {"force": force}, {**UNITS, "lever": "m"})


def campaign(*tests: Measurement, title="line") -> Campaign:
    """Of these tests."""
    return Campaign(title, "simulated", {}, tests)


def unmeasured(test: Measurement) -> Measurement:
    """The test without its output."""
    units = {name: unit for name, unit in test.units.items() if name != "force"}
    return Measurement(test.experiment, {}, units)
