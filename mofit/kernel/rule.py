"""How finely to integrate: measured on a sample, then decided from the stiffness alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mofit.kernel.mesh import Rung
from mofit.kernel.probing import Probing
from mofit.kernel.runner import Choice
from mofit.kernel.steps import RK4, RODAS4
from mofit.kernel.stiffness import Stiffness
from mofit.sobol import sobol

Array = NDArray[np.float64]

#: steps per sampling interval on offer; work grows by about 1.4 from one to the next
_EXPLICIT = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64)
_IMPLICIT = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32)
#: up to so many explicit steps the L-stable method is not tried
_FEW = 6
#: for what no rung integrates to the tolerance: fast oscillations with little damping
_HOPELESS = Rung(RODAS4, 2)
#: where each of them integrates some sets to the tolerance, but none all
_FINEST = Rung(RODAS4, _IMPLICIT[-1])
#: on the number of steps, over what the sample needed
_SAFETY = 1.2
#: so many sets stiffer than a set are held to be like it, or all up to half as stiff again
_AHEAD = 5
#: how far beyond the stiffest of the sample its rung is trusted
_BEYOND = 1.2
#: parameter sets of a calibration: Sobol points, and at most so many corners of the box
_POINTS, _CORNERS = 64, 64
#: a box is sampled logarithmically in parameters whose bounds differ by this factor
_WIDE = 30.0


@dataclass(frozen=True)
class Rule:
    """For one test: the rungs and the stiffness up to which each is taken.

    Parameters
    ----------
    rungs
        Ways to integrate.
    limits
        Ascending, 1/s, one less than rungs: ``rungs[i]`` up to ``limits[i]``, the last one beyond.
    hopeless
        Share of the calibration's parameter sets that no rung integrates to the tolerance.
    """

    rungs: tuple[Rung, ...]
    limits: tuple[float, ...] = ()
    hopeless: float = 0.0

    def choose(self, stiffness: Array) -> Choice:
        """The rung of every parameter set."""
        return Choice(self.rungs, np.searchsorted(self.limits, stiffness))


def calibrate(probing: Probing, tolerance: float, box: tuple[Array, Array]) -> tuple[list[Rule], Stiffness]:
    """Rules for all tests of ``probing``, from what parameter sets throughout the box need.

    Every set of a sample is integrated with more and more steps until doubling them changes its outputs by less
    than the tolerance. All sets up to a stiffness then get the cheapest rung that was enough for those of the sample.
    """
    p = sample_box(*box)
    stiffness = probing.stiffness(p)
    rate = stiffness(p)
    explicit = probing.needed(p, RK4, _EXPLICIT[-1], tolerance, rate)
    implicit = probing.needed(p, RODAS4, _IMPLICIT[-1], tolerance, skip=explicit <= _FEW)
    return [_rule(rate, explicit[:, t], implicit[:, t]) for t in range(explicit.shape[1])], stiffness


def measure(probing: Probing, p: Array, tolerance: float) -> list[Choice]:
    """The cheapest sufficient rung of every parameter set, found by integrating each with more and more steps."""
    explicit = probing.needed(p, RK4, _EXPLICIT[-1], tolerance)
    implicit = probing.needed(p, RODAS4, _IMPLICIT[-1], tolerance, skip=explicit <= _FEW)
    choices = []
    for t in range(explicit.shape[1]):
        rungs = [_cheapest(*steps, _HOPELESS) for steps in zip(explicit[:, t], implicit[:, t], strict=True)]
        known = tuple(dict.fromkeys(rungs))
        choices.append(Choice(known, np.array([known.index(rung) for rung in rungs])))
    return choices


def sample_box(lower: Array, upper: Array) -> Array:
    """Parameter sets throughout a box: a Sobol sequence, its middle and corners; bounds that coincide are kept."""
    lower, upper = np.asarray(lower, dtype=float), np.asarray(upper, dtype=float)
    wide = (lower > 0) & (upper >= _WIDE * lower)
    low, high = lower.copy(), upper.copy()
    low[wide], high[wide] = np.log(lower[wide]), np.log(upper[wide])
    moved = np.flatnonzero(upper > lower)
    if not len(moved):
        return lower[None]
    if 2 ** len(moved) <= _CORNERS:
        corners = np.array(np.meshgrid(*[[0.0, 1.0]] * len(moved))).reshape(len(moved), -1).T
    else:
        corners = np.random.default_rng(0).integers(0, 2, (_CORNERS, len(moved))).astype(float)
    unit = np.zeros((_POINTS + len(corners), len(lower)))
    unit[:, moved] = np.concatenate([sobol(len(moved)).random(_POINTS), corners])
    values = low + unit * (high - low)
    values[:, wide] = np.exp(values[:, wide])
    return np.clip(values, lower, upper)


def _cheapest(explicit: float, implicit: float, otherwise: Rung) -> Rung:
    """The rung with least work of those that suffice; needs may be infinite, or nan where not tried."""
    offers = [
        Rung(scheme, next(steps for steps in ladder if steps >= need))
        for scheme, ladder, need in (
            (RK4, _EXPLICIT, explicit * _SAFETY),
            (RODAS4, _IMPLICIT, implicit * _SAFETY),
        )
        if need <= ladder[-1]
    ]
    return min(offers, key=lambda rung: rung.cost, default=otherwise)


def _rule(rate: Array, explicit: Array, implicit: Array) -> Rule:
    hopeless = ~np.isfinite(explicit) & ~np.isfinite(implicit)
    order = np.argsort(rate[~hopeless], kind="stable")
    rate, explicit, implicit = (values[~hopeless][order] for values in (rate, explicit, implicit))
    share = float(np.mean(hopeless))
    rungs: list[Rung] = []
    limits: list[float] = []
    for i in range(len(rate)):
        # what is stiffer needs no less: the most that any set up to here, and a little on, needed
        end = max(i + _AHEAD, int(np.searchsorted(rate, 1.5 * rate[i])))
        tried = implicit[:end][~np.isnan(implicit[:end])]
        rung = _cheapest(float(np.max(explicit[:end])), float(np.max(tried)) if len(tried) else np.nan, _FINEST)
        if rungs and rungs[-1] == rung:
            limits[-1] = float(rate[i])
        else:
            rungs.append(rung)
            limits.append(float(rate[i]))
    # stiffer than all of the sample: the L-stable method with as many steps as any of it needed
    most = np.max(implicit[np.isfinite(implicit)], initial=_HOPELESS.steps)
    if limits:
        limits[-1] *= _BEYOND
    return Rule((*rungs, _cheapest(np.inf, float(most), _FINEST)), tuple(limits), share)
