"""How the output of a sine test answers its input: amplitude ratio and phase at the fundamental."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mofit._typing import FloatArray
from mofit.data.campaign import Measurement
from mofit.data.likely_causes import FAR_OFF
from mofit.data.signals import SignalAnalysis, steady_samples

#: share of the output's variance at the fundamental below which its phase means little
CLEAR = 0.5


@dataclass(frozen=True)
class Response:
    """One output of a sine test over one input."""

    test: str
    output: str
    input: str
    frequency: float
    """True frequency, in Hz."""
    amplitude: float
    """Of the input, in its SI unit."""
    gain: float
    """Amplitude of the output over that of the input, in SI units."""
    phase: float
    """By which the output leads, in radians, from -π to π."""

    @property
    def words(self) -> str:
        """The phase as a message tells it."""
        degrees = round(np.degrees(self.phase))
        return f"{'leads' if degrees >= 0 else 'lags'} '{self.input}' by {abs(degrees)}°"


def responses(measurements: Sequence[Measurement], analyses: Mapping[str, SignalAnalysis]) -> list[Response]:
    """Of every output of every sine test that has one clear period, over its first input."""
    return [
        found
        for measurement in measurements
        if measurement.kind == "sine" and measurement.experiment.inputs
        for found in _of_test(measurement, analyses[measurement.name])
    ]


def _of_test(measurement: Measurement, analysis: SignalAnalysis) -> list[Response]:
    time, label = measurement.time, measurement.experiment.frequency
    if analysis.period is None or analysis.periods < 1:
        return []
    if label and abs(label * analysis.period - 1) > FAR_OFF:
        return []  # aliasing turns the phase round
    kept = np.flatnonzero(steady_samples(time, analysis.transient, analysis.tail))
    # whole periods, so that the mean and the harmonics do not leak into the fundamental
    kept = kept[: round(analysis.periods * analysis.period / measurement.experiment.step)]
    turn = np.exp(-2j * np.pi * time[kept] / analysis.period)
    name, driver = next(iter(measurement.experiment.inputs.items()))
    x, share = _fundamental(driver[kept], turn)
    if share < CLEAR:
        return []
    found = []
    for output, values in measurement.outputs.items():
        y, share = _fundamental(values[kept], turn)
        if share >= CLEAR:
            gain, phase = float(abs(y / x)), float(np.angle(y / x))
            found.append(Response(measurement.name, output, name, 1 / analysis.period, float(abs(x)), gain, phase))
    return found


def _fundamental(values: FloatArray, turn: FloatArray) -> tuple[complex, float]:
    """Complex amplitude, and its share of the variance."""
    # of the size 1, so that squares neither overflow nor vanish
    size = float(np.max(np.abs(values))) or 1.0
    moved = (values - values.mean()) / size
    amplitude = 2 * complex(np.mean(moved * turn))
    variance = float(np.var(moved))
    return amplitude * size, 0.5 * abs(amplitude) ** 2 / variance if variance > 0 else 0.0
