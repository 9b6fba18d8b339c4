"""The design space where none is given: tests within what the known tests demonstrate of the rig."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mofit.data import Experiment
from mofit.design.candidate_space import CandidateGrid, Limits, Space
from mofit.design.candidates import demonstrated_limits, required_limits
from mofit.models import Channel

#: Display unit and factor from SI for what a rig drives; others stay in SI.
_SHOWN = {"rad": ("deg", 180 / math.pi), "m": ("mm", 1e3)}


@dataclass(frozen=True)
class DefaultSpaceSettings:
    """Grids of the space."""

    beyond: float = 2.5
    """Frequencies reach so far beyond the known ones, each way: a model is rarely trusted further."""
    frequencies: int = 15
    """Sine frequencies: neighbours differ by less than a parameter's optimum is wide."""
    amplitudes: tuple[float, ...] = (0.25, 0.5, 1.0)
    durations: tuple[float, ...] = (0.25, 0.5, 1.0)
    """Shares of the largest amplitude, and of the time there is."""
    periods: int = 3
    """Periods that a sine or multisine must have room for: one is transient, two are used."""
    samples_per_period: int = 20
    """At the highest frequency, so that the interpolated input is still a sine."""
    unknown: tuple[float, float] = (0.1, 10.0)
    """Frequencies where the known tests have none [Hz]."""


SETTINGS = DefaultSpaceSettings()


def default_space(
    experiments: Sequence[Experiment],
    driven: Channel,
    kinds: Collection[str],
    budget: float,
    overhead: float,
    *,
    measured: bool = False,
) -> Space:
    """Tests of some kinds (sine, multisine, chirp, step) within what known tests demonstrate of the rig.

    Parameters
    ----------
    experiments, driven
        The known tests that excite the driven input, and that input.
    kinds
        Kinds of tests to offer.
    budget, overhead
        Time there is, and time per test beside its duration [s].
    measured
        Whether the inputs are measured, hence noisy.
    """
    limits = demonstrated_limits([required_limits(experiment, driven.name, measured) for experiment in experiments])
    frequencies = [experiment.frequency for experiment in experiments if experiment.frequency] or SETTINGS.unknown
    time = max(budget - overhead, 1e-3)
    low = max(min(frequencies) / SETTINGS.beyond, SETTINGS.periods / time)
    high = min(max(frequencies) * SETTINGS.beyond, limits.sample_rate / SETTINGS.samples_per_period)
    high = max(high, 2 * low)
    unit, factor = _SHOWN.get(driven.unit, (driven.unit, 1.0))
    largest, rate = f"{_short(limits.amplitude * factor)} {unit}", f"{_short(limits.rate * factor)} {unit}/s"
    acceleration = f"{_short(limits.acceleration * factor)} {unit}/s^2" if math.isfinite(limits.acceleration) else None
    amplitudes = [f"{_short(share * limits.amplitude * factor)} {unit}" for share in SETTINGS.amplitudes]
    durations = [f"{_short(share * time)} s" for share in SETTINGS.durations]
    grids: list[dict[str, Any]] = [
        {"kind": "sine", "frequency": _hertz(np.geomspace(low, high, SETTINGS.frequencies))},
        {
            "kind": "multisine",
            "frequency": _hertz(np.geomspace(low, max(high / 9, low), 4)),
            "lines": [[1, 2, 3, 4, 5], [1, 3, 9]],
        },
        {"kind": "chirp", "frequency": _hertz([low, math.sqrt(low * high)]), "last_frequency": _hertz([high])},
        {"kind": "step", "ramp_rate": rate},
    ]
    common = {"sample_rate": f"{_short(limits.sample_rate)} Hz", "amplitude": amplitudes, "duration": durations}
    return Space(
        overhead=f"{_short(overhead)} s",
        limits=Limits(amplitude=largest, rate=rate, acceleration=acceleration),
        tests=tuple(CandidateGrid.model_validate({**common, **grid}) for grid in grids if grid["kind"] in kinds),
    )


def _short(value: float) -> str:
    return f"{float(f'{value:.4g}'):g}"


def _hertz(values: Sequence[float] | np.ndarray) -> list[str]:
    return [f"{_short(float(value))} Hz" for value in dict.fromkeys(map(float, values))]
