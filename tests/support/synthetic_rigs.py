"""Rigs with a known answer: a tyre, a damper, an oscillator, and a model with as many parameters as wanted."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Trial:
    """One test of a synthetic campaign."""

    name: str
    kind: str
    frequency: float
    amplitude: float
    time: np.ndarray
    input: np.ndarray


@dataclass(frozen=True)
class Rig:
    """A campaign, a model and what is known of the answer."""

    title: str
    input: tuple[str, str]
    output: tuple[str, str]
    trials: tuple[Trial, ...]
    names: tuple[str, ...]
    units: tuple[str, ...]
    scales: tuple[str, ...]
    lower: np.ndarray
    upper: np.ndarray
    truth: np.ndarray
    response: Callable[[Trial, np.ndarray], np.ndarray]
    baseline: tuple[tuple[str, ...], Callable[[Trial], np.ndarray]] | None = None


def maxwell_gain(frequency: float, d: float, c_m: float, d_m: float) -> complex:
    """Dynamic stiffness of a spring with a damper and a Maxwell branch beside it."""
    s = 2j * np.pi * frequency
    return 1.2e5 + s * d + c_m * s * d_m / (c_m + s * d_m)


def _sine(name: str, frequency: float, amplitude: float, periods: float = 6.0, rate: float = 100.0) -> Trial:
    time = np.arange(0.0, periods / frequency, 1.0 / rate)
    return Trial(name, "sine", frequency, amplitude, time, amplitude * np.sin(2 * np.pi * frequency * time))


def tyre() -> Rig:
    """Three steps, one quasi-static test and nine sines."""
    degree = np.pi / 180
    trials = []
    for angle in (1, 2, 4):
        time = np.arange(0.0, 4.0, 0.01)
        trials.append(Trial(f"step_{angle}deg", "step", np.nan, angle * degree, time, angle * degree * (time > 0.5)))
    time = np.arange(0.0, 20.0, 0.01)
    trials.append(Trial("quasi_static", "quasi_static", np.nan, 0.02, time, 0.02 * np.sin(2 * np.pi * time / 20)))
    trials += [_sine(f"sine_{f:g}Hz", f, 2 * degree) for f in (0.25, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0)]

    def response(trial: Trial, p: np.ndarray) -> np.ndarray:
        if trial.kind == "step":
            rise = np.clip(trial.time - 0.5, 0, None)
            return 6e4 * np.tanh(trial.amplitude * 20) / 20 * (1 - np.exp(-rise * 6e4 / (p[1] + p[0])))
        if trial.kind == "quasi_static":
            return 1.2e5 * trial.input * (1 - 7.5 * np.abs(trial.input))
        gain = maxwell_gain(trial.frequency, *p) * 0.5 / (1 + 0.25j * trial.frequency)
        return np.imag(trial.amplitude * gain * np.exp(2j * np.pi * trial.frequency * trial.time))

    return Rig(
        "Synthetic tyre", ("slip_angle", "rad"), ("lateral_force", "N"), tuple(trials),
        ("d_y", "c_M", "d_M"), ("N s/m", "N/m", "N s/m"), ("log", "log", "log"),
        np.array([50.0, 1e3, 5e2]), np.array([2e3, 1e5, 1e5]), np.array([281.0, 19_910.0, 7_535.0]), response,
        (("d_y",), lambda trial: response(trial, np.array([332.0, 1.0, 1.0]))),
    )  # fmt: skip


def damper() -> Rig:
    """Six sine strokes."""
    strokes = ((0.1, 0.025), (0.25, 0.025), (0.5, 0.025), (1.0, 0.010), (3.0, 0.005), (5.0, 0.002))
    trials = tuple(_sine(f"{1e3 * a:g}mm_{f:g}Hz", f, a, rate=max(50.0, 100 * f)) for f, a in strokes)

    def response(trial: Trial, p: np.ndarray) -> np.ndarray:
        speed = 2 * np.pi * trial.frequency * trial.amplitude * np.cos(2 * np.pi * trial.frequency * trial.time)
        return p[0] * trial.input + p[1] * np.tanh(speed / p[2]) + p[3] * speed

    return Rig(
        "Synthetic damper", ("displacement", "m"), ("force", "N"), trials,
        ("c", "F_0", "v_0", "d"), ("N/m", "N", "m/s", "N s/m"), ("linear", "linear", "log", "linear"),
        np.array([0.0, 0.0, 1e-4, 0.0]), np.array([5e3, 200.0, 1.0, 2e3]), np.array([900.0, 60.0, 0.01, 500.0]),
        response,
        (("c", "d"), lambda trial: response(trial, np.array([900.0, 0.0, 1.0, 1200.0]))),
    )  # fmt: skip


def oscillator() -> Rig:
    """Two multisines of 8192 samples without a frequency."""
    trials = []
    for k in range(2):
        rng = np.random.default_rng(k)
        time = np.arange(8192) / 610.35
        spectrum = np.zeros(4097, complex)
        spectrum[1:1342:2] = np.exp(2j * np.pi * rng.uniform(size=671))
        trials.append(Trial(f"multisine_{k + 1}", "multisine", np.nan, np.nan, time, np.fft.irfft(spectrum) * 50))

    def response(trial: Trial, p: np.ndarray) -> np.ndarray:
        s = 2j * np.pi * np.fft.rfftfreq(8192, 1 / 610.35)
        return np.fft.irfft(np.fft.rfft(trial.input) * p[2] / (s**2 / p[0] ** 2 + 2 * p[1] * s / p[0] + 1), 8192)

    return Rig(
        "Synthetic oscillator", ("voltage", "V"), ("response", "V"), tuple(trials),
        ("omega", "damping", "gain"), ("rad/s", "1", "1"), ("linear", "log", "linear"),
        np.array([100.0, 1e-3, 0.1]), np.array([1e3, 1.0, 10.0]), np.array([430.0, 0.05, 1.0]), response,
    )  # fmt: skip


def crowded(parameters: int = 10) -> Rig:
    """The damper's tests with many parameters (those past the fourth do nothing), or with the first few only."""
    base = damper()
    extra = parameters - 4

    def response(trial: Trial, p: np.ndarray) -> np.ndarray:
        return base.response(trial, np.concatenate([p, base.truth[len(p) :]])[:4])

    if extra <= 0:
        keep = slice(0, parameters)
        more: tuple[str, ...] = ()
    else:
        keep, more = slice(None), tuple(f"extra_{k}" for k in range(extra))
    return Rig(
        "Synthetic crowd", base.input, base.output, base.trials,
        base.names[keep] + more, base.units[keep] + ("1",) * len(more), base.scales[keep] + ("linear",) * len(more),
        np.concatenate([base.lower[keep], np.zeros(len(more))]), np.concatenate([base.upper[keep], np.ones(len(more))]),
        np.concatenate([base.truth[keep], np.full(len(more), 0.5)]), response, base.baseline,
    )  # fmt: skip
