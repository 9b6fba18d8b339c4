"""Points between the minima of several objectives: predicted, and evaluated once each."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mofit.parameters import Array
from mofit.search.ledger import Ledger
from mofit.search.minima import End, Minima

#: Dirichlet concentration of the weights: below 1, most weight lies on few objectives, as on most of the front.
_CONCENTRATION = 0.4
#: Points evaluated in one call.
_BATCH = 64


def compromises(ledger: Ledger, all_minima: Sequence[Minima], rng: np.random.Generator) -> None:
    r"""Spend what is left of the budget on predicted minima of random weighted sums of the objectives.

    With the minimum :math:`u_t` of each objective and the Hessian :math:`B_t` that its descent ended with,

    .. math:: u(\lambda) = \Bigl(\sum_t \lambda_t B_t\Bigr)^{-1} \sum_t \lambda_t B_t u_t, \qquad \lambda \sim
              \mathrm{Dirichlet},

    clipped to the box. Of several minima of an objective, the one nearest to a minimum of the weighted mean is taken,
    for each of those in turn, so that no compromise lies between two modes.

    Parameters
    ----------
    ledger
        Evaluates.
    all_minima
        Of the weighted mean, then of each objective alone.
    rng
        Draws the weights.
    """
    main, singles = all_minima[0], [minima for minima in all_minima[1:] if minima.ends]
    modes = main.ranked
    if not modes or not singles:
        return
    families = [[_nearest(minima.ends, mode) for minima in singles] for mode in modes]
    turn = 0
    while ledger.left > 0:
        family = families[turn % len(families)]
        turn += 1
        weights = rng.dirichlet(np.full(len(family), _CONCENTRATION), min(_BATCH, ledger.left))
        ledger.evaluate(_predicted(family, weights))


def _nearest(ends: Sequence[End], mode: End) -> End:
    return min(ends, key=lambda end: float(np.linalg.norm(end.point - mode.point)))


def _predicted(family: Sequence[End], weights: Array) -> Array:
    hessians = np.stack([np.linalg.pinv(end.inverse, rcond=1e-6, hermitian=True) for end in family])
    pulls = np.stack([hessian @ end.point for hessian, end in zip(hessians, family, strict=True)])
    total = np.einsum("nt,tij->nij", weights, hessians)
    right = np.einsum("nt,ti->ni", weights, pulls)
    floor = 1e-9 * np.trace(total, axis1=1, axis2=2)[:, None, None] * np.eye(total.shape[1])
    return np.clip(np.linalg.solve(total + floor, right[..., None])[..., 0], 0.0, 1.0)
