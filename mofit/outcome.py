"""What an identification found, in memory: plain arrays in unit coordinates, and the problems that explain them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mofit.calibration import Calibration
from mofit.campaign import Campaign
from mofit.problem import Problem
from mofit.profiles import Profile
from mofit.refine import Minimum
from mofit.sample import Chains, Evidence
from mofit.search import SearchResult
from mofit.spread import SpreadProblem

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Mode:
    """A refined cluster with the samples around it.

    Parameters
    ----------
    name
        Of the mode.
    minimum
        With the Hessian that noise and gap ask for.
    noise_hessian
        What it would be for noise alone.
    sampled
        What was sampled: the problem with the gap, quick to evaluate around the minimum.
    evidence
        By bridge sampling.
    weight
        Share in the posterior mass of all modes.
    chains, profile
        The samples, and the profile likelihood of every parameter.
    """

    name: str
    minimum: Minimum
    noise_hessian: Array
    sampled: SpreadProblem
    evidence: Evidence
    weight: float
    chains: Chains
    profile: Profile


@dataclass(frozen=True)
class Fit:
    """Minima of a problem that was not sampled."""

    problem: Problem
    minima: tuple[Minimum, ...]


@dataclass(frozen=True)
class Outcome:
    """Everything that the result tree is made from.

    Parameters
    ----------
    campaign, configuration
        What went in.
    calibrations
        The stages before the main identification.
    problem
        What was refined and sampled.
    dynamic
        What was searched: calibrated parameters held at their estimates.
    search, weights
        The search's points, and the weight of each test in it.
    minima
        All refined minima, best first.
    modes
        Those that carry posterior weight, sampled; best first.
    compared
        Groups of the result tree that hold what the result is held against, see `mofit.compared`.
    seconds, warnings
        Time per stage, and what a reader must know.
    """

    campaign: Campaign
    configuration: Mapping[str, Any]
    calibrations: tuple[Calibration, ...]
    problem: Problem
    dynamic: Problem
    search: SearchResult
    weights: Array
    minima: tuple[Minimum, ...]
    modes: tuple[Mode, ...]
    compared: Mapping[str, xr.Dataset]
    seconds: Mapping[str, float]
    warnings: tuple[str, ...]

    @property
    def converged(self) -> bool:
        """Whether every mode was sampled to the stop rule."""
        return all(mode.chains.converged for mode in self.modes)
