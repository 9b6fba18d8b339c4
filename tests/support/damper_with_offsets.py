"""A damper whose transducer has another zero in every test: closed forms, with dry friction (Dahl) or without."""

from __future__ import annotations

import numpy as np

from mofit.data import Campaign, Experiment, Measurement

STROKES = ((0.02, 0.5, 4), (0.02, 1.0, 6), (0.01, 2.0, 8), (0.005, 4.0, 12))
STIFFNESS, DAMPING, YIELD, RATE, NOISE = 2000.0, 1500.0, 2e-3, 100.0, 2.0
#: points per sample at which the friction is followed
_FINE = 50


def damper_with_offsets(friction: float = 0.0, offsets: float = 20.0, seed: int = 1) -> Campaign:
    """Four sines; ``friction`` and the standard deviation of the ``offsets`` in N."""
    rng, tests = np.random.default_rng(seed), []
    for amplitude, frequency, periods in STROKES:
        time = np.arange(round(periods / frequency * RATE)) / RATE
        turn = 2 * np.pi * frequency * time
        stroke = amplitude * np.sin(turn)
        force = STIFFNESS * stroke + DAMPING * amplitude * 2 * np.pi * frequency * np.cos(turn)
        force += friction * _dahl(amplitude, frequency, len(time))
        force += offsets * rng.standard_normal() + NOISE * rng.standard_normal(len(time))
        experiment = Experiment(f"{frequency:g} Hz", "sine", time, {"displacement": stroke}, {}, frequency, amplitude)
        tests.append(Measurement(experiment, {"force": force}, {"displacement": "m", "force": "N"}))
    return Campaign("damper with offsets", "simulated", {}, tuple(tests))


def _dahl(amplitude: float, frequency: float, samples: int) -> np.ndarray:
    """Dahl's friction, 1 at the most: exact between turning points."""
    time = np.arange(samples * _FINE) / (RATE * _FINE)
    moves = np.diff(amplitude * np.sin(2 * np.pi * frequency * time))
    state, found = 0.0, np.zeros(len(time))
    for k, move in enumerate(moves):
        end = np.sign(move)
        state = end + (state - end) * np.exp(-abs(move) / YIELD)
        found[k + 1] = state
    return found[::_FINE]
