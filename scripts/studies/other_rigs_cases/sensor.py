"""Between command and rig, and between rig and record: play, lags, drift, and a rig's own disturbances."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import butter, lfilter

from mofit._typing import FloatArray
from other_rigs_cases.element import Reach, saturated
from other_rigs_cases.excitation import COUNT, FINE, SAMPLE, STEP, Test, lead

#: widths of the plays of a hysteretic play, and the share of each
WIDTHS, SHARES = (0.4, 1.0, 2.0), (0.4, 0.3, 0.3)


def with_play(u: FloatArray, knobs: Mapping[str, float]) -> tuple[FloatArray, FloatArray]:
    """Input (2 n + 1, lanes) behind a play, and its rate."""
    width = knobs.get("play") or knobs["hysteretic_play"]
    widths, shares = ((1.0,), (1.0,)) if knobs.get("play") else (WIDTHS, SHARES)
    found = sum(share * played(u, width * each) for each, share in zip(widths, shares, strict=True))
    return np.asarray(found), np.gradient(np.asarray(found), STEP / 2, axis=0)


def played(u: FloatArray, width: float) -> FloatArray:
    """The play operator, from rest in the middle."""
    found, now = np.empty_like(u), np.zeros(u.shape[1])
    for k, value in enumerate(u):
        now = np.maximum(value - width, np.minimum(now, value + width))
        found[k] = now
    return found


def recorded(
    y: FloatArray, tests: Sequence[Test], knobs: Mapping[str, float], reach: Reach, rng: np.random.Generator
) -> FloatArray:
    """Samples (COUNT, lanes) of an output (steps, lanes) behind its transducer."""
    before = lead(tests)
    time = (np.arange(len(y)) - before * FINE) * STEP
    clock = time[:, None] + np.array([test.start for test in tests])
    size = reach.output
    y = _disturbed(y, time, tests, knobs, size, rng)
    if rate := knobs.get("drift"):
        y = y * (1 + rate * clock / reach.duration)
    if rate := knobs.get("saturating_drift"):
        y = y * (1 + rate * saturated(clock, reach.duration))
    if lag := knobs.get("lowpass"):
        y = _lagging(y, np.full(len(y), lag)[:, None])
    if lag := knobs.get("load_lag"):
        y = _lagging(y, lag * (0.7 + 0.6 * np.abs(y) / size))
    for order in (2, 3):
        if lag := knobs.get(f"butterworth_{order}"):
            y = lfilter(*butter(order, 1 / lag, fs=2 * np.pi / STEP), y, axis=0)
    if late := knobs.get("delay"):
        y = CubicSpline(time, y)(np.maximum(time - late, time[0]))
    return y[before * FINE :: FINE]


def bent(y: FloatArray, knobs: Mapping[str, float], size: float) -> FloatArray:
    """By an amplifier, whatever is measured with it."""
    if share := knobs.get("knee"):
        y = y - share * np.sign(y) * np.maximum(np.abs(y) - 0.4 * size, 0)
    if share := knobs.get("dead_band"):
        y = y - np.clip(y, -share * size, share * size)
    if share := knobs.get("one_sided"):
        y = y - share * np.minimum(y, 0)
    return y


def _lagging(y: FloatArray, lag: FloatArray) -> FloatArray:
    """Behind a first-order lag that may change with time; exact for an input that is linear between steps."""
    found, now = np.empty_like(y), y[0].copy()
    lag = np.broadcast_to(np.maximum(lag, 1e-9), y.shape)
    found[0] = now
    for k in range(len(y) - 1):
        slope, tau = (y[k + 1] - y[k]) / STEP, lag[k]
        keep = np.exp(-STEP / tau)
        now = y[k + 1] - slope * tau + (now - y[k] + slope * tau) * keep
        found[k + 1] = now
    return found


def _disturbed(
    y: FloatArray,
    time: FloatArray,
    tests: Sequence[Test],
    knobs: Mapping[str, float],
    size: float,
    rng: np.random.Generator,
) -> FloatArray:
    """With what no model of the catalogue has, or what rotates."""
    if share := knobs.get("wheel_order"):
        turned = np.stack([ROTATION * test.speed * time + test.angle for test in tests], axis=1)
        y = y + share * size * np.cos(turned)
    if share := knobs.get("crosstalk"):
        y = y + share * size * np.abs(np.stack([test.drive(time)[1] for test in tests], axis=1))
    y = bent(y, knobs, size)
    if share := knobs.get("gain_walk"):
        count = COUNT + lead(tests)
        walk = np.cumsum(rng.normal(size=(count, len(tests))), axis=0) / np.sqrt(COUNT)
        at = np.arange(count) * SAMPLE + time[0]
        y = y * (1 + share * np.stack([np.interp(time, at, column) for column in walk.T], axis=1))
    if share := knobs.get("subharmonic"):
        y = y + share * size * np.stack([_half(test, time) for test in tests], axis=1)
    return y


#: angular frequency of the wheel at the usual speed, in units of the rig's own: 8.7 Hz of 2 Hz
ROTATION = 60 / 3.6 / 0.305 / (2 * np.pi * 2.0)


def _half(test: Test, time: FloatArray) -> FloatArray:
    """A line at half the frequency of a sine or a sweep; nothing before the test."""
    if test.kind == "chirp":
        low, high = test.frequencies
        swept = low * time + (high - low) * time**2 / 2 / (SAMPLE * COUNT)
    else:
        swept = test.frequencies[0] * time
    return np.where((time > 0) | test.settled, test.amplitude * np.sin(swept / 2 + 0.5), 0.0)
