"""The design space where none is given: tests within what the known tests demonstrate of the rig."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mofit.design.candidate_space import CandidateGrid, Limits, Space
from mofit.design.rig_limits import RigLimits

#: Display unit and factor from SI for what a rig drives; others stay in SI.
_SHOWN = {"rad": ("deg", 180 / math.pi), "m": ("mm", 1e3)}


@dataclass(frozen=True)
class DefaultSpaceSettings:
    """Grids of the space.

    Parameters
    ----------
    beyond
        Frequencies reach so far beyond the known ones, each way: a model is rarely trusted further.
    frequencies
        Sine frequencies: neighbours differ by less than a parameter's optimum is wide.
    amplitudes, durations
        Shares of the largest amplitude, and of the time there is.
    periods
        Periods that a sine or multisine must have room for: one is transient, two are used.
    samples_per_period
        At the highest frequency, so that the interpolated input is still a sine.
    unknown
        Frequencies where the known tests have none [Hz].
    """

    beyond: float = 2.5
    frequencies: int = 15
    amplitudes: tuple[float, ...] = (0.25, 0.5, 1.0)
    durations: tuple[float, ...] = (0.25, 0.5, 1.0)
    periods: int = 3
    samples_per_period: int = 20
    unknown: tuple[float, float] = (0.1, 10.0)


_SETTINGS = DefaultSpaceSettings()


def default_space(
    limits: RigLimits,
    unit: str,
    frequencies: Sequence[float],
    budget: float,
    overhead: float,
    kinds: Sequence[str] = (),
    settings: DefaultSpaceSettings = _SETTINGS,
) -> Space:
    """Sines, chirps, multisines and steps within demonstrated limits.

    Parameters
    ----------
    limits
        Largest amplitude, rate, acceleration and sampling rate of the known tests.
    unit
        SI unit of the driven input.
    frequencies
        Those of the known tests [Hz].
    budget, overhead
        Time there is, and time per test beside its duration [s].
    kinds
        Kinds of tests to offer; all where empty.
    settings
        Grids of the space.
    """
    time = max(budget - overhead, 1e-3)
    low, high = min(frequencies, default=settings.unknown[0]), max(frequencies, default=settings.unknown[1])
    low = max(low / settings.beyond, settings.periods / time)
    high = min(high * settings.beyond, limits.sample_rate / settings.samples_per_period)
    high = max(high, 2 * low)
    name, factor = _SHOWN.get(unit, (unit, 1.0))
    amplitudes = [f"{_short(share * limits.amplitude * factor)} {name}" for share in settings.amplitudes]
    durations = [f"{_short(share * time)} s" for share in settings.durations]
    rate = f"{_short(limits.rate * factor)} {name}/s"
    grids: list[dict[str, Any]] = [
        {"kind": "sine", "frequency": _hertz(np.geomspace(low, high, settings.frequencies))},
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
        limits=Limits(
            amplitude=f"{_short(limits.amplitude * factor)} {name}",
            rate=rate,
            acceleration=(
                f"{_short(limits.acceleration * factor)} {name}/s^2" if math.isfinite(limits.acceleration) else None
            ),
        ),
        tests=tuple(
            CandidateGrid.model_validate({**common, **grid}) for grid in grids if not kinds or grid["kind"] in kinds
        ),
    )


def _short(value: float) -> str:
    return f"{float(f'{value:.4g}'):g}"


def _hertz(values: Sequence[float] | np.ndarray) -> list[str]:
    return [f"{_short(float(value))} Hz" for value in dict.fromkeys(map(float, values))]
