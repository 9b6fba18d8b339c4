"""A rig with two outputs of other units and noise: linear, so that its posterior is known."""

from pathlib import Path

import numpy as np

from mofit.data import Campaign, Experiment, Measurement, write_campaign

TRUTH = {"a": 40.0, "b": 0.3}
#: standard deviation of the noise: 1 N on a force of some 100 N, 2e-4 m/s^2 on an acceleration of some 1 m/s^2
NOISE = {"force": 1.0, "acceleration": 2e-4}
UNITS = {"left": "m", "right": "m", "force": "N", "acceleration": "m/s^2"}

MODEL = """
from mofit.models import Channel, Equations, Model
from mofit.parameters import Parameter


class Beam(Model):
    name = "beam"
    parameters = (
        Parameter("a", "N/m", 1.0, 100.0, 10.0, description="stiffness"),
        Parameter("b", "1/s^2", 0.01, 1.0, 0.1, description="gain"),
    )
    inputs = (Channel("left", "m"), Channel("right", "m"))
    outputs = (Channel("force", "N"), Channel("acceleration", "m/s^2"))

    def equations(self, s):
        force = s.a * s.left + 100 * s.b * s.right
        return Equations(outputs={"force": force, "acceleration": 0.02 * s.a * s.left - s.b * s.right})
"""


def rows(test: Measurement) -> dict[str, np.ndarray]:
    """Derivatives of every measured output by a and b, (n, 2)."""
    left, right = (test.experiment.inputs[name] for name in ("left", "right"))
    whole = {
        "force": np.stack([left, 100 * right], axis=1),
        "acceleration": np.stack([0.02 * left, -right], axis=1),
    }
    return {name: whole[name] for name in test.outputs}


def campaign(lacking: dict[str, str] | None = None, frequencies=(0.5, 1.0, 2.0, 4.0), seed=0) -> Campaign:
    """Sines of both inputs, out of phase; ``lacking`` names the output that a test does not have."""
    rng, tests = np.random.default_rng(seed), []
    for frequency in frequencies:
        name, time = f"{frequency:g} Hz", np.arange(0, 20 / frequency, 0.05 / frequency)
        angle = 2 * np.pi * frequency * time
        inputs = {"left": np.sin(angle), "right": np.cos(angle + frequency)}
        outputs = {c: np.zeros(len(time)) for c in NOISE if c != (lacking or {}).get(name)}
        test = Measurement(Experiment(name, "sine", time, inputs, {}, frequency, 1.0), outputs, UNITS)
        values = {
            channel: columns @ [TRUTH["a"], TRUTH["b"]] + NOISE[channel] * rng.normal(size=len(time))
            for channel, columns in rows(test).items()
        }
        tests.append(Measurement(test.experiment, values, {c: UNITS[c] for c in (*inputs, *values)}))
    return Campaign("beam", "simulated", {}, tuple(tests))


def weighted_least_squares(tests: Campaign, used) -> tuple[np.ndarray, np.ndarray]:
    """Mean (2,) and covariance (2, 2) of the posterior of a and b; ``used`` says which samples of a test count."""
    precision, slope = np.zeros((2, 2)), np.zeros(2)
    for test in tests.measurements:
        for channel, columns in rows(test).items():
            own, values = columns[used(test)], test.outputs[channel][used(test)]
            precision += own.T @ own / NOISE[channel] ** 2
            slope += own.T @ values / NOISE[channel] ** 2
    covariance = np.linalg.inv(precision)
    return covariance @ slope, covariance


def write_rig(folder: Path, **options) -> tuple[Path, str]:
    """Campaign file and model reference in a folder."""
    write_campaign(campaign(**options), folder / "beam.nc")
    (folder / "beam.py").write_text(MODEL)
    return folder / "beam.nc", f"{folder / 'beam.py'}:Beam"
