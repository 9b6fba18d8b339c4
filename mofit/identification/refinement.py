"""Refinement: from the starts of a search to exact minima, and which of them are plausible."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np

from mofit._typing import FloatArray
from mofit.errors import InputError
from mofit.identification.descents import descend, settings_for
from mofit.identification.settled_noise import with_settled_noise
from mofit.optimize import STAGES, Minimum, merge
from mofit.problem import CampaignPosterior, Problem, explained
from mofit.sampling import laplace_log_evidence, mode_weights

P = TypeVar("P", bound=CampaignPosterior)

#: Minima of the searched parameters with less posterior probability are not refined with the calibrated ones free:
#: freeing these can raise a probability, but not a thousandfold.
LEAST_PROBABILITY = 1e-6
#: Standard deviation, in box widths, of where a minimum moves when the calibrated parameters become free.
NEIGHBOURHOOD = 0.01


def refined(
    problem: P, starts: FloatArray, found_by: Sequence[str] = (), until: float = math.inf
) -> tuple[P, tuple[Minimum, ...]]:
    """Refine, estimate the noise at the best minimum, and refine again under that noise.

    Of the starts that end in one minimum, the one from the earliest stage of the search found it. ``until`` is that of
    `RefineSettings`.
    """
    settings = settings_for(problem.main, until=until)
    with explained(problem.main):
        first = _with_stage(merge(descend(problem, starts, settings)), found_by or [""] * len(starts))
    if not first:
        raise InputError.of("refinement", "every start failed", "Check the model, or narrow the bounds")
    counted = with_settled_noise(problem, first[0].point)
    again = descend(counted, np.stack([minimum.point for minimum in first]), settings)
    merged = merge(again, values=lambda u: -counted.log_posterior(u))
    return counted, _with_stage(merged, [minimum.found_by for minimum in first])


def _with_stage(minima: Sequence[Minimum], found_by: Sequence[str]) -> tuple[Minimum, ...]:
    def first(stages: set[str]) -> str:
        return next((stage for stage in STAGES if stage in stages), "")

    return tuple(replace(one, found_by=first({found_by[member] for member in one.members})) for one in minima)


def with_calibrated_free(
    posterior: CampaignPosterior, searched: Problem, minima: Sequence[Minimum], until: float
) -> tuple[CampaignPosterior, tuple[Minimum, ...]]:
    """Estimate the calibrated parameters as well, starting from the plausible minima of the searched ones."""
    kept = plausible(minima, LEAST_PROBABILITY)
    candidates = np.stack([minimum.point for minimum in kept])
    space = posterior.space
    starts = space.to_unit(searched.layout.values(candidates, space.names))
    local = posterior.with_noise(searched.noise).near(starts, np.full(len(space), NEIGHBOURHOOD))
    return refined(local, starts, [minimum.found_by for minimum in kept], until)


def plausible(minima: Sequence[Minimum], least_probability: float) -> list[Minimum]:
    """Minima by posterior probability (Laplace approximation), the most probable first, down to the least."""
    with np.errstate(all="ignore"):  # where an integration nearly diverges, derivatives are beyond all bounds
        evidence = np.array([log_evidence(minimum) for minimum in minima])
    known = np.isfinite(evidence)
    values = np.array([minimum.value for minimum in minima])
    evidence = np.where(known, evidence, -np.inf) if known.any() else -values
    weights = mode_weights(evidence)
    return [minima[i] for i in np.argsort(-evidence, kind="stable") if weights[i] >= least_probability]


def log_evidence(minimum: Minimum) -> float:
    """Laplace approximation of the log evidence of a minimum."""
    return laplace_log_evidence(minimum.value, minimum.hessian, minimum.point, minimum.gradient)
