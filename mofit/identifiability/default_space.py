"""The space that is searched where none is given: what the rig has shown that it can do."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from mofit.identifiability.limits import Reach
from mofit.identifiability.space import CandidateGrid, Limits, Space

#: Display unit and factor from SI for what a rig drives; others stay in SI.
_SHOWN = {"rad": ("deg", 180 / math.pi), "m": ("mm", 1e3)}

#: Frequencies go so far beyond those known, each way.
_BEYOND = 2.5
#: Sine frequencies of the grid.
_FREQUENCIES = 15
#: Amplitudes, as shares of the largest; durations, as shares of the time there is.
_AMPLITUDES = (0.25, 0.5, 1.0)
_DURATIONS = (0.25, 0.5, 1.0)
#: Periods that a sine or multisine must have room for: one settles, two are judged.
_PERIODS = 3
#: Frequencies where no test of FILE has one [Hz].
_UNKNOWN = (0.1, 10.0)


def default_space(
    shown: Reach, unit: str, frequencies: Sequence[float], budget: float, overhead: float, kinds: Sequence[str] = ()
) -> Space:
    """Sines, chirps, multisines and steps within the reach that the known tests show.

    Parameters
    ----------
    shown
        Largest amplitude, rate, acceleration and sampling rate of the known tests.
    unit
        SI unit of the driven input.
    frequencies
        Those of the known tests [Hz].
    budget, overhead
        Time there is, and time per test beside its duration [s].
    kinds
        Kinds that may take part; all where empty.
    """
    time = max(budget - overhead, 1e-3)
    low, high = min(frequencies, default=_UNKNOWN[0]), max(frequencies, default=_UNKNOWN[1])
    low = max(low / _BEYOND, _PERIODS / time)
    high = min(high * _BEYOND, shown.sample_rate / 20)
    high = max(high, 2 * low)
    name, factor = _SHOWN.get(unit, (unit, 1.0))
    rate = f"{_short(shown.sample_rate)} Hz"
    amplitudes = [f"{_short(share * shown.amplitude * factor)} {name}" for share in _AMPLITUDES]
    durations = [f"{_short(share * time)} s" for share in _DURATIONS]
    grids: list[dict[str, Any]] = [
        {"kind": "sine", "frequency": _hertz(np.geomspace(low, high, _FREQUENCIES)), "duration": durations},
        {
            "kind": "multisine",
            "frequency": _hertz(np.geomspace(low, max(high / 9, low), 4)),
            "lines": [[1, 2, 3, 4, 5], [1, 3, 9]],
            "duration": durations,
        },
        {
            "kind": "chirp",
            "frequency": _hertz([low, math.sqrt(low * high)]),
            "last_frequency": _hertz([high]),
            "duration": durations,
        },
        {
            "kind": "step",
            "ramp_rate": f"{_short(shown.rate * factor)} {name}/s",
            "duration": durations,
        },
    ]
    tests = [
        CandidateGrid.model_validate({"sample_rate": rate, "amplitude": amplitudes, **grid})
        for grid in grids
        if not kinds or grid["kind"] in kinds
    ]
    limits = Limits(
        amplitude=f"{_short(shown.amplitude * factor)} {name}",
        rate=f"{_short(shown.rate * factor)} {name}/s",
        acceleration=(
            f"{_short(shown.acceleration * factor)} {name}/s^2" if math.isfinite(shown.acceleration) else None
        ),
    )
    return Space(overhead=f"{_short(overhead)} s", limits=limits, tests=tuple(tests))


def _short(value: float) -> str:
    return f"{float(f'{value:.4g}'):g}"


def _hertz(values: Sequence[float] | np.ndarray) -> list[str]:
    return [f"{_short(float(value))} Hz" for value in dict.fromkeys(map(float, values))]
