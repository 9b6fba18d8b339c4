"""The last stage of an identification: the posterior around every plausible minimum is sampled."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from mofit._typing import FloatArray
from mofit.identification.emulation import EmulatorCheck, emulated
from mofit.identification.refinement import log_evidence
from mofit.identification.result import PosteriorMode
from mofit.identification.settings import Settings
from mofit.identification.valley_path import along_valley
from mofit.optimize import Minimum, Profile, profile
from mofit.problem import AdjustedPosterior
from mofit.runtime.progress import Progress, silent
from mofit.sampling import (
    Chains,
    Evidence,
    bridge_log_evidence,
    laplace_covariance,
    mode_region,
    mode_weights,
    restricted,
    sample_mode,
)

#: Draws per chain below which a mode counts as not sampled: the evidence is fitted to half of them.
FEWEST_DRAWS = 32


def sample_modes(
    located: Sequence[tuple[Minimum, AdjustedPosterior]],
    settings: Settings,
    path: Path | None = None,
    progress: Progress = silent,
    until: float = math.inf,
) -> tuple[PosteriorMode, ...]:
    """Sample around every plausible minimum.

    Parameters
    ----------
    located
        From `mofit.identification.stages.adjusted_modes`.
    settings
        Settings of the identification.
    path
        File for the chains, from which an interrupted run is resumed; nothing is written without one.
    progress
        Called now and then.
    until
        Time of `time.monotonic` at which sampling ends with what there is.

    Returns
    -------
    tuple of PosteriorMode
        Best first, with their posterior probabilities.
    """
    values, centres = [minimum.value for minimum, _ in located], np.stack([minimum.point for minimum, _ in located])
    covariances = np.stack([laplace_covariance(minimum.hessian) for minimum, _ in located])
    sampled = []
    for index, (minimum, adjusted) in enumerate(located):
        belongs = mode_region(index, values, centres, covariances)
        within = partial(restricted, belongs=belongs) if len(located) > 1 else _anywhere
        quick, check = _quick(adjusted, minimum, covariances[index], settings, len(located) - index, within, progress)
        if quick is None:
            sampled.append(_unsampled_mode(f"m{index + 1}", minimum, adjusted, check))
            continue
        own = within(quick.log_posterior)
        profiles = profile(quick, minimum.point, np.sqrt(np.diag(covariances[index])))
        valley = along_valley(quick.evaluate, minimum.point, minimum.hessian)
        if valley is not None and len(located) > 1:  # it may lead on into another mode
            valley = valley.selected(belongs(valley.means))
        name, left = f"m{index + 1}", until - time.monotonic()
        chains, evidence = _unsampled(minimum)
        if settings.sample and left > 0:
            drawn = sample_mode(
                own,
                minimum.point,
                covariances[index],
                (settings.seed, index + 1),
                settings.sampling,
                valley=valley,
                backend_path=path,
                mode=name,
                progress=partial(progress, f"sample mode {index + 1} of {len(located)}"),
                until=time.monotonic() + left / (len(located) - index),
            )
            if drawn.thinned().points.shape[1] >= FEWEST_DRAWS:
                chains, evidence = drawn, bridge_log_evidence(own, drawn.thinned(), settings.seed)
        along = None if valley is None else valley.means
        near, noise_hessian = adjusted.problem.main, adjusted.noise_hessian
        mode = PosteriorMode(name, minimum, noise_hessian, near, quick, evidence, 1.0, chains, profiles, along, check)
        sampled.append(mode)
    probabilities = mode_weights([mode.evidence.log_evidence for mode in sampled])
    return tuple(replace(mode, probability=float(p)) for mode, p in zip(sampled, probabilities, strict=True))


LogPosterior = Callable[[FloatArray], FloatArray]


def _anywhere(log_posterior: LogPosterior) -> LogPosterior:
    return log_posterior


def _quick(
    adjusted: AdjustedPosterior,
    minimum: Minimum,
    covariance: FloatArray,
    settings: Settings,
    modes_left: int,
    within: Callable[[LogPosterior], LogPosterior],
    progress: Progress,
) -> tuple[AdjustedPosterior | None, EmulatorCheck | None]:
    """The posterior, quick to evaluate around its minimum, and how good its emulator is, if it has one.

    None for a user's simulator that is not to be sampled, or where too few simulations are left for an emulator.
    """
    if adjusted.problem.main.evaluations is None:
        return adjusted.local(minimum.point, np.sqrt(np.diag(covariance))), None
    if not settings.sample:
        return None, None
    adjusted.problem.main.evaluations.reserved.pop("emulator", None)
    share, tell = 1 / modes_left, partial(progress, "emulate")
    quick, check = emulated(
        adjusted, minimum.point, covariance, settings.seed, share=share, within=within, progress=tell
    )
    return (None if quick is adjusted else quick), check


@dataclass(frozen=True)
class _Quadratic:
    """A posterior by the Laplace approximation."""

    minimum: Minimum

    def evaluate(self, u: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Negative log density (N,), gradient (N, d) and Hessian (N, d, d)."""
        step, hessian = u - self.minimum.point, self.minimum.hessian
        gradient = self.minimum.gradient + step @ hessian
        value = self.minimum.value + step @ self.minimum.gradient + 0.5 * np.einsum("ni,ij,nj->n", step, hessian, step)
        return value, gradient, np.tile(hessian, (len(u), 1, 1))


def _unsampled_mode(
    name: str, minimum: Minimum, adjusted: AdjustedPosterior, check: EmulatorCheck | None
) -> PosteriorMode:
    """A mode of a costly simulator as the Laplace approximation has it."""
    chains, evidence = _unsampled(minimum)
    sd = np.sqrt(np.diag(laplace_covariance(minimum.hessian)))
    profiles: Profile = profile(_Quadratic(minimum), minimum.point, sd)
    near, noise_hessian = adjusted.problem.main, adjusted.noise_hessian
    return PosteriorMode(name, minimum, noise_hessian, near, adjusted, evidence, 1.0, chains, profiles, None, check)


def _unsampled(minimum: Minimum) -> tuple[Chains, Evidence]:
    """What stands in the place of chains: none, and the evidence by the Laplace approximation."""
    reason = "not sampled: standard deviations are those of the Laplace approximation"
    return Chains.none(len(minimum.point), reason), Evidence(log_evidence(minimum), np.nan)
