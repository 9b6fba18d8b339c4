"""What a refinement hands over."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mofit.parameters import Array

Status = Literal["converged", "joined", "stalled", "limit", "failed"]
"""How a start ended: ``converged``; ``joined`` (came close to a better one and shares its end); ``stalled`` (no step
improves the value); ``limit`` (of iterations); ``failed`` (the start itself could not be evaluated)."""


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
    gradient_norms
        Largest projected gradient component in standard deviations, see `scaled_gradient`, shape (K,).
    converged
        Shape (K,). A start that stalled on rounding within the tolerance of `RefineSettings` counts as converged.
    status
        How each ended.
    at_bound
        -1 at the lower, 1 at the upper bound with the value still falling outwards, else 0; shape (K, d).
    evaluations
        Points evaluated in all (value, gradient and Hessian together count once).
    iterations
        Batched calls of the evaluation.
    """

    points: Array
    values: Array
    gradients: Array
    hessians: Array
    gradient_norms: Array
    converged: NDArray[np.bool_]
    status: tuple[Status, ...]
    at_bound: NDArray[np.int64]
    evaluations: int
    iterations: int


@dataclass(frozen=True)
class Minimum:
    """One distinct minimum; see `Refined` for the units.

    Parameters
    ----------
    point, value, gradient, hessian
        Position in the unit cube, and the negative log posterior there with its derivatives.
    gradient_norm, converged, at_bound
        As in `Refined`.
    members
        Rows of `Refined` that ended in this minimum, the best first.
    """

    point: Array
    value: float
    gradient: Array
    hessian: Array
    gradient_norm: float
    converged: bool
    at_bound: NDArray[np.int64]
    members: tuple[int, ...]
