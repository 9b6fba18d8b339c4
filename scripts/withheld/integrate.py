"""Carcass and contact patch in time: Runge-Kutta over many tests (lanes) at once.

The contact patch holds the carcass, F = g (s - y'/v*) = c_y (1 + p_y |y|) y + d_y y' + G + ..., which gives y'.
Memory of the rubber is carried as *forces* that relax (Boltzmann's superposition), G' = c y' - G / tau, never as inner
displacements. A fractional element is the sum of such forces over a logarithmic spectrum (trapezoidal rule), whose
fastest part is a damper and whose slowest a spring.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.special import gamma

Array = NDArray[np.float64]

#: longest relaxation time of the fractional element, s, and the shortest where steps are not shorter than usual
SLOWEST, FASTEST = 200.0, 4e-3
#: deflection at which the bump stop is met, m
BUMP = 6e-3


def spectrum(step: float) -> Array:
    """Relaxation times of the fractional element, s: as short as integration by this step bears."""
    return np.geomspace(min(FASTEST, 1.6 * step), SLOWEST, 12 if 1.6 * step >= FASTEST else 14)


def fractional_parts(times: Array, coefficient: Array, exponent: Array) -> tuple[Array, Array, Array]:
    """Stiffness of every element of a spectrum (n, lanes) [N/m], damper [N s/m] and spring [N/m] at its two ends.

    The kernel t^-a / Gamma(1 - a) is the integral of exp(-t / tau) tau^-a / (Gamma(a) Gamma(1 - a)) over ln tau.
    """
    width = np.log(times[1] / times[0])
    scale = coefficient / (gamma(1 - exponent) * gamma(exponent))
    stiffness = scale * width * times[:, None] ** -exponent
    fast, slow = times[0] * np.exp(-width / 2), times[-1] * np.exp(width / 2)
    return stiffness, scale * fast ** (1 - exponent) / (1 - exponent), scale * slow**-exponent / exponent


def integrate(step: float, steady: Array, slope: Array, k: Mapping[str, Array]) -> tuple[Array, Array]:
    """Force [N] and rate of the deflection [m/s] at every step, (steps + 1, lanes), from rest.

    Parameters
    ----------
    step
        Of the integration, s.
    steady
        Force of the contact patch if the carcass stood still, g s [N], at steps and half-steps: (2 steps + 1, lanes).
    slope
        g / v* [N s/m], there.
    k
        Parameters of the specimen and knobs, (lanes,) each.
    """
    rate_of = _Rates(k, spectrum(step))
    lanes = steady.shape[1]
    count = len(steady) // 2 + 1
    force, rate = np.empty((count, lanes)), np.empty((count, lanes))
    state = rate_of.rest(steady[0])
    for n in range(count):
        now = 2 * n
        first = rate_of(state, steady[now], slope[now])
        rate[n] = first[0]
        force[n] = steady[now] - slope[now] * first[0]
        if n == count - 1:
            break
        second = rate_of(state + step / 2 * first, steady[now + 1], slope[now + 1])
        third = rate_of(state + step / 2 * second, steady[now + 1], slope[now + 1])
        fourth = rate_of(state + step * third, steady[now + 2], slope[now + 2])
        state = state + step / 6 * (first + 2 * (second + third) + fourth)
    return force, rate


class _Rates:
    """Rates of the states (y, G, then what the lanes need); one row per state."""

    def __init__(self, k: Mapping[str, Array], times: Array) -> None:
        self.k = k
        self.has = {name: bool(np.any(k[name])) for name in ("c_2", "c_f", "F_d", "d_2", "k_c", "c_P", "k_a", "k_bump")}
        self.damper, self.spring = k["d_y"], 0.0
        rows = [k["c_M"]], [k["c_M"] / k["d_M"]]
        if self.has["c_2"]:
            rows[0].append(k["c_2"])
            rows[1].append(1 / k["tau_2"])
        if self.has["c_f"]:
            stiffness, fast, self.spring = fractional_parts(times, k["c_f"], k["a_f"])
            self.damper = self.damper + fast
            rows[0].extend(stiffness)
            rows[1].extend(np.broadcast_to(1 / times[:, None], stiffness.shape))
        self.stiffness, self.relaxation = np.array(rows[0]), np.array(rows[1])
        self.branches = len(self.stiffness)
        self.friction = self.branches + 1

    def elastic(self, y: Array) -> Array:
        """Springs beside the branches, N."""
        k, size = self.k, np.abs(y)
        force = k["c_y"] * (1 + k["p_y"] * size) * y
        if self.has["c_f"]:
            force = force + self.spring * y
        if self.has["k_c"]:
            force = force + k["k_c"] * y**3
        if self.has["k_a"]:
            force = force + k["k_a"] * size
        if self.has["c_P"]:
            force = force + k["c_P"] * y / (1 + size / k["y_P"])
        if self.has["k_bump"]:
            force = force + k["k_bump"] * np.maximum(y - BUMP, 0)
        return force

    def rest(self, steady: Array) -> Array:
        """Deflection at which the springs hold the first force, everything else relaxed."""
        y = steady / self.k["c_y"]
        for _ in range(30):
            y = y + (steady - self.elastic(y)) / self.k["c_y"]
        state = np.zeros((self.branches + 1 + self.has["F_d"], len(steady)))
        state[0] = y
        return state

    def __call__(self, state: Array, steady: Array, slope: Array) -> Array:
        k, y = self.k, state[0]
        branches = state[1 : self.branches + 1]
        mobility = 1 / (self.damper + slope)
        load = steady - self.elastic(y) - branches.sum(axis=0)
        if self.has["F_d"]:
            load = load - k["F_d"] * state[self.friction]
        rate = mobility * load
        if self.has["d_2"]:
            rate = 2 * rate / (1 + np.sqrt(1 + 4 * mobility * k["d_2"] * np.abs(rate)))
        change = np.empty_like(state)
        change[0] = rate
        change[1 : self.branches + 1] = self.stiffness * rate - self.relaxation * branches
        if self.has["F_d"]:
            most = 1 + k["a_stribeck"] * np.exp(-((rate / k["v_stribeck"]) ** 2))
            change[self.friction] = (rate - np.abs(rate) * state[self.friction] / most) / k["delta_d"]
        return change
