"""The noise of several outputs and the minimum under it, estimated in turn until they agree."""

from __future__ import annotations

from typing import TypeVar

import numpy as np

from mofit._typing import FloatArray
from mofit.identification.descents import descend, settings_for
from mofit.optimize import merge
from mofit.problem import CampaignPosterior

P = TypeVar("P", bound=CampaignPosterior)

#: Most rounds, and the relative change of the weights below which another would change no estimate.
ROUNDS, SETTLED = 8, 0.05


def with_settled_noise(problem: P, point: FloatArray) -> P:
    """The problem with its noise estimated at a minimum (d,) under equal weights.

    The noise of several outputs may differ by orders of magnitude. At the minimum under equal weights the residual of a
    quiet output holds what the noise of a loud one did to the estimate, and looks like a gap. There the noise is
    estimated again at the minimum under the noise found, until the weights of the objectives hardly change.
    """
    counted = problem.with_noise_at(point)
    if len(problem.main.model.outputs) == 1:
        return counted
    for _ in range(ROUNDS):
        found = merge(descend(counted, point[None], settings_for(problem.main)))
        if not found:
            break
        point, former = found[0].point, counted.main.noise.weights
        counted = counted.with_noise_at(point)
        if np.max(np.abs(_share(counted.main.noise.weights) / _share(former) - 1)) < SETTLED:
            break
    return counted


def _share(weights: FloatArray) -> FloatArray:
    return weights / weights.sum()
