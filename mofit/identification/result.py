"""The result of an identification in memory: arrays in unit coordinates, and the problems they belong to."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from mofit._typing import FloatArray
from mofit.data import Campaign
from mofit.identification.calibration import Calibration
from mofit.identification.emulation import EmulatorCheck
from mofit.identification.findings import Finding
from mofit.identification.law_study import LawStudy
from mofit.optimize import Minimum, Profile, SearchResult
from mofit.problem import AdjustedPosterior, CampaignPosterior, Problem
from mofit.sampling import Chains, Evidence


@dataclass(frozen=True)
class PosteriorMode:
    """A posterior mode with its samples and profile likelihoods."""

    name: str
    minimum: Minimum
    """Of the adjusted negative log posterior, with its Hessian."""
    noise_hessian: FloatArray
    """The Hessian for noise alone."""
    near: Problem
    """The tests, integrated for the neighbourhood of the minimum: in fewer steps than the whole box takes."""
    sampled: AdjustedPosterior
    """The adjusted posterior, quick to evaluate around the minimum."""
    evidence: Evidence
    probability: float
    """Posterior probability of the mode."""
    chains: Chains
    """Without a step where the mode was not sampled."""
    profile: Profile
    path: FloatArray | None = None
    """Points along its valley, if that bends, shape (K, d)."""
    emulator: EmulatorCheck | None = None
    """How good the emulator is that was sampled, if one was."""

    @property
    def is_sampled(self) -> bool:
        """Whether there are draws."""
        return self.chains.steps > 0

    def unconverged(self, names: Sequence[str]) -> str:
        """Why its chains have not converged, which parameter mixes worst, and what to do; empty if they have."""
        if self.chains.converged:
            return ""
        text = f"{self.name}: {'; '.join(self.chains.reasons)}."
        if not self.is_sampled:
            return text
        worst = names[int(np.argmax(self.chains.tau))]
        cure = f"narrow its range (--bounds {worst}=…), fix it (--fix {worst}=…) or measure what determines it"
        return f"{text} {worst} mixes worst: {cure} (mofit design)."


@dataclass(frozen=True)
class LocalFit:
    """Minima of a problem that was not sampled."""

    problem: Problem
    minima: tuple[Minimum, ...]


@dataclass(frozen=True)
class Located:
    """What the stages before the sampling found."""

    calibrations: tuple[Calibration, ...]
    searched: Problem
    """Calibrated parameters fixed at their estimates (free with ``joint``), noise as at the best minimum."""
    search: SearchResult
    weights: FloatArray
    """Of each test in the search, shape (tests,)."""
    posterior: CampaignPosterior
    """What was refined and is sampled, noise likewise."""
    minima: tuple[Minimum, ...]
    """All refined minima of the posterior, best first."""
    warnings: tuple[str, ...]
    """Sentences on stages without tests and on ranges that were widened."""
    findings: tuple[Finding, ...]
    """What a reader must know before the numbers, as far as the stage knows."""

    @property
    def problem(self) -> Problem:
        """The tests of the main identification."""
        return self.posterior.main


@dataclass(frozen=True)
class IdentificationResult(Located):
    """The content of the result tree."""

    campaign: Campaign
    configuration: Mapping[str, Any]
    modes: tuple[PosteriorMode, ...]
    """The plausible minima, sampled; most probable first."""
    references: Mapping[str, xr.Dataset]
    """Groups of the result tree with the reference fits, see `mofit.identification.reference_fits`."""
    seconds: Mapping[str, float]
    """Per stage."""
    study: LawStudy | None = None
    """What every combination of conditions told alone, where parameters follow laws over conditions."""

    @property
    def converged(self) -> bool:
        """Whether every mode was sampled to the stop rule."""
        return all(mode.chains.converged for mode in self.modes)
