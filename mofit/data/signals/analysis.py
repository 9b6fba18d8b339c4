"""Signal analysis of one test: period, transient, steady part, noise."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from mofit._typing import FloatArray
from mofit.data.campaign import Measurement
from mofit.data.signals.periodicity import find_period, overlap_noise, repeat_noise, sine_period
from mofit.data.signals.smoothing import residual_noise
from mofit.quantities import SINGLE_EXCITATIONS

#: samples that must repeat, where the record holds less than two periods
_SHORTEST_OVERLAP = 64
#: tests whose analysis is cached: every problem on a campaign needs it again
_CACHED = 64
#: the noise is what differs between records of the same test, see `mofit.data.repeats`
REPEATED = "repeated records"
#: methods that see the noise in what repeats
REPEATS = ("period to period", "overlap of periods", REPEATED)


@dataclass(frozen=True)
class SteadyStateSettings:
    """When a periodic record counts as steady."""

    deviation: float = 3.0
    """Usual deviations above which a window is transient; a linear drift over the record reaches 2."""
    negligible: float = 0.005
    """Deviations below this share of the range never count: rigs wander by about as much from cycle to cycle."""
    windows: int = 8
    """Windows per period."""
    shortest: int = 8
    """Independent samples in a window; fewer scatter so much that chance looks like a transient."""
    fewest: int = 16
    """Windows in a record at least, whatever the noise."""


STEADY_STATE = SteadyStateSettings()


@dataclass(frozen=True)
class SignalAnalysis:
    """Period, transient and noise of a test."""

    period: float | None
    """In s, found from the input; None if that does not repeat."""
    periods: int
    """Whole periods between transient and tail."""
    transient: float
    """Time at the start that is not used, in s."""
    tail: float
    """Time at the end in which a periodic test no longer repeats (the rig has stopped), in s."""
    noise_sd: Mapping[str, float]
    """Standard deviation of the noise of every channel, in its unit."""
    noise_method: str
    """How it was found, for the last output: ``"period to period"``, ``"overlap of periods"``, ``"repeated
    records"``, ``"smoothing residual"`` or ``"top of spectrum"`` (a lower bound)."""
    noise_floor: Mapping[str, float]
    """Per output, ``noise_sd / (max - min)``: the NRMSD that a perfect model would reach."""
    frequency: float | None = None
    """Of the input, in Hz, whether it repeats or ramps up and down; None if it has none."""
    input_period: float | None = None
    """Of the inputs, in s, whether the record is taken to repeat with them or not."""
    lead: float = 0.0
    """Time that the inputs, repeated, act on a model before the first sample, s."""

    @property
    def steady_from_start(self) -> bool:
        """Whether the record repeats from its first sample on, as far as can be told."""
        return self.period is not None and self.periods >= 2 and not self.transient

    @property
    def repeats(self) -> bool:
        """Whether the noise was told from the signal by what repeats, coloured or not."""
        return self.noise_method in REPEATS


@lru_cache(maxsize=_CACHED)
def analyse(
    measurement: Measurement, driver: str | None = None, output: str | None = None, beside: tuple[str, ...] = ()
) -> SignalAnalysis:
    """Find period, transient and noise of a test from its data; the label is not used.

    Parameters
    ----------
    measurement
        The test. A transient that it states (`Experiment.transient`) is taken as it is.
    driver
        Channel that the period is taken from; by default the first input that has one.
    output
        Channel that is an output of the model, where it is not an output by role.
    beside
        Other inputs of the model, which must repeat with the period, too: slips of two frequencies have none.

    Raises
    ------
    InputError
        If the test has no such channel.
    """
    experiment, time = measurement.experiment, measurement.time
    channels = {**experiment.inputs, **measurement.outputs}
    drivers = list(experiment.inputs) if driver is None else [driver]
    outputs = {*measurement.outputs, *([output] if output else [])}
    period, of = _period(measurement.kind, time, {name: measurement.channel(name) for name in drivers})
    found = [find_transient(time, values, period) for values in channels.values()] if period else [(0.0, 0.0)]
    transient, tail = (max(times) for times in zip(*found, strict=True))
    if experiment.transient is not None:
        transient = experiment.transient
    kept = steady_samples(time, transient, tail)
    # the tolerance of half a sample is for records cut to whole periods
    periods = int((np.count_nonzero(kept) + 0.5) * experiment.step / period) if period else 0
    frequency = 1 / period if period else None
    repeating = (_repeats(time, measurement.channel(name), kept, period, periods) for name in (of, *beside) if period)
    if period and not all(repeating):
        period, periods, transient, tail = None, 0, experiment.transient or 0.0, 0.0
        kept = steady_samples(time, transient)
    noise = {}
    for name, values in channels.items():
        noise[name], method = _noise(time, values, kept, period, periods)
    floor = {name: noise[name] / float(np.ptp(measurement.channel(name))) for name in sorted(outputs)}
    return SignalAnalysis(period, periods, transient, tail, noise, method, floor, frequency, period)


def _noise(
    time: FloatArray, values: FloatArray, kept: NDArray[np.bool_], period: float | None, periods: int
) -> tuple[float, str]:
    """Standard deviation of the noise of a channel, and how it was found."""
    if period and periods >= 2:
        return repeat_noise(time[kept], values[kept], period), REPEATS[0]
    if period and time[-1] - time[0] > period + _SHORTEST_OVERLAP * (time[-1] - time[0]) / (len(time) - 1):
        return overlap_noise(time, values, period), REPEATS[1]
    return residual_noise(values[kept])


def _repeats(time: FloatArray, values: FloatArray, kept: NDArray[np.bool_], period: float, periods: int) -> bool:
    """Whether an input repeats as well as rigs repeat it.

    Where it does not, a sine that ramps up and down for one, what differs from period to period is no noise.
    """
    deviation, method = _noise(time, values, kept, period, periods)
    if method not in REPEATS:
        return True
    limits = STEADY_STATE
    least = limits.negligible * float(np.ptp(values))
    used = values[kept] if periods >= 2 else values  # as the deviation is
    return deviation <= max(least, limits.deviation * residual_noise(used)[0])


def steady_samples(time: FloatArray, transient: float, tail: float = 0.0) -> NDArray[np.bool_]:
    """Which samples lie between the transient and the tail, shape (n,)."""
    half = 0.5 * (time[-1] - time[0]) / (len(time) - 1)
    return (time >= time[0] + transient - half) & (time <= time[-1] - tail + half)


def find_transient(time: FloatArray, values: FloatArray, period: float) -> tuple[float, float]:
    """Time at the start before a signal repeats, and time at the end after it stopped to, in s.

    The usual period is the median over all periods, sample by sample (of two periods: the second); the usual deviation
    from it is the median root mean square over windows of an eighth of a period. A window is transient above three
    times that and above half a percent of the range. Where the first decides, windows are as long as correlated noise
    requires. The transient ends with the last such window of the first half, the tail begins with the first of the
    second. Fewer than two periods cannot be compared: (0, 0).
    """
    limits = STEADY_STATE
    step = (time[-1] - time[0]) / (len(time) - 1)
    whole = int((time[-1] - time[0] + 1.5 * step) / period)
    if whole < 2:
        return 0.0, 0.0
    t = time - time[0]
    samples = max(limits.windows, round(period / step))
    phase = np.arange(samples) / samples * period
    # interpolation smooths the noise of the usual period a little, which matters only to its level
    stacked = CubicSpline(t, values)(np.minimum(np.arange(whole)[:, None] * period + phase, t[-1]))
    usual = stacked[-1] if whole == 2 else np.median(stacked, axis=0)
    wave = CubicSpline(np.append(phase, period), np.append(usual, usual[0]), bc_type="periodic")
    deviation = values - wave(t % period)
    negligible = limits.negligible * float(np.ptp(values))
    eighth = round(samples / limits.windows)
    edges, rms, level = _windows(deviation, max(limits.shortest, eighth), whole == 2)
    if limits.deviation * level > negligible:
        longest = max(limits.shortest, min(samples, len(t) // limits.fewest))
        enough = min(_samples_for(deviation, limits.shortest), longest)
        edges, rms, level = _windows(deviation, max(enough, eighth), whole == 2)
    late = np.flatnonzero(rms > max(limits.deviation * level, negligible))
    middle = len(rms) / 2
    first, last = late[late < middle], late[late >= middle]
    transient = float(t[min(edges[first[-1] + 1], len(t) - 1)]) if first.size else 0.0
    tail = float(t[-1] - t[edges[last[0]]] + step) if last.size and whole > 2 else 0.0
    return transient, tail


def _period(kind: str, time: FloatArray, drivers: Mapping[str, FloatArray]) -> tuple[float | None, str]:
    """Period of the first driving signal that has one, and its name."""
    if kind in SINGLE_EXCITATIONS:
        return None, ""
    for name, values in drivers.items():
        period = sine_period(time, values) if kind == "sine" else None
        if period is None:
            period = find_period(time, values)
        if period is not None:
            return period, name
    return None, ""


def _windows(deviation: FloatArray, window: int, first_half: bool) -> tuple[NDArray[np.intp], FloatArray, float]:
    """Edges of the windows, the last one's end included, root mean square in each, and the usual one."""
    edges = np.append(np.arange(0, max(len(deviation) - window, 0) + 1, window), len(deviation))
    rms = np.sqrt(np.add.reduceat(deviation**2, edges[:-1]) / np.diff(edges))
    return edges, rms, float(np.median(rms[: len(rms) // 2] if first_half else rms))


def _samples_for(deviation: FloatArray, count: int) -> int:
    r"""Samples whose mean square scatters as that of ``count`` independent ones.

    For a first-order process: :math:`(1 + \rho^2) / (1 - \rho^2)` times as many. Its :math:`\rho` follows from how
    often neighbours share their sign, :math:`\sin(\pi/2 \, \overline{s_i s_{i+1}})`, which a short transient, however
    large, does not change.
    """
    signs = np.sign(deviation)
    rho = np.sin(np.pi / 2 * np.clip(np.mean(signs[1:] * signs[:-1]), 0, 0.99))
    return int(np.ceil(count * (1 + rho**2) / (1 - rho**2)))
