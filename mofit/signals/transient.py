"""The part of a periodic record in which the rig runs steadily."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

Array = NDArray[np.float64]

#: a window is unsettled while its deviation from the usual period is above so many usual deviations;
#: a linear drift over the record reaches 2
UNSETTLED = 3.0
#: windows per period
WINDOWS = 8
#: independent samples in a window; fewer scatter so much that chance looks like a transient
_SHORTEST = 8
#: windows in a record at least, whatever the noise
_FEWEST = 16
#: deviations below this share of the range never count: rigs wander by about as much from cycle to cycle
NEGLIGIBLE = 0.005


def find_settled(time: Array, values: Array, period: float) -> tuple[float, float]:
    """Time at the start before a signal repeats, and time at the end after it stopped to, in s.

    The usual period is the median over all periods, sample by sample (two periods: the second), the
    usual deviation from it the median root mean square over windows of an eighth of a period. A
    window is unsettled above three times that and above half a percent of the range. Where the first
    decides, windows are as long as neighbours that depend on each other ask for. The transient ends
    with the last unsettled window of the first half, the tail begins with the first of the second.

    With fewer than two periods nothing can be compared: (0, 0).
    """
    step = (time[-1] - time[0]) / (len(time) - 1)
    whole = int((time[-1] - time[0] + 1.5 * step) / period)
    if whole < 2:
        return 0.0, 0.0
    t = time - time[0]
    samples = max(WINDOWS, round(period / step))
    phase = np.arange(samples) / samples * period
    # interpolation smooths the noise of the usual period a little, which matters only to its level
    stacked = CubicSpline(t, values)(np.minimum(np.arange(whole)[:, None] * period + phase, t[-1]))
    usual = stacked[-1] if whole == 2 else np.median(stacked, axis=0)
    wave = CubicSpline(np.append(phase, period), np.append(usual, usual[0]), bc_type="periodic")
    deviation = values - wave(t % period)
    negligible = NEGLIGIBLE * float(np.ptp(values))
    edges, rms, level = _windows(deviation, max(_SHORTEST, round(samples / WINDOWS)), whole == 2)
    if UNSETTLED * level > negligible:
        longest = max(_SHORTEST, min(samples, len(t) // _FEWEST))
        enough = min(_samples_for(deviation, _SHORTEST), longest)
        edges, rms, level = _windows(deviation, max(enough, round(samples / WINDOWS)), whole == 2)
    late = np.flatnonzero(rms > max(UNSETTLED * level, negligible))
    middle = len(rms) / 2
    first, last = late[late < middle], late[late >= middle]
    transient = float(t[min(edges[first[-1] + 1], len(t) - 1)]) if first.size else 0.0
    tail = float(t[-1] - t[edges[last[0]]] + step) if last.size and whole > 2 else 0.0
    return transient, tail


def _windows(deviation: Array, window: int, first_half: bool) -> tuple[NDArray[np.intp], Array, float]:
    """Edges of the windows, the last one's end included, root mean square in each, and the usual one."""
    edges = np.append(np.arange(0, max(len(deviation) - window, 0) + 1, window), len(deviation))
    rms = np.sqrt(np.add.reduceat(deviation**2, edges[:-1]) / np.diff(edges))
    return edges, rms, float(np.median(rms[: len(rms) // 2] if first_half else rms))


def _samples_for(deviation: Array, count: int) -> int:
    r"""Samples whose mean square scatters as that of ``count`` independent ones.

    As of a first-order process: :math:`(1 + \rho^2) / (1 - \rho^2)` times as many. Its :math:`\rho` is taken from how
    often neighbours share their sign, :math:`\sin(\pi/2 \, \overline{s_i s_{i+1}})`, which a short transient, however
    large, leaves as it is.
    """
    signs = np.sign(deviation)
    rho = np.sin(np.pi / 2 * np.clip(np.mean(signs[1:] * signs[:-1]), 0, 0.99))
    return int(np.ceil(count * (1 + rho**2) / (1 - rho**2)))
