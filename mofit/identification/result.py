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
from mofit.problem import AdjustedPosterior, CampaignPosterior, Problem
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
class Located:
    """What the stages before the sampling found.

    Parameters
    ----------
    calibrations
        The stages before the main identification.
    searched
        What was searched, calibrated parameters fixed at their estimates; its noise as at the best minimum.
    search, weights
        The search's points, and the weight of each test in it.
    posterior
        What was refined and is sampled; its noise likewise.
    minima
        All refined minima, best first.
    warnings
        To the reader.
    """

    calibrations: tuple[Calibration, ...]
    searched: Problem
    search: SearchResult
    weights: FloatArray
    posterior: CampaignPosterior
    minima: tuple[Minimum, ...]
    warnings: tuple[str, ...]

    @property
    def problem(self) -> Problem:
        """The tests of the main identification."""
        return self.posterior.main


@dataclass(frozen=True)
class IdentificationResult(Located):
    """The content of the result tree.

    Parameters
    ----------
    campaign, configuration
        What went in.
    modes
        The plausible minima, sampled; most probable first.
    references
        Groups of the result tree with the reference fits, see `mofit.identification.reference_fits`.
    seconds
        Per stage.
    """

    campaign: Campaign
    configuration: Mapping[str, Any]
    modes: tuple[PosteriorMode, ...]
    references: Mapping[str, xr.Dataset]
    seconds: Mapping[str, float]

    @property
    def converged(self) -> bool:
        """Whether every mode was sampled to the stop rule."""
        return all(mode.chains.converged for mode in self.modes)
