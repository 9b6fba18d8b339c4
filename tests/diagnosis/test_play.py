"""A play that a rate passes too: its slope at size zero says nothing of it."""

import re

import numpy as np
import pytest

from mofit.data import Campaign, Experiment, Measurement
from mofit.diagnosis.diagnose import diagnose
from mofit.identification.settings import Settings

#: samples of a record, points per sample, and the sampling interval [s]
COUNT, FINE, STEP = 1000, 20, 0.01
#: the shipped plays, a law that a play is easily taken for, and one that has nothing to do with it
CANDIDATES = ("backlash", "graded_play", "quadratic_damping", "cubic_stiffness")
WIDTH = 2.5e-4


def played(u: np.ndarray, half: float) -> np.ndarray:
    """The play operator, from the first value."""
    found, now = np.empty_like(u), u[0]
    for k, value in enumerate(u):
        found[k] = now = max(value - half, min(now, value + half))
    return found


def chirp(amplitude: float, widths: tuple[float, ...], rng: np.random.Generator) -> Measurement:
    """A damper of 20 N/mm and 800 N s/m behind plays of these half widths, with noise of 1 % of the force."""
    time = np.arange(COUNT * FINE) * STEP / FINE
    u = amplitude * np.sin(2 * np.pi * (0.5 * time + 0.2 * time**2))
    x = np.mean([played(u, half) for half in widths], axis=0)
    force = (2e4 * x + 800 * np.gradient(x, time))[::FINE]
    force += 0.01 * np.ptp(force) * rng.standard_normal(COUNT)
    channels = {"displacement": u[::FINE], "velocity": np.gradient(u, time)[::FINE]}
    return Measurement(
        Experiment(f"chirp {amplitude:g}", "chirp", time[::FINE], channels),
        {"force": force},
        {"displacement": "m", "velocity": "m/s", "force": "N"},
    )


@pytest.mark.parametrize(
    ("name", "widths"),
    [
        ("backlash", (WIDTH,)),
        pytest.param("graded_play", (0.25 * WIDTH, 0.7 * WIDTH, WIDTH, 2 * WIDTH), marks=pytest.mark.slow),
    ],
)
def test_a_play_is_named_and_no_damping_in_its_place(name: str, widths: tuple[float, ...]) -> None:
    rng = np.random.default_rng(5)
    rig = Campaign("play", "simulated", {}, tuple(chirp(amplitude, widths, rng) for amplitude in (3e-3, 5e-3, 8e-3)))
    found = diagnose(rig, "kelvin_voigt_damper", CANDIDATES, Settings(jobs=1))
    assert found.conclusion.verdict in ("effect", "partly")
    assert [one.name for one in found.attribution.best.fitted.hypothesis.effects] == [name]
    half = found.attribution.best.fitted.values["b_0" if name == "backlash" else "b_g"]
    assert half == pytest.approx(np.mean(widths), rel=0.1)
    told = next(one for one in found.warnings if "do not repeat" in one)
    floors = re.findall(r"\d[\d.]*", told.split(":")[1].split("%")[0])
    assert [float(one) for one in floors] == pytest.approx([1.0, 1.0], rel=0.2)
