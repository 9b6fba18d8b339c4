"""One test, analysed: period, transient, noise."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from mofit.campaign import Array, Measurement
from mofit.signals.noise import overlap_noise, repeat_noise, residual_noise
from mofit.signals.periods import find_period, sine_period
from mofit.signals.transient import find_settled

#: samples that must repeat, where the record holds less than two periods
_SHORTEST_OVERLAP = 64
#: tests whose records are remembered: every problem that is posed on a campaign asks again
_REMEMBERED = 64


@dataclass(frozen=True)
class Record:
    """What the data of a test say.

    Parameters
    ----------
    period
        In s, found from the input; None if it does not repeat.
    periods
        Whole periods between transient and tail.
    transient
        Time at the start that is not to be judged, in s.
    tail
        Time at the end in which a periodic test no longer repeats (the rig stops), in s.
    noise_sd
        Standard deviation of the noise of every channel, in its unit.
    noise_method
        How: ``"period to period"``, ``"overlap of periods"``, ``"smoothing residual"`` or
        ``"top of spectrum"`` (a lower bound); of the last output.
    noise_floor
        Per output, ``noise_sd / (max - min)``: the NRMSD that a perfect model would reach.
    """

    period: float | None
    periods: int
    transient: float
    tail: float
    noise_sd: Mapping[str, float]
    noise_method: str
    noise_floor: Mapping[str, float]


@lru_cache(maxsize=_REMEMBERED)
def analyse(measurement: Measurement, driver: str | None = None, output: str | None = None) -> Record:
    """Period, transient and noise of a test, from its data; the label is not used.

    Parameters
    ----------
    measurement
        The test. A transient that it states (`Procedure.transient`) is taken as it is.
    driver
        Channel that the period is taken from; by default the first input that has one.
    output
        Channel that is judged, where it is not an output by role.

    Raises
    ------
    InputError
        If the test has no such channel.
    """
    procedure, time = measurement.procedure, measurement.time
    channels = {**procedure.inputs, **measurement.outputs}
    drivers = list(procedure.inputs) if driver is None else [driver]
    judged = {*measurement.outputs, *([output] if output else [])}
    period = _period(measurement.kind, time, [measurement.channel(name) for name in drivers])
    transient, tail = _settled(time, list(channels.values()), period)
    if procedure.transient is not None:
        transient = procedure.transient
    kept = settled_samples(time, transient, tail)
    # the tolerance of half a sample is for records cut to whole periods
    periods = int((np.count_nonzero(kept) + 0.5) * procedure.step / period) if period else 0
    noise = {}
    for name, values in channels.items():
        if period and periods >= 2:
            noise[name], method = repeat_noise(time[kept], values[kept], period), "period to period"
        elif period and time[-1] - time[0] > period + _SHORTEST_OVERLAP * procedure.step:
            noise[name], method = overlap_noise(time, values, period), "overlap of periods"
        else:
            noise[name], method = residual_noise(values[kept])
    floor = {name: noise[name] / float(np.ptp(measurement.channel(name))) for name in sorted(judged)}
    return Record(period, periods, transient, tail, noise, method, floor)


def settled_samples(time: Array, transient: float, tail: float = 0.0) -> NDArray[np.bool_]:
    """Which samples lie between the transient and the tail, shape (n,)."""
    half = 0.5 * (time[-1] - time[0]) / (len(time) - 1)
    return (time >= time[0] + transient - half) & (time <= time[-1] - tail + half)


def _period(kind: str, time: Array, drivers: list[Array]) -> float | None:
    """Period of the first driving signal that has one."""
    if kind == "step":
        return None
    for values in drivers:
        period = sine_period(time, values) if kind == "sine" else None
        if period is None:
            period = find_period(time, values)
        if period is not None:
            return period
    return None


def _settled(time: Array, channels: list[Array], period: float | None) -> tuple[float, float]:
    """Longest transient and longest tail of all channels."""
    if period is None:
        return 0.0, 0.0
    found = [find_settled(time, values, period) for values in channels]
    return max(transient for transient, _ in found), max(tail for _, tail in found)
