"""The result of an identification in memory: arrays in unit coordinates, and the problems they belong to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import xarray as xr

from mofit._typing import FloatArray
from mofit.data import Campaign
from mofit.identification.calibration import Calibration
from mofit.optimize import Minimum, Profile, SearchResult
from mofit.problem import AdjustedPosterior, Problem
from mofit.sampling import Chains, Evidence


@dataclass(frozen=True)
class PosteriorMode:
    """A posterior mode with the samples around it.

    Parameters
    ----------
    name
        Of the mode.
    minimum
        Minimum of the adjusted negative log posterior, with its Hessian.
    noise_hessian
        The Hessian for noise alone, without adjustment.
    sampled
        The adjusted posterior that was sampled, quick to evaluate around the minimum.
    evidence
        By bridge sampling.
    probability
        Posterior probability of the mode.
    chains, profile
        The samples, and the profile likelihood of every parameter.
    """

    name: str
    minimum: Minimum
    noise_hessian: FloatArray
    sampled: AdjustedPosterior
    evidence: Evidence
    probability: float
    chains: Chains
    profile: Profile


@dataclass(frozen=True)
class LocalFit:
    """Minima of a problem that was not sampled."""

    problem: Problem
    minima: tuple[Minimum, ...]


@dataclass(frozen=True)
class IdentificationResult:
    """The content of the result tree.

    Parameters
    ----------
    campaign, configuration
        What went in.
    calibrations
        The stages before the main identification.
    problem
        What was refined and sampled.
    searched
        The problem that was searched: calibrated parameters fixed at their estimates.
    search, weights
        The search's points, and the weight of each test in it.
    minima
        All refined minima, best first.
    modes
        The plausible ones, sampled; most probable first.
    references
        Groups of the result tree with the reference fits, see `mofit.identification.reference_fits`.
    seconds, warnings
        Seconds per stage, and warnings to the reader.
    """

    campaign: Campaign
    configuration: Mapping[str, Any]
    calibrations: tuple[Calibration, ...]
    problem: Problem
    searched: Problem
    search: SearchResult
    weights: FloatArray
    minima: tuple[Minimum, ...]
    modes: tuple[PosteriorMode, ...]
    references: Mapping[str, xr.Dataset]
    seconds: Mapping[str, float]
    warnings: tuple[str, ...]

    @property
    def converged(self) -> bool:
        """Whether every mode was sampled to the stop rule."""
        return all(mode.chains.converged for mode in self.modes)
