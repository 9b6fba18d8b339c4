"""A small rig for end-to-end tests: a lag with gain, its exact response, and its model as a user would write it."""

from pathlib import Path

import numpy as np

from mofit.data import Campaign, Experiment, Measurement, write_campaign

TRUTH = {"k": 2.0, "T": 0.15}

MODEL = """
from mofit.models import Channel, Equations, Model
from mofit.parameters import Parameter


class Lag(Model):
    name = "lag"
    parameters = (
        Parameter("k", "N/rad", 0.5, 4.0, 1.0, description="gain"),
        Parameter("T", "s", 0.01, 1.0, 0.1, "log", "time constant"),
    )
    states = (Channel("y", "N"),)
    inputs = (Channel("slip_angle", "rad"),)
    outputs = (Channel("lateral_force", "N"),)

    def equations(self, s):
        return Equations(outputs={"lateral_force": s.y}, derivatives={"y": (s.k * s.slip_angle - s.y) / s.T})
"""


def response(time, frequency, gain=None):
    w, lag = 2 * np.pi * frequency, TRUTH["T"]
    phase = -np.arctan(w * lag)
    amplitude = (TRUTH["k"] if gain is None else gain) / np.hypot(1, w * lag)
    return amplitude * (np.sin(w * time + phase) - np.sin(phase) * np.exp(-time / lag))


def campaign(noise=0.01, frequencies=(0.5, 1.0, 2.0), seed=0, gain=None, conditions=None):
    rng = np.random.default_rng(seed)
    tests = []
    for frequency in frequencies:
        time = np.arange(0, 8 / frequency, 0.01)
        experiment = Experiment(
            f"sine_{frequency:g}Hz",
            "sine",
            time,
            {"slip_angle": np.sin(2 * np.pi * frequency * time)},
            {},
            frequency,
            1.0,
        )
        force = response(time, frequency, gain) + noise * rng.normal(size=len(time))
        tests.append(Measurement(experiment, {"lateral_force": force}, {"slip_angle": "rad", "lateral_force": "N"}))
    return Campaign("lag rig", "simulated", conditions or {}, tuple(tests))


def write_rig(folder: Path) -> tuple[Path, str]:
    """Campaign file and model reference in a folder."""
    write_campaign(campaign(), folder / "rig.nc")
    return folder / "rig.nc", write_model(folder)


def write_model(folder: Path) -> str:
    """Model file in a folder; its reference."""
    (folder / "lag.py").write_text(MODEL)
    return f"{folder / 'lag.py'}:Lag"
