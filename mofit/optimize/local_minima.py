"""What a local refinement returns, and which of its points are the same minimum."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mofit._typing import FloatArray

Status = Literal["converged", "merged", "stalled", "limit", "failed"]
"""How a start ended: ``converged``; ``merged`` (came close to a better one and shares its end); ``stalled`` (no step
improves the value); ``limit`` (of iterations, time or hope); ``failed`` (the start itself could not be evaluated)."""
Values = Callable[[FloatArray], FloatArray]
"""Points (N, d) of the unit cube to the negative log posterior (N,), nan where it fails."""


@dataclass(frozen=True)
class Refined:
    """Where each start ended; K starts, d coordinates.

    Parameters
    ----------
    points
        End points in the unit cube, shape (K, d).
    values
        Negative log posterior there, shape (K,); nan for a failed start.
    gradients, hessians
        Its gradient (K, d) and Gauss-Newton Hessian (K, d, d).
    converged
        Shape (K,). A start that stalled on rounding within the tolerance of `RefineSettings` counts as converged.
    status
        How each ended.
    at_bound
        -1 at the lower, 1 at the upper bound with the value still falling outwards, else 0; shape (K, d).
    evaluations
        Points evaluated in all (value, gradient and Hessian together count once).
    """

    points: FloatArray
    values: FloatArray
    gradients: FloatArray
    hessians: FloatArray
    converged: NDArray[np.bool_]
    status: tuple[Status, ...]
    at_bound: NDArray[np.int64]
    evaluations: int


@dataclass(frozen=True)
class Minimum:
    """One distinct minimum; see `Refined` for the units.

    Parameters
    ----------
    point, value, gradient, hessian
        Position in the unit cube, and the negative log posterior there with its derivatives.
    converged, at_bound
        As in `Refined`.
    members
        Rows of `Refined` that ended in this minimum, the best first.
    found_by
        Stage of the search that found it (`SearchResult.found_by`); empty where there is one alone.
    """

    point: FloatArray
    value: float
    gradient: FloatArray
    hessian: FloatArray
    converged: bool
    at_bound: NDArray[np.int64]
    members: tuple[int, ...]
    found_by: str = ""


@dataclass(frozen=True)
class Closeness:
    """Limits on the gap between two points; all of them must hold."""

    deviations: float = 0.5
    """Posterior standard deviations, by the better point's Hessian."""
    width: float = 0.05
    """Box widths, per coordinate: guards directions whose standard deviation is wide."""
    value: float = 0.5
    """Difference of the negative log posterior, in nats."""


def close_pairs(
    points: FloatArray, values: FloatArray, hessians: FloatArray, closeness: Closeness
) -> NDArray[np.bool_]:
    r"""Which point is close to which better one.

    .. math:: \sqrt{\Delta^T H_i \Delta}, \quad \max_k |\Delta_k|, \quad f_j - f_i, \qquad \Delta = u_j - u_i

    are all within the limits. Of equal values, the first counts as the better.

    Parameters
    ----------
    points, values, hessians
        u (K, d), f (K,) and H (K, d, d).

    Returns
    -------
    Shape (K, K), true in [i, j] if j is close to the better point i; nan values are close to none.
    """
    gap = points[None, :, :] - points[:, None, :]
    squared = np.einsum("ijk,ikl,ijl->ij", gap, hessians, gap)
    rise = values[None, :] - values[:, None]
    better = (rise > 0) | ((rise == 0) & np.triu(np.ones_like(rise, dtype=bool), 1))
    near = (squared <= closeness.deviations**2) & (np.abs(gap).max(axis=2) <= closeness.width)
    return near & better & (rise <= closeness.value)


@dataclass(frozen=True)
class MergeSettings:
    """When two refined points are one minimum."""

    closeness: Closeness = field(default_factory=Closeness)
    """Points this close are one minimum whatever lies between them."""
    barrier: float = 1.0
    """Two points are also one minimum if the value on the straight line between them never rises more than this above
    the worse of the two, in nats: a density ratio of e is no obstacle to a sampler."""
    samples: int = 9
    """Interior points of that line (Ursem 1999, the hill-valley test, uses 3 to 10)."""


def merge(refined: Refined, settings: MergeSettings | None = None, values: Values | None = None) -> tuple[Minimum, ...]:
    r"""Distinct minima, best first.

    From the best to the worst, each point belongs to the first minimum that it is close to (`close_pairs`), or from
    which no hill separates it (hill-valley test, if `values` is given: it merges points along a flat valley, and points
    that ended early on the slope of a better minimum); else it is a new one. A curved valley may still be cut into
    several minima. Failed starts are left out.

    Parameters
    ----------
    refined
        Result of `refine`.
    settings
        Tolerances.
    values
        Batched negative log posterior for the hill-valley test.

    References
    ----------
    Ursem: Multinational evolutionary algorithms, CEC 1999.
    """
    settings = settings or MergeSettings()
    close = close_pairs(refined.points, refined.values, refined.hessians, settings.closeness)
    groups: list[list[int]] = []
    for row in np.argsort(refined.values, kind="stable"):
        if np.isnan(refined.values[row]):
            continue
        home = next((group for group in groups if close[group[0], row]), None)
        if home is None and values is not None and groups:
            home = _same_valley(refined, groups, int(row), settings, values)
        if home is None:
            groups.append([int(row)])
        else:
            home.append(int(row))
    return tuple(_minimum(refined, group) for group in groups)


def _same_valley(
    refined: Refined, groups: list[list[int]], row: int, settings: MergeSettings, values: Values
) -> list[int] | None:
    """The first group that no hill separates from the point; all lines are evaluated in one call."""
    along = np.linspace(0.0, 1.0, settings.samples + 2)[1:-1]
    ends = refined.points[[group[0] for group in groups]]
    lines = refined.points[row] + along[None, :, None] * (ends - refined.points[row])[:, None, :]
    heights = np.asarray(values(lines.reshape(-1, lines.shape[-1]))).reshape(len(groups), -1)
    open_way = np.all(heights <= refined.values[row] + settings.barrier, axis=1)  # nan is a hill
    return groups[int(np.argmax(open_way))] if open_way.any() else None


def _minimum(refined: Refined, group: list[int]) -> Minimum:
    best = group[0]
    return Minimum(
        point=refined.points[best],
        value=float(refined.values[best]),
        gradient=refined.gradients[best],
        hessian=refined.hessians[best],
        converged=bool(refined.converged[best]),
        at_bound=refined.at_bound[best],
        members=tuple(group),
    )
