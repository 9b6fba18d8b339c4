"""Groups of tests that are left out of a fit together: the others must be extrapolated to predict them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from mofit._typing import FloatArray
from mofit.diagnosis.whitened_data import WhitenedData
from mofit.models import Effect
from mofit.simulation import exciting_channel

#: Tests from here on up to the largest value are one group: half the power of an amplitude (3 dB), half an octave of a
#: frequency. So every group holds a test with twice the power, or half an octave above, of any that is fitted.
_CLEARLY = 0.5**0.5


@dataclass(frozen=True)
class Group:
    """Tests that are left out together, by index, and what they have in common, in words.

    Of an effect that follows the run order they may be the ``later`` ones.
    """

    name: str
    tests: tuple[int, ...]
    later: bool = False


def groups(observed: WhitenedData, effects: Iterable[Effect] = ()) -> list[Group]:
    """The tests of largest amplitude, those of highest frequency, and those of every procedure where there are several.

    Amplitude and frequency are those of the measured main input, so that records of any kind have them. With an effect
    that follows the run order also the `latest` tests. At least half of the tests stay to be fitted. Properties that
    choose the same tests make one group.
    """
    amplitudes, frequencies = np.array([_amplitude_and_frequency(observed, k) for k in _numbers(observed)]).T
    kinds = [measurement.kind for measurement in observed.problem.measurements]
    last = latest(observed, effects)
    found: dict[tuple[int, ...], list[str]] = {}
    for name, tests in (
        ("largest amplitude", _largest(amplitudes)),
        ("highest frequency", _largest(frequencies)),
        ("latest start", last),
        *((f"procedure {kind}", tuple(_where(kind == one for one in kinds))) for kind in dict.fromkeys(kinds)),
    ):
        if tests and 2 * len(tests) <= len(kinds):
            found.setdefault(tests, []).append(name)
    return [Group(" and ".join(names), tests, tests == last) for tests, names in found.items()]


def follow_run_order(effects: Iterable[Effect]) -> bool:
    """Whether one of the effects does."""
    return any(condition.name == "start_time" for effect in effects for condition in effect.conditions)


def latest(observed: WhitenedData, effects: Iterable[Effect]) -> tuple[int, ...]:
    """Tests that begin last, if one of the effects follows the run order; none otherwise.

    Between tests that are fitted, a law of the time is interpolated, and follows whatever changes slowly.
    """
    if not follow_run_order(effects):
        return ()
    starts = [measurement.experiment.start_time for measurement in observed.problem.measurements]
    known = np.array([np.nan if start is None else start for start in starts])
    return _largest(known - np.nanmin(known))


def _numbers(observed: WhitenedData) -> range:
    return range(len(observed.problem.tests))


def _where(chosen: Iterable[bool]) -> list[int]:
    return [number for number, one in enumerate(chosen) if one]


def _largest(values: FloatArray) -> tuple[int, ...]:
    """Tests whose value is near the largest, if others are clearly below; nan is none."""
    known = values[np.isfinite(values)]
    if not known.size or not known.max() > 0:
        return ()
    near: Sequence[int] = _where(bool(value > _CLEARLY * known.max()) for value in values)
    return tuple(near) if len(near) < len(values) else ()


def _amplitude_and_frequency(observed: WhitenedData, test: int) -> tuple[float, float]:
    """Of what excites a test, over the samples used: half its range, and the mean frequency of its power."""
    problem = observed.problem
    used = next(w for number, _, w in observed.records if number == test)
    measurement = problem.measurements[test]
    values = measurement.channel(exciting_channel(problem.model, measurement))[used.start : used.start + used.count]
    power = np.abs(np.fft.rfft(values - values.mean())) ** 2
    frequency = float(power @ used.frequencies / power.sum()) if power.sum() > 0 else np.nan
    return 0.5 * float(np.ptp(values)), frequency
