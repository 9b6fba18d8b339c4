"""Records of uneven stamps, gaps and several rates: one uniform grid per stretch without gaps."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mofit._typing import FloatArray
from mofit.data.importers.uniform_grid import LOW_PASS, Signal, is_lower, on_grid
from mofit.data.validation import FEWEST_SAMPLES, MISSING_IN_JITTER, magnitude_issues
from mofit.errors import InputError, raise_errors


@dataclass(frozen=True)
class ResampleSettings:
    """Settings of `resampled`, each with its reason."""

    gap: float = MISSING_IN_JITTER
    """Distance of two stamps that is a gap, in those around it; jitter and a lost sample stay below."""
    around: int = 5
    """Distances on either side that a gap is compared with: a logger that slows down leaves no gap."""
    most: int = 100_000_000
    """Samples of one channel, those of the fine grid included: beyond, a unit is wrong, or memory does not suffice."""


SETTINGS = ResampleSettings()


@dataclass(frozen=True, eq=False)
class Part:
    """A stretch of a record, ``start`` to ``end`` in s, and its channels at ``start + k / rate``, shape (n,) each."""

    start: float
    end: float
    samples: int
    values: Mapping[str, FloatArray]


@dataclass(frozen=True, eq=False)
class Resampled:
    """The parts of a record that are long enough, those that are not, and what was done, in words."""

    parts: Sequence[Part]
    short: Sequence[Part]
    history: str


def resampled(
    where: str,
    signals: Mapping[str, Signal],
    rate: float,
    linear: bool,
    gap: float | None = None,
    shortest: float = 0.0,
) -> Resampled:
    """Bring signals to one uniform grid per stretch without gaps.

    Samples that are not finite are left out, and of repeated stamps the last is kept.

    Parameters
    ----------
    where
        The test, for messages.
    signals
        By channel, at least one.
    rate
        New sampling rate in Hz.
    linear
        Whether signals run straight between their samples; else as cubic splines.
    gap
        Distance of two stamps in s above which there is a gap; by default five times those around it.
    shortest
        Duration in s of the shortest part that is kept. A part has at least 8 samples.

    Raises
    ------
    InputError
        If stamps go back, if signals have no common time, if no part is long enough, or if the rate is no rate, or far
        beyond the data.
    """
    if not (np.isfinite(rate) and rate > 0):
        raise InputError.of(f"{where}, resample", f"{rate:g} Hz is no rate", "Give a rate above 0, like '200 Hz'")
    sound = {name: _sound(f"{where}, variable '{name}'", signal) for name, signal in signals.items()}
    runs = {name: _runs(signal, gap, rate) for name, signal in sound.items()}
    spans = _common([[(run.time[0], run.time[-1]) for run in own] for own in runs.values()])
    _check_spans(where, spans, sound, rate, shortest)
    begins = {name: [run.time[0] for run in own] for name, own in runs.items()}
    parts: dict[bool, list[Part]] = {True: [], False: []}
    for start, end in spans:
        count = _samples(start, end, rate)
        kept = count >= FEWEST_SAMPLES and end - start >= shortest
        values = {
            name: on_grid(own[bisect_right(begins[name], start) - 1], start, count, rate, linear)
            for name, own in runs.items()
            if kept
        }
        parts[kept].append(Part(start, end, count, values))
    return Resampled(parts[True], parts[False], _history(signals, sound, rate, linear))


def _samples(start: float, end: float, rate: float) -> int:
    """Samples from start to end, to rounding."""
    return int((end - start) * rate * (1 + 1e-12) + 1e-6) + 1


def _check_spans(
    where: str, spans: Sequence[tuple[float, float]], sound: Mapping[str, Signal], rate: float, shortest: float
) -> None:
    """Refuse a record without a part that is long enough, and a rate that makes too many samples."""
    if not spans:
        raise InputError.of(where, "its channels have no time in common", "Check the time of every channel")
    steps = [float(np.median(np.diff(signal.time))) for signal in sound.values()]
    finest = max(rate, *(LOW_PASS.fine / step for step in steps if is_lower(rate, step)), rate)
    if not (count := sum(end - start for start, end in spans) * finest) <= SETTINGS.most:
        message = f"{rate:g} Hz takes {count:.3g} samples of one channel"
        hint = "Give a rate closer to that of the data, or check the units of both"
        raise InputError.of(f"{where}, resample", message, hint)
    start, end = max(spans, key=lambda span: span[1] - span[0])
    if _samples(start, end, rate) < FEWEST_SAMPLES or end - start < shortest:
        message = f"the longest stretch without gaps has {_samples(start, end, rate)} samples at {rate:g} Hz"
        least = f"at least {FEWEST_SAMPLES}" + (f" and {shortest:.4g} s, a period" if shortest else "")
        raise InputError.of(where, f"{message}, {end - start:.4g} s", f"It takes {least}: raise the rate, or max_gap")


def _sound(where: str, signal: Signal) -> Signal:
    """The samples that are finite, the last one of each stamp."""
    finite = np.isfinite(signal.time) & np.isfinite(signal.values)
    time, values = signal.time[finite], signal.values[finite]
    raise_errors([*magnitude_issues(f"{where}, time", time), *magnitude_issues(where, values)])
    steps = np.diff(time)
    if (back := np.flatnonzero(steps < 0)).size:
        at = back[0]
        message = f"its time goes back after sample {at}: {time[at]:.6g} s, then {time[at + 1]:.6g} s ({back.size}x)"
        raise InputError.of(where, message, "Sort the samples, or cut the record there with rows = [first, last]")
    last = np.append(steps > 0, True)[: len(time)]
    if np.count_nonzero(last) < 2:
        raise InputError.of(where, "fewer than two samples at different times", "Check the column and its time")
    return Signal(time[last], values[last])


def _runs(signal: Signal, gap: float | None, rate: float) -> list[Signal]:
    """The stretches of a signal without a gap."""
    steps = np.diff(signal.time)
    if gap is None:
        width, side = SETTINGS.around, np.zeros(SETTINGS.around)
        medians = np.median(
            np.lib.stride_tricks.sliding_window_view(np.concatenate([side, steps, side]), width), axis=1
        )
        # the window before step k is number k, the one behind it number k + width + 1
        usual = np.maximum(medians[: len(steps)], medians[width + 1 :])
        limit = np.maximum(SETTINGS.gap * usual, 1 / rate)
    else:
        limit = np.full(len(steps), gap)
    edges = np.flatnonzero(steps > limit) + 1
    return [Signal(*both) for both in zip(np.split(signal.time, edges), np.split(signal.values, edges), strict=True)]


def _common(spans: Sequence[Sequence[tuple[float, float]]]) -> list[tuple[float, float]]:
    """Intervals that lie in one of every channel's; all are sorted."""
    shared = list(spans[0])
    for others in spans[1:]:
        found, i, j = [], 0, 0
        while i < len(shared) and j < len(others):
            start, end = max(shared[i][0], others[j][0]), min(shared[i][1], others[j][1])
            if start <= end:
                found.append((start, end))
            if shared[i][1] < others[j][1]:
                i += 1
            else:
                j += 1
        shared = found
    return [(float(start), float(end)) for start, end in shared]


def _history(signals: Mapping[str, Signal], sound: Mapping[str, Signal], rate: float, linear: bool) -> str:
    """What was done: rates, filter, interpolation, and the samples that were left out."""
    sources: dict[str, list[str]] = {}
    filtered = False
    for name, signal in sound.items():
        steps = np.diff(signal.time)
        step = float(np.median(steps))
        filtered |= is_lower(rate, step)
        source = f"{1 / step:.4g} Hz (steps of {steps.min():.4g} to {steps.max():.4g} s)"
        sources.setdefault(source, []).append(name)
    one = len(sources) == 1
    origin = ", ".join(source if one else f"{source} of {', '.join(names)}" for source, names in sources.items())
    words = [f"resampled to {rate:.6g} Hz from {origin}"]
    if filtered:
        edges = f"pass band to {LOW_PASS.pass_band * rate:.4g} Hz, stop band from {LOW_PASS.stop_band * rate:.4g} Hz"
        words.append(f"zero-phase FIR low-pass where the rate fell ({edges}, {LOW_PASS.attenuation:g} dB)")
    words.append(f"{'linear' if linear else 'cubic'} interpolation")
    return "; ".join([*words, *_left_out(signals)])


def _left_out(signals: Mapping[str, Signal]) -> list[str]:
    """Samples that are not finite and stamps that repeat; each once, as channels share their stamps."""
    words = []
    for name, signal in signals.items():
        finite = np.isfinite(signal.time) & np.isfinite(signal.values)
        if bad := int(np.count_nonzero(~finite)):
            words.append(f"{bad} samples of {name} left out that are no numbers")
        time = signal.time[finite]
        if (same := np.flatnonzero(np.diff(time) == 0)).size:
            words.append(f"{same.size} repeated stamps dropped (the last is kept), the first at {time[same[0]]:.6g} s")
    return list(dict.fromkeys(words))
