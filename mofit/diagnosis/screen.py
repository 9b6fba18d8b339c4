"""Which effects would explain what is left: a score test of every candidate at a fitted hypothesis."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri
from scipy.stats import f as fisher

from mofit.diagnosis.baseline import Fitted
from mofit.diagnosis.candidates import Candidate
from mofit.diagnosis.cause import Cause
from mofit.diagnosis.projection import Projection, project
from mofit.diagnosis.steps import bounded
from mofit.model import Effect

Array = NDArray[np.float64]

#: Share of its length that must be left of an effect beside the parameters; with less, rounding decides.
_LEAST_LEFT = 1e-4


@dataclass(frozen=True)
class Screened:
    r"""The score test of one candidate.

    .. math:: T = r^T M S (S^T M S)^{-1} S^T M r \sim \chi^2_q

    Parameters
    ----------
    candidate
        The effect.
    best
        Point of its grid with the largest T.
    statistic
        T there; of size parts that may only have one sign, 0 if the sign is wrong.
    statistics
        T at every point of the grid, (G,).
    p
        Chance of such a T without the effect: with the noise estimated (F), the supremum over the grid (Davies 1987)
        and one-sided where the sign is known.
    p_holm
        Corrected for the number of candidates (Holm 1979).
    sizes, shifts
        Expected size relative to neutral at every point of the grid, (G, q), and by how much such an effect moves the
        model's parameters if it is left out, in unit coordinates, (G, d).
    size_sd
        Standard deviation of the size at the best point, (q,).
    absorbed
        Share of the effect's power that the model's own parameters take up.
    """

    candidate: Candidate
    best: int
    statistic: float
    statistics: Array
    p: float
    p_holm: float
    sizes: Array
    shifts: Array
    size_sd: Array
    absorbed: float

    @property
    def name(self) -> str:
        """Name of the effect."""
        return self.candidate.name

    @property
    def elsewhere(self) -> Screened | None:
        """The same with the calibration tests having had the effect if they had not, and the reverse; None if alike."""
        causes = self.candidate.causes
        others = [i for i, cause in enumerate(causes) if cause.everywhere != self.cause.everywhere]
        if not others or not np.any(self.statistics[others] > 0):
            return None
        return replace(self, best=max(others, key=lambda i: self.statistics[i]))

    @property
    def effect(self) -> Effect:
        """The effect."""
        return self.candidate.effect

    @property
    def size(self) -> Array:
        """Expected size at the best point of the grid, (q,)."""
        return np.asarray(self.sizes[self.best])

    @property
    def bias(self) -> Array:
        """Shift of the model's parameters that the expected effect causes where it is left out, (d,)."""
        return np.asarray(self.shifts[self.best])

    @property
    def cause(self) -> Cause:
        """The effect at the best point of its grid."""
        return self.candidate.causes[self.best]


def screen(fitted: Fitted, candidates: Iterable[Candidate]) -> list[Screened]:
    """Test every candidate that the fitted hypothesis does not have yet, the most significant first."""
    projection = project(fitted)
    present = {effect.name for effect in fitted.hypothesis.effects}
    found = [_score(projection, candidate) for candidate in candidates if candidate.name not in present]
    order = sorted(range(len(found)), key=lambda i: (found[i].p, -found[i].statistic))
    adjusted = holm([found[i].p for i in order])
    return [replace(found[i], p_holm=p) for i, p in zip(order, adjusted, strict=True)]


def holm(p: Sequence[float]) -> list[float]:
    """Holm's correction of ascending p values."""
    return [min(float(x), 1.0) for x in np.maximum.accumulate(np.array(p) * np.arange(len(p), 0, -1))]


def _score(projection: Projection, candidate: Candidate) -> Screened:
    signs = candidate.signs
    statistics: list[float] = []
    sizes: list[Array] = []
    spreads: list[Array] = []
    left: list[float] = []
    paths: list[Array] = []
    for slopes in candidate.slopes:
        rest = projection.apply(slopes)
        share = float(np.sum(rest**2)) / max(float(np.sum(slopes**2)), np.finfo(float).tiny)
        left.append(share)
        normal = rest.T @ rest
        if not bounded(slopes) or share < _LEAST_LEFT**2 or not np.linalg.cond(normal) < 1e12:
            statistics.append(0.0)
            sizes.append(np.zeros(len(signs)))
            spreads.append(np.full(len(signs), np.inf))
            continue
        size = np.linalg.solve(normal, rest.T @ projection.residual)
        wrong = any(sign * part < 0 for sign, part in zip(signs, size, strict=True))
        statistics.append(0.0 if wrong else float(size @ normal @ size))
        sizes.append(np.asarray(size, dtype=np.float64))
        spreads.append(np.asarray(np.sqrt(np.diag(np.linalg.inv(normal))), dtype=np.float64))
        paths.append(np.asarray(rest / np.linalg.norm(rest), dtype=np.float64))
    best = int(np.argmax(statistics))
    shifts = [projection.absorbed(slopes @ size) for slopes, size in zip(candidate.slopes, sizes, strict=True)]
    return Screened(
        candidate=candidate,
        best=best,
        statistic=statistics[best],
        statistics=np.array(statistics),
        p=_chance(statistics[best], len(signs), signs, paths, _freedom(projection, candidate.slopes[best])),
        p_holm=1.0,
        sizes=np.array(sizes),
        shifts=np.array(shifts),
        size_sd=spreads[best],
        absorbed=1 - left[best],
    )


def _freedom(projection: Projection, slopes: Array) -> float:
    """Degrees of freedom behind the noise of the rows that matter (Satterthwaite)."""
    power = np.sum(slopes**2, axis=1)
    total = power.sum()
    if not total > 0:
        return 1.0
    share = power / total
    return float(1 / np.sum(share / projection.freedom[: len(share)]))


def _chance(statistic: float, parts: int, signs: Sequence[int], paths: Sequence[Array], freedom: float) -> float:
    r"""Chance that the largest T over the grid is as large as this without the effect.

    With one size part, Davies' bound for a Gaussian process of unit variance whose direction turns by the angle V along
    the grid:

    .. math:: P(\sup |Z| > z) \le 2 \Phi(-z) + \frac{V}{\pi} e^{-z^2 / 2}

    half of it where the sign is known; never more than the number of grid points times the first term.
    """
    if statistic <= 0:
        return 1.0
    single = float(fisher.sf(statistic / parts, parts, freedom))
    if parts > 1:
        return min(max(len(paths), 1) * single, 1.0)
    half = 0.5 if signs[0] else 1.0
    inner = [float(np.clip(np.sum(a * b), -1.0, 1.0)) for a, b in pairwise(paths)]
    angle = float(np.sum(np.arccos(np.abs(inner) if not signs[0] else inner)))
    # the normal quantile of the same chance takes the place of z: the noise is estimated
    z = -float(ndtri(max(0.5 * single, 1e-300)))
    bound = half * (single + angle / np.pi * float(np.exp(-0.5 * z**2)))
    return min(bound, half * len(paths) * single, 1.0)
