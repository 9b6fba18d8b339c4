"""Sampling the posterior around one minimum with emcee, until it has converged."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from mofit.sampling.chains import Chains, assess
from mofit.sampling.checkpoint import Checkpoints
from mofit.sampling.ensemble import LogPosterior, safe
from mofit.sampling.independence_proposal import FIRST_FREEDOM, StudentTMixture
from mofit.sampling.settings import SampleSettings
from mofit.sampling.state import begin, burn_in, extend, produce, refit

Progress = Callable[[int, int, str], None]
"""Called as ``progress(done, total, note)``."""


def sample_mode(
    log_posterior: LogPosterior,
    centre: ArrayLike,
    covariance: ArrayLike,
    seed: int | Sequence[int],
    settings: SampleSettings | None = None,
    *,
    valley: StudentTMixture | None = None,
    backend_path: str | Path | None = None,
    mode: str = "m1",
    progress: Progress | None = None,
    until: float = math.inf,
) -> Chains:
    """Sample a posterior from one of its minima.

    Several independent ensembles of emcee start from the Gaussian of the Laplace approximation. During burn-in, a
    mixture of Student-t distributions is fitted to all walkers after each round, then frozen. Production goes on in
    chunks until all requirements of the settings hold (length in autocorrelation times, their steadiness, R-hat between
    the ensembles, effective sample size, share of stuck walkers), to `max_steps`, or until the autocorrelation time
    tells that these would not do. Chains that mix far more slowly than the mixture promised start anew with one fitted
    to them.

    Parameters
    ----------
    log_posterior
        Maps points (n, d) in unit coordinates to (n,). Not evaluated outside the cube; nan counts as -inf.
    centre, covariance
        The minimum (d,) and the covariance there (d, d), see `laplace_covariance`.
    seed
        Seed, or seeds, of all randomness. Each ensemble gets a child of it.
    settings
        See `SampleSettings`.
    valley
        What is known of a posterior that is no Gaussian; it takes the place of the Laplace approximation.
    backend_path
        File of chains, replaced atomically. If it holds this mode already, that run is resumed and ends in the same
        numbers as without an interruption.
    mode
        Name of the mode, its group in the file.
    progress
        Called as ``progress(steps, max_steps, note)``.
    until
        Time of `time.monotonic` at which sampling ends with what there is; perhaps no step at all.

    Raises
    ------
    InputError
        If the posterior vanishes around the centre, or if the file holds a run with other settings.

    References
    ----------
    Foreman-Mackey, Hogg, Lang, Goodman: emcee, the MCMC hammer (2013).
    """
    settings = settings or SampleSettings()
    target = safe(log_posterior)
    start = np.asarray(centre, dtype=float)
    deciding = {key: value for key, value in asdict(settings).items() if key != "checkpoint_seconds"}
    origin = {"seed": seed, "settings": deciding, "dimension": len(start)}
    path = None if backend_path is None else Path(backend_path)
    checkpoints = Checkpoints(path, mode, origin, start, settings.checkpoint_seconds)
    run = checkpoints.load()
    if run is None:
        gaussian = StudentTMixture.single(start, np.asarray(covariance, dtype=float), FIRST_FREEDOM)
        run = begin(target, valley or gaussian, np.random.SeedSequence(seed), settings)
    while not run.settled and time.monotonic() < until:
        run = checkpoints.save(burn_in(target, run, settings))
        if progress is not None:
            progress(0, settings.max_steps, f"{mode}: burn-in round {run.rounds}, mean log posterior {run.level:.2f}")
    if not run.producing:
        run = produce(run, settings)
    most = settings.chunk if until < math.inf else settings.max_steps  # the first steps tell how long one takes
    pace = 0.0  # s per step
    while True:
        chains = assess(run, settings)
        if progress is not None:
            progress(run.steps, settings.max_steps, f"{mode}: {'; '.join(chains.reasons) or 'converged'}")
        if chains.converged or run.steps >= settings.max_steps:
            checkpoints.save(run, last=True)
            return chains
        if time.monotonic() + 2 * pace * run.steps < until:  # else there would be fewer draws in the end
            former, run = run, refit(run, chains.tau, settings)
            if run.steps < former.steps:
                checkpoints.save(run)
                continue
        if chains.hopeless(run.tau, settings) or time.monotonic() >= until:
            checkpoints.save(run, last=True)
            return assess(run, settings, last=True)
        steps, began = min(_next_chunk(chains, settings), most), time.monotonic()
        run = checkpoints.save(extend(target, run, settings, steps, chains.tau))
        pace = (time.monotonic() - began) / steps
        most = max(1, int(min((until - time.monotonic()) / pace, settings.max_steps)))


def _next_chunk(chains: Chains, settings: SampleSettings) -> int:
    """Steps to where the chain should be long enough by the present tau; at most as many again as there are."""
    tau = float(chains.tau.max())
    lacking = np.ceil((settings.tau_multiple + 2) * tau) - chains.steps if np.isfinite(tau) else chains.steps
    least, most = max(settings.chunk, chains.steps // 20), max(2 * settings.chunk, chains.steps)
    return int(min(max(least, min(lacking, most)), settings.max_steps - chains.steps))
