"""The posterior of an identification as draws of all its modes, for studies that compare posteriors."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from mofit._typing import FloatArray
from mofit.data import Campaign
from mofit.identification.settings import Settings
from mofit.identification.stages import find_modes
from mofit.models import Model


@dataclass(frozen=True)
class Draws:
    """Draws of all modes (n, d) in unit coordinates, each weighted by its mode's probability, and what they took."""

    points: FloatArray
    weights: FloatArray
    names: list[str]
    about: dict

    @property
    def mean(self) -> FloatArray:
        """Posterior means, (d,)."""
        return np.average(self.points, axis=0, weights=self.weights)

    @property
    def sd(self) -> FloatArray:
        """Posterior standard deviations, (d,)."""
        return np.sqrt(np.average((self.points - self.mean) ** 2, axis=0, weights=self.weights))

    def below(self, unit: FloatArray) -> FloatArray:
        """Probability below a point (d,), by parameter."""
        return np.average(self.points < unit, axis=0, weights=self.weights)


def draws(campaign: Campaign, model: Model, settings: Settings) -> Draws:
    """The posterior: two identifications may part a curved one into modes in different places."""
    began = time.perf_counter()
    modes = find_modes(campaign, model, settings)
    problem = modes[0].sampled.problem.main
    found = {
        "seconds": time.perf_counter() - began,
        "converged": all(mode.chains.converged for mode in modes),
        "modes": [mode.probability for mode in modes],
    }
    if problem.evaluations is not None:
        checks = [mode.emulator for mode in modes]
        found |= {"simulations": problem.evaluations.count, "error": max(check.error for check in checks)}
        found |= {"trained": sum(check.trained for check in checks)}
    points = [mode.chains.thinned().points.reshape(-1, len(problem.space)) for mode in modes]
    weights = [np.full(len(own), mode.probability / max(len(own), 1)) for own, mode in zip(points, modes, strict=True)]
    return Draws(np.concatenate(points), np.concatenate(weights), list(problem.space.names), found)
