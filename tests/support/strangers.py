"""Rigs with laws that no shipped effect has, integrated by SciPy: no simulation code of the package."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.integrate import solve_ivp

from mofit.data import Campaign, Experiment, Measurement

RATE = 100.0
STIFFNESS, DAMPING = 2000.0, 1500.0
#: amplitude (m), frequency (Hz), periods of the damper's sines
STROKES = ((0.02, 0.5, 4), (0.015, 1.0, 6), (0.02, 1.0, 6), (0.01, 2.0, 8), (0.02, 2.0, 8), (0.005, 4.0, 12))
#: further sines, which no fit sees
FRESH = ((0.018, 0.7, 4), (0.012, 1.5, 8), (0.016, 1.7, 8), (0.007, 3.0, 10))
#: amplitude (N), frequency (Hz), periods of the oscillator's sines; it has 1 kg, 400 N/m (3.2 Hz) and 4 N s/m
PUSHES = ((4.0, 1.0, 8), (8.0, 1.0, 8), (4.0, 2.0, 16), (8.0, 2.0, 16), (4.0, 3.2, 24), (8.0, 3.2, 24), (8.0, 5.0, 32))

Strokes = tuple[tuple[float, float, int], ...]
Law = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]


def damper(law: Law, noise: float = 2.0, seed: int = 1, unit: float = 1.0, strokes: Strokes = STROKES) -> Campaign:
    """Spring and damper, and a force that is a ``law`` of displacement, velocity and time; all in N times ``unit``."""
    rng, measured = np.random.default_rng(seed), []
    for amplitude, frequency, periods in strokes:
        t = np.arange(round(periods / frequency * RATE)) / RATE
        omega = 2 * np.pi * frequency
        x, v = amplitude * np.sin(omega * t), amplitude * omega * np.cos(omega * t)
        force = STIFFNESS * x + DAMPING * v + law(x, v, t) + noise * rng.standard_normal(len(t))
        inputs, name = {"displacement": x, "velocity": v}, f"{1e3 * amplitude:g} mm {frequency:g} Hz"
        experiment = Experiment(name, "sine", t, inputs, {}, frequency)
        units = {"displacement": "m", "velocity": "m/s", "force": "N"}
        measured.append(Measurement(experiment, {"force": unit * force}, units))
    return Campaign("damper", "simulated", {}, tuple(measured))


def beyond(values: np.ndarray, threshold: float) -> np.ndarray:
    """What exceeds a threshold on both sides, with its sign."""
    return np.asarray(np.sign(values) * np.maximum(np.abs(values) - threshold, 0))


def transduced(curve: Callable[[np.ndarray], np.ndarray]) -> Campaign:
    """The damper behind a transducer that shows a function of its force, in N."""
    return damper(lambda x, v, t: curve(STIFFNESS * x + DAMPING * v) - (STIFFNESS * x + DAMPING * v))


def memory(drive: Callable[[np.ndarray, np.ndarray], np.ndarray], time_constant: float) -> Law:
    """A force that follows a function of displacement and velocity with a time constant, from rest."""

    def law(x: np.ndarray, v: np.ndarray, t: np.ndarray) -> np.ndarray:
        fine = np.linspace(t[0], t[-1], 20 * len(t))
        driven = drive(np.interp(fine, t, x), np.interp(fine, t, v))
        found = solve_ivp(
            lambda now, w: (np.interp(now, fine, driven) - w) / time_constant,
            (t[0], t[-1]), [0.0], t_eval=t, max_step=0.005, rtol=1e-7, atol=1e-6,
        )  # fmt: skip
        return np.asarray(found.y[0])

    return law


def oscillator(law: Callable[[float, float], float], noise: float = 2e-5, seed: int = 1) -> Campaign:
    """A mass of 1 kg on a spring of 400 N/m and a damper of 4 N s/m, with a force that is a law of x and its rate."""
    rng, measured = np.random.default_rng(seed), []
    for amplitude, frequency, periods in PUSHES:
        t = np.arange(round(periods / frequency * RATE)) / RATE
        omega = 2 * np.pi * frequency
        found = solve_ivp(
            lambda now, s, a=amplitude, w=omega: (
                s[1],
                a * np.sin(w * now) - 400 * s[0] - 4 * s[1] - law(s[0], s[1]),
            ),
            (t[0], t[-1]), [0.0, 0.0], t_eval=t, rtol=1e-8, atol=1e-10,
        )  # fmt: skip
        name = f"{amplitude:g} N {frequency:g} Hz"
        experiment = Experiment(name, "sine", t, {"force": amplitude * np.sin(omega * t)}, {}, frequency)
        displacement = found.y[0] + noise * rng.standard_normal(len(t))
        measured.append(Measurement(experiment, {"displacement": displacement}, {"force": "N", "displacement": "m"}))
    return Campaign("oscillator", "simulated", {}, tuple(measured))


def random_walk(size: float, seed: int = 3) -> Law:
    """A gain that walks at random, of its own in every test: no function of the inputs."""
    rng = np.random.default_rng(seed)

    def law(x: np.ndarray, v: np.ndarray, t: np.ndarray) -> np.ndarray:
        walk = np.cumsum(rng.standard_normal(len(t))) / np.sqrt(RATE)
        return size * walk * (STIFFNESS * x + DAMPING * v)

    return law


DAMPERS: dict[str, Law] = {
    "root stiffness": lambda x, v, t: 3e5 * x * np.abs(x) ** 0.5,
    "bump stop": lambda x, v, t: 2e4 * np.maximum(x - 0.012, 0),
    "memory of speed": memory(lambda x, v: 400 * np.abs(v), 0.15),
    "thixotropic damping": lambda x, v, t: -600 * v * memory(lambda x, v: np.abs(v) / 0.1, 0.3)(x, v, t),
    "damping grows with stroke": lambda x, v, t: 3e6 * x**2 * v,
    "fifth power": lambda x, v, t: 3e10 * x**5,
    "stops on both sides": lambda x, v, t: 4e4 * beyond(x, 0.013),
}
#: laws that are none of the forms which are tried
OTHER_DAMPERS: dict[str, Law] = {
    "sinh spring": lambda x, v, t: 50 * np.sinh(x / 0.005),
    "air spring": lambda x, v, t: 400 * ((1 - x / 0.03) ** -1.4 - 1),
    "orifices": lambda x, v, t: np.where(v > 0, 3000 * v**2, -800 * v**2),
    "damping grows exponentially": lambda x, v, t: 80 * v * np.exp(x / 0.01),
    "Stribeck friction": lambda x, v, t: (20 + 40 * np.exp(-((v / 0.05) ** 2))) * np.tanh(v / 1e-3),
    "oil that warms up": lambda x, v, t: -400 * v * memory(lambda x, v: (v / 0.1) ** 2, 1.5)(x, v, t),
    "relaxing spring": memory(lambda x, v: 3e3 * x + 4e5 * x * np.abs(x), 0.2),
}
OSCILLATORS: dict[str, Callable[[float, float], float]] = {
    "van der Pol": lambda x, v: 2e4 * x**2 * v,
    "stop": lambda x, v: 600 * max(x - 0.02, 0.0),
    "root stiffness": lambda x, v: 600 * x * abs(x) ** 0.5,
}
