"""Which of the refined points are the same minimum."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from mofit.parameters import Array
from mofit.refine.closeness import Closeness, close_pairs
from mofit.refine.result import Minimum, Refined

Values = Callable[[Array], Array]
"""Points (N, d) of the unit cube to the negative log posterior (N,), nan where it fails."""


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

    Points are taken from the best to the worst; each joins the first minimum that it equals, else it is a new one. It
    equals a minimum u if

    - it is close (`close_pairs`); or
    - `values` is given and no hill lies between the two (hill-valley test). This joins points along a flat
      valley, and points that ended early on the slope of a better minimum.

    A curved valley may still be cut into several minima. Failed starts are left out.

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
        gradient_norm=float(refined.gradient_norms[best]),
        converged=bool(refined.converged[best]),
        at_bound=refined.at_bound[best],
        members=tuple(group),
    )
