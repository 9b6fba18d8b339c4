r"""What the shapes of columns say: which is the time, which drives, which responds, which is another's derivative.

Names are not needed. A derivative :math:`b` of :math:`a` is found by
:math:`a \approx k \int b \, dt + c_0 + c_1 t` with :math:`k` a power of ten, as the units of a rig's channels differ by
one: integration does not amplify noise. What drives is chosen by three rules, the first that decides: a signal whose
derivative is recorded is a motion; a sine drives what is less of a sine; a cause predicts its effect from its past
better than the other way round.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import permutations

import numpy as np

from mofit._typing import FloatArray


@dataclass(frozen=True)
class ShapeSettings:
    """When a shape decides, each limit with its reason."""

    derivative: float = 0.02
    """Largest share of the variance that the integral may leave: sensors of a rig agree to some per cent."""
    decade: float = 0.05
    """Largest relative distance of the factor from a power of ten: a force may follow a velocity, but not so."""
    copy: float = 0.02
    """Share of the variance by which demand and measurement of one quantity may differ."""
    purer: float = 4.0
    """Times as much that the response may hold beside a sine."""
    causal: float = 0.05
    """Difference of the shares predicted that counts."""
    lags: int = 30
    """Past samples that predict."""
    jump: float = 0.25
    """Share of the range that a switched signal changes by from one sample to the next."""
    still: float = 0.01
    """Share of the range below which half of its other changes are."""
    longest: int = 4000
    """Samples that are looked at: the shape is in the first ones, and fits cost by their number."""


SHAPES = ShapeSettings()


@dataclass(frozen=True)
class Roles:
    """Names of the columns that drive and respond, and of derivatives with what they are the derivative of.

    ``reason`` says in words how the driving one was found.
    """

    driver: str
    response: str
    derivatives: Mapping[str, str]
    reason: str


def looks_like_time(values: FloatArray) -> bool:
    """Whether values increase throughout in steps of about one size."""
    steps = np.diff(values)
    return bool(
        len(values) > 7 and np.all(np.isfinite(values)) and np.all(steps > 0) and np.max(steps) <= 10 * np.median(steps)
    )


def jumps(values: FloatArray) -> int:
    """How often a signal is switched: jumps of values that stay where they are in between; 0 if they do not stay."""
    steps, size = np.abs(np.diff(values)), float(np.ptp(values))
    if not size > 0 or np.median(steps) > SHAPES.still * size:
        return 0
    jumping = (steps > SHAPES.jump * size).astype(int)
    # a jump may take several samples
    return int(jumping[0]) + int(np.count_nonzero(np.diff(jumping) == 1))


def roles_by_shape(time: FloatArray | None, columns: Mapping[str, FloatArray]) -> Roles | None:
    """Roles of columns of one length, or None if fewer than two vary.

    Parameters
    ----------
    time
        Stamps in s, shape (n,); None for a uniform, unknown rate.
    columns
        Values by name, shape (n,) each; constants, counters and what is not finite are passed over.
    """
    count = min((len(values) for values in columns.values()), default=0)
    kept = slice(0, min(count, SHAPES.longest))
    signals = {name: _scaled(values[kept]) for name, values in columns.items() if _varies(values[kept])}
    stamps: FloatArray = np.arange(count, dtype=float)[kept] if time is None else time[kept]
    derivatives: dict[str, str] = {}
    if time is not None and len(signals) > 2:
        derivatives = _derivatives(stamps, {name: columns[name][kept] for name in signals})
    left = _without_copies({name: values for name, values in signals.items() if name not in derivatives})
    if len(left) < 2:
        return None
    moved = [name for name in derivatives.values() if name in left and name not in derivatives]
    if moved:
        driver, reason = moved[0], f"its derivative is '{next(b for b, a in derivatives.items() if a == moved[0])}'"
    else:
        driver, reason = _driver(stamps, left)
    others = [name for name in left if name != driver]
    response = max(others, key=lambda name: _share_predicted(left[driver], left[name]))
    return Roles(driver, response, derivatives, reason)


def _varies(values: FloatArray) -> bool:
    """Whether values are finite and take more than two, which switches do, and do not only count."""
    if not np.all(np.isfinite(values)) or len(values) < 8:
        return False
    return len(np.unique(values)) > 2 and not looks_like_time(values)


def _scaled(values: FloatArray) -> FloatArray:
    values = values - values.mean()
    return np.asarray(values / (np.std(values) or 1.0))


def _derivatives(time: FloatArray, signals: Mapping[str, FloatArray]) -> dict[str, str]:
    """Names of derivatives and what they are the derivative of; two signals at least are left over."""
    found: dict[str, tuple[float, str]] = {}
    trend = np.column_stack([np.ones_like(time), time - time.mean()])
    steps = np.diff(time)
    for name, rate in permutations(signals, 2):
        values, slope = signals[name], signals[rate]
        integral = np.concatenate([[0.0], np.cumsum(steps * (slope[1:] + slope[:-1]) / 2)])
        a, b = (x - trend @ np.linalg.lstsq(trend, x, rcond=None)[0] for x in (values, integral))
        if not np.var(b) > 0 or not np.var(a) > 0:
            continue
        factor = float(a @ b / (b @ b))
        left = np.var(a - factor * b) / np.var(a)
        decade = float(10.0 ** np.round(np.log10(factor))) if factor > 0 else np.inf
        if left < SHAPES.derivative and abs(factor / decade - 1) < SHAPES.decade:
            found[rate] = min(found.get(rate, (np.inf, "")), (float(left), name))
    ranked = sorted(found, key=lambda name: found[name][0])[: len(signals) - 2]
    return {name: found[name][1] for name in ranked if found[name][1] not in ranked or len(ranked) > 1}


def _without_copies(signals: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
    """One of each group of signals that differ by noise: the roughest, as a measurement is rougher than its demand."""
    kept: dict[str, FloatArray] = {}
    for name, values in sorted(signals.items(), key=lambda entry: -float(np.var(np.diff(entry[1], 2)))):
        if all(2 * (1 - abs(float(np.mean(values * other)))) > SHAPES.copy for other in kept.values()):
            kept[name] = values
    return {name: values for name, values in signals.items() if name in kept}


def _driver(time: FloatArray, signals: Mapping[str, FloatArray]) -> tuple[str, str]:
    beside = {name: _beside_a_sine(values) for name, values in signals.items()}
    first, second = sorted(beside, key=lambda name: beside[name])[:2]
    if beside[first] < 0.05 and beside[second] > SHAPES.purer * beside[first]:
        return first, "it is the purest sine"
    worth = {
        name: sum(_share_predicted(cause, effect) - _share_predicted(effect, cause) for effect in signals.values())
        for name, cause in signals.items()
    }
    driver = max(worth, key=lambda name: worth[name])
    if len(signals) == 2 and worth[driver] < SHAPES.causal:
        smooth = {name: float(np.var(np.diff(values))) for name, values in signals.items()}
        return min(smooth, key=lambda name: smooth[name]), "it is the smoothest; nothing else tells"
    return driver, "its past predicts the other"


def _beside_a_sine(values: FloatArray) -> float:
    """Share of the variance that lies outside of the strongest line of the spectrum (a Hann window wide)."""
    power = np.abs(np.fft.rfft(values * np.hanning(len(values)))) ** 2
    peak = int(np.argmax(power))
    return float(1 - power[max(peak - 3, 0) : peak + 4].sum() / power.sum())


def _share_predicted(cause: FloatArray, effect: FloatArray) -> float:
    """Share of the variance of ``effect`` that the past samples of ``cause`` predict linearly."""
    lags = min(SHAPES.lags, len(cause) // 8)
    past = np.lib.stride_tricks.sliding_window_view(cause[:-1], lags)
    target = effect[lags:]
    # a small ridge: the past of a smooth signal is nearly dependent
    normal = past.T @ past + 1e-6 * len(target) * np.eye(lags)
    left = target - past @ np.linalg.solve(normal, past.T @ target)
    return float(1 - np.var(left) / (np.var(target) or 1.0))
