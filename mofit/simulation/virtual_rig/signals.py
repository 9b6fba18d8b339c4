"""Signals of the virtual rig: excitations and measurement noise."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from mofit._typing import FloatArray


@dataclass(frozen=True)
class Excitation:
    """An input over uniform time [s], how it runs between samples, and its label."""

    time: FloatArray
    values: FloatArray
    interpolation: str
    frequency: float | None = None


def sample_count(kind: str, values: Mapping[str, float]) -> float:
    """Samples of a test of these settings, which may be more than any memory holds."""
    return _duration(kind, values) * values["sample_rate"]


def excitation(
    kind: str, values: Mapping[str, float], lines: tuple[int, ...] | None, rng: np.random.Generator
) -> Excitation:
    r"""The input signal of a test.

    With amplitude :math:`A`, frequency :math:`f` [Hz], ramp rate :math:`r` [unit/s]:

    - ``step``: 0 until ``delay``, then a ramp at :math:`r` to :math:`A`, held to ``duration``;
    - ``quasi_static``: a path at the constant speed :math:`r`: :math:`0 \to A \to -A \to 0`;
    - ``sine``: :math:`A \sin 2 \pi f t`;
    - ``chirp``: :math:`A \sin`, its frequency growing exponentially from :math:`f` to ``last_frequency``;
    - ``multisine``: equal cosines with random phases at the multiples ``lines`` of :math:`f`, peak :math:`A`.

    ``values`` are the plan's settings in SI units; ``rng`` draws the phases of a multisine.
    """
    amplitude, rate = values["amplitude"], values["sample_rate"]
    frequency = values.get("frequency")
    duration = _duration(kind, values)
    time = np.arange(max(round(duration * rate), 2) + (kind == "quasi_static")) / rate
    if kind == "step":
        travel = np.clip((time - values.get("delay", 0.0)) * values["ramp_rate"], 0, abs(amplitude))
        return Excitation(time, np.sign(amplitude) * travel, "linear")
    if kind == "quasi_static":
        corners = np.array([0, 1, 3, 4]) * duration / 4
        return Excitation(time, amplitude * np.interp(time, corners, [0.0, 1.0, -1.0, 0.0]), "linear")
    if kind == "chirp":
        growth = np.log(values["last_frequency"] / values["frequency"]) / duration
        phase = 2 * np.pi * values["frequency"] * np.expm1(growth * time) / growth
        return Excitation(time, amplitude * np.sin(phase), "cubic")
    omega = 2 * np.pi * values["frequency"]
    if kind == "multisine":
        orders = np.array(lines, dtype=float)
        phases = rng.uniform(0, 2 * np.pi, len(orders))
        signal = np.cos(omega * orders * time[:, None] + phases).sum(axis=1)
        return Excitation(time, amplitude * signal / np.max(np.abs(signal)), "cubic", frequency)
    return Excitation(time, amplitude * np.sin(omega * time), "cubic", frequency)


def _duration(kind: str, values: Mapping[str, float]) -> float:
    """How long a test takes [s]."""
    if kind == "quasi_static":
        return 4 * abs(values["amplitude"]) / values["ramp_rate"]
    return values["duration"] if "duration" in values else values["periods"] / values["frequency"]


def noise(
    signal: FloatArray,
    rng: np.random.Generator,
    *,
    sd: float = 0.0,
    fraction: float = 0.0,
    level: float = 0.0,
    coloured_sd: float = 0.0,
    coefficient: float = 0.9,
) -> FloatArray:
    r"""Noise to be added to ``signal`` (n,), in its unit; independent Gaussian parts.

    .. math::
        e_k = \left(s + f R + l |y_k|\right) n_k + s_c a_k, \qquad
        a_k = \phi a_{k-1} + \sqrt{1 - \phi^2} \, m_k

    with white :math:`n, m` of unit variance, the peak-to-peak range :math:`R`, and :math:`a` stationary, so that
    ``coloured_sd`` :math:`s_c` is the standard deviation of its part.
    """
    white, driving = rng.standard_normal((2, len(signal)))
    driving[1:] *= np.sqrt(1 - coefficient**2)
    coloured = lfilter([1.0], [1.0, -coefficient], driving)
    return np.asarray((sd + fraction * np.ptp(signal) + level * np.abs(signal)) * white + coloured_sd * coloured)
