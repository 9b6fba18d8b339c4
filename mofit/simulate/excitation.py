"""Input signals of the virtual rig."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Excitation:
    """An input over uniform time [s], how it runs between samples, and its label."""

    time: Array
    values: Array
    hold: str
    frequency: float | None = None


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

    Parameters
    ----------
    kind
        Kind of the procedure.
    values
        What the plan gives for it, in SI units.
    lines
        Harmonics of a multisine.
    rng
        For the phases of a multisine.
    """
    amplitude, rate = values["amplitude"], values["sample_rate"]
    frequency = values.get("frequency")
    if kind == "quasi_static":
        duration = 4 * abs(amplitude) / values["ramp_rate"]
    else:
        duration = values["duration"] if "duration" in values else values["periods"] / values["frequency"]
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
