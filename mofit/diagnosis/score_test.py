"""Score tests (Lagrange multiplier tests): which effects would explain the residual of a fitted hypothesis."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.special import fdtrc, ndtri

from mofit._typing import FloatArray
from mofit.data.signals import thin_svd
from mofit.diagnosis.candidates import Candidate
from mofit.diagnosis.discrepancy import Discrepancy
from mofit.diagnosis.fitting import Fitted
from mofit.diagnosis.integration import stable
from mofit.diagnosis.projection import Projection, project
from mofit.models import Effect

#: Share of its length that must be left of a sensitivity beside the parameters'; with less, rounding decides.
_LEAST_LEFT = 1e-4


@dataclass(frozen=True)
class ScoreTest:
    r"""The score test of one candidate.

    .. math:: T = r^T M S (S^T M S)^{-1} S^T M r \sim \chi^2_q

    with the whitened residual r (rows,), the sensitivity S (rows, c), and the projector M (`Projection`).

    Parameters
    ----------
    candidate
        The effect.
    best
        Point of its grid with the largest T.
    statistic
        T there; of size components that may only have one sign, 0 if the sign is wrong.
    statistics
        T at every point of the grid, (G,).
    p_value
        With the noise estimated (F), for the supremum over the grid (Davies 1987), one-sided where the sign is known.
    p_holm
        Corrected for the number of candidates (Holm 1979).
    sizes, biases
        Expected size relative to neutral at every point of the grid, (G, c), and by how much such an effect moves the
        model's parameters if it is left out, in unit coordinates, (G, d).
    size_sd
        Standard deviation of the size at the best point, (c,).
    confounding
        Share of the effect's power that the model's own parameters absorb, :math:`1 - \|MS\|^2 / \|S\|^2`.
    """

    candidate: Candidate
    best: int
    statistic: float
    statistics: FloatArray
    p_value: float
    p_holm: float
    sizes: FloatArray
    biases: FloatArray
    size_sd: FloatArray
    confounding: float

    @property
    def name(self) -> str:
        """Name of the effect."""
        return self.candidate.name

    @property
    def effect(self) -> Effect:
        """The effect."""
        return self.candidate.effect

    @property
    def discrepancy(self) -> Discrepancy:
        """The effect at the best point of its grid."""
        return self.candidate.discrepancies[self.best]

    @property
    def size(self) -> FloatArray:
        """Expected size at the best point of the grid, (q,)."""
        return self.candidate.columns.expected(self.sizes[self.best])

    @property
    def promise(self) -> float:
        """T, less what chance gives columns beyond one per component of the size."""
        columns = len(self.candidate.columns.size)
        return self.statistic - (columns - len(self.effect.size)) if self.candidate.columns.scoped else self.statistic

    @property
    def sensitivity(self) -> FloatArray:
        """What the expected effect adds per unit of its size, (rows, q): what differs between tests as it is there."""
        return self.candidate.columns.shared(self.candidate.sensitivities[self.best], self.sizes[self.best])

    @property
    def bias(self) -> FloatArray:
        """Shift of the model's parameters that the expected effect causes where it is left out, (d,)."""
        return np.asarray(self.biases[self.best])

    def farther(self, factor: float) -> ScoreTest:
        """The same as if a multiple of the size were expected."""
        return replace(self, sizes=factor * self.sizes, biases=factor * self.biases)

    @property
    def alternative(self) -> ScoreTest | None:
        """The same with the effect present in the calibration tests if it was not, or the reverse; None if equal."""
        present = [one.present_in_calibration for one in self.candidate.discrepancies]
        others = [i for i, here in enumerate(present) if here != present[self.best]]
        if not others or not np.any(self.statistics[others] > 0):
            return None
        return replace(self, best=max(others, key=lambda i: self.statistics[i]))


def score_tests(fitted: Fitted, candidates: Iterable[Candidate]) -> list[ScoreTest]:
    """Test every candidate that the fitted hypothesis does not have yet, the most significant first."""
    projection = project(fitted)
    freedom = _degrees_of_freedom(fitted, len(projection.basis))
    present = {effect.name for effect in fitted.hypothesis.effects}
    found = [_score(projection, freedom, candidate) for candidate in candidates if candidate.name not in present]
    found.sort(key=lambda one: (one.p_value, -one.statistic))
    adjusted = holm([one.p_value for one in found])
    return [replace(one, p_holm=p) for one, p in zip(found, adjusted, strict=True)]


def _degrees_of_freedom(fitted: Fitted, rows: int) -> FloatArray:
    """Of the noise of every row (rows,): of the tests, of the stages' estimates, and of the box."""
    observed = fitted.hypothesis.observed
    prior = len(fitted.residual) - len(observed.measured)
    stages = min((one.freedom for one in observed.calibrations), default=np.inf)
    rest = rows - len(fitted.residual)
    return np.concatenate([observed.degrees_of_freedom, np.full(prior, stages), np.full(rest, np.inf)])


def holm(p: Sequence[float]) -> list[float]:
    """Holm's correction of ascending p-values."""
    return [min(float(x), 1.0) for x in np.maximum.accumulate(np.array(p) * np.arange(len(p), 0, -1))]


def _score(projection: Projection, freedom: FloatArray, candidate: Candidate) -> ScoreTest:
    """The score test with degrees of freedom of the noise of every row (rows,)."""
    signs, points = candidate.signs, len(candidate.sensitivities)
    statistics, left, ranks = np.zeros(points), np.zeros(points), np.full(points, len(signs))
    sizes, sds = np.zeros((points, len(signs))), np.full((points, len(signs)), np.inf)
    directions: list[FloatArray] = []
    for i, columns in enumerate(candidate.sensitivities):
        rest = projection.apply(columns)
        left[i] = float(np.sum(rest**2)) / max(float(np.sum(columns**2)), np.finfo(float).tiny)
        normal = rest.T @ rest
        if not stable(columns) or left[i] < _LEAST_LEFT**2:
            continue
        if candidate.columns.scoped:  # what all tests have in common the model may have already
            sizes[i], statistics[i], ranks[i] = _dependent(rest, projection.residual)
            continue
        if not np.linalg.cond(normal) < 1e12:
            continue
        sizes[i] = np.linalg.solve(normal, rest.T @ projection.residual)
        wrong = any(sign * part < 0 for sign, part in zip(signs, sizes[i], strict=True))
        statistics[i] = 0.0 if wrong else float(sizes[i] @ normal @ sizes[i])
        sds[i] = np.sqrt(np.diag(np.linalg.inv(normal)))
        directions.append(rest / np.linalg.norm(rest))
    best = int(np.argmax(statistics))
    biases = [projection.absorbed(columns @ size) for columns, size in zip(candidate.sensitivities, sizes, strict=True)]
    # degrees of freedom behind the rows that matter (Satterthwaite)
    power = np.sum(projection.apply(candidate.sensitivities[best]) ** 2, axis=1)
    behind = float(1 / np.sum(power / power.sum() / freedom)) if power.sum() > 0 else 1.0
    return ScoreTest(
        candidate=candidate,
        best=best,
        statistic=float(statistics[best]),
        statistics=statistics,
        p_value=supremum_p_value(float(statistics[best]), signs[: ranks[best]], directions, behind),
        p_holm=1.0,
        sizes=sizes,
        biases=np.array(biases),
        size_sd=sds[best],
        confounding=float(1 - left[best]),
    )


def _dependent(columns: FloatArray, residual: FloatArray) -> tuple[FloatArray, float, int]:
    """Sizes (c,), statistic and rank of columns (rows, c) that may depend on each other; the smallest such sizes."""
    length = np.maximum(np.linalg.norm(columns, axis=0), np.finfo(float).tiny)
    left, values, right = thin_svd(columns / length)
    kept = values > _LEAST_LEFT * values[0]
    along = left[:, kept].T @ residual
    return (right[kept].T @ (along / values[kept])) / length, float(along @ along), int(kept.sum())


def supremum_p_value(
    statistic: float, signs: Sequence[int], directions: Sequence[FloatArray], degrees_of_freedom: float
) -> float:
    r"""p-value of the largest T over a grid.

    With one size component, Davies' bound for a Gaussian process of unit variance whose direction turns by the angle V
    along the grid:

    .. math:: P(\sup |Z| > z) \le 2 \Phi(-z) + \frac{V}{\pi} e^{-z^2 / 2}

    half of it where the sign is known; never more than the number of grid points times the first term.

    Parameters
    ----------
    statistic
        The largest T.
    signs
        Per size component: 1 or -1 where only that sign is possible, else 0.
    directions
        M S at the points of the grid, of unit length, (rows, q) each.
    degrees_of_freedom
        Of the noise estimate.

    References
    ----------
    Davies: Hypothesis testing when a nuisance parameter is present only under the alternative. Biometrika 74 (1987).
    """
    if statistic <= 0:
        return 1.0
    single = float(fdtrc(len(signs), degrees_of_freedom, statistic / len(signs)))
    if len(signs) > 1:
        return min(max(len(directions), 1) * single, 1.0)
    half = 0.5 if signs[0] else 1.0
    inner = [float(np.clip(np.sum(a * b), -1.0, 1.0)) for a, b in pairwise(directions)]
    angle = float(np.sum(np.arccos(np.abs(inner) if not signs[0] else inner)))
    # the normal quantile of the same probability replaces z: the noise is estimated
    z = -float(ndtri(max(0.5 * single, 1e-300)))
    bound = half * (single + angle / np.pi * float(np.exp(-0.5 * z**2)))
    return min(bound, half * len(directions) * single, 1.0)
