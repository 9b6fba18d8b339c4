"""The sampling of one mode as a state that can be stored and continued."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mofit._typing import FloatArray
from mofit.sampling.convergence import outliers
from mofit.sampling.ensemble import Ensemble, LogPosterior, advance, start
from mofit.sampling.independence_proposal import QUICK, StudentTMixture, best_proposal
from mofit.sampling.moves import moves
from mofit.sampling.settings import SampleSettings


@dataclass(frozen=True)
class Run:
    """All ensembles of one mode and what their next step depends on."""

    ensembles: tuple[Ensemble, ...]
    """Their chains are emptied at the end of burn-in."""
    proposal: StudentTMixture
    tau: FloatArray
    """Autocorrelation times at the last check, shape (d,); infinite before the first."""
    time: float = 1.0
    """Autocorrelation time that the proposal is predicted to leave; 1 for the Laplace approximation."""
    rounds: int = 0
    burned: int = 0
    """Steps of burn-in."""
    level: float = -np.inf
    """Mean log posterior over the last round."""
    settled: bool = False
    """The burn-in is over."""
    producing: bool = False
    """The chains are production chains; the proposal is frozen."""
    refits: int = 0
    """How often the proposal was fitted again to production chains."""
    evaluations: int = 0
    """Log posteriors computed so far."""

    @property
    def steps(self) -> int:
        """Production steps so far."""
        return len(self.ensembles[0].chain) if self.producing else 0


def begin(
    log_posterior: LogPosterior, around: StudentTMixture, seed: np.random.SeedSequence, settings: SampleSettings
) -> Run:
    """Walkers drawn from what is known of the posterior, each ensemble with a seed of its own."""
    dimension = around.means.shape[1]
    walkers = settings.walkers_for(dimension)
    started = [start(log_posterior, around, walkers, own) for own in seed.spawn(settings.ensembles)]
    return Run(
        ensembles=tuple(ensemble for ensemble, _ in started),
        proposal=around,
        tau=np.full(dimension, np.inf),
        evaluations=sum(count for _, count in started),
    )


def burn_in(log_posterior: LogPosterior, run: Run, settings: SampleSettings) -> Run:
    """One round of burn-in: step, then fit the proposal to the later half of all positions.

    Burn-in ends when the mean log posteriors of two successive rounds agree within `settled_errors` standard errors
    (walkers counted as independent, steps not) and it has lasted `settled_times` predicted autocorrelation times, or
    after `max_rounds`. Rounds grow with the burn-in.
    """
    steps = max(settings.round_steps, run.burned // 3)
    moved = _advanced(log_posterior, run, settings, steps)
    points = np.concatenate([ensemble.chain for ensemble in moved.ensembles], axis=1)
    values = np.concatenate([ensemble.chain_log_prob for ensemble in moved.ensembles], axis=1)
    kept = ~outliers(points[-1], values[-1], settings.outlier_deviations)
    level = float(values[-steps // 2 :, kept].mean())
    error = float(values[-steps // 2 :, kept].std()) / np.sqrt(kept.sum())
    every = 1 + len(points) * kept.sum() // (2 * settings.fitted_draws)
    later = slice(len(points) // 2, None, every)
    proposal, time = best_proposal(
        points[later, kept].reshape(-1, points.shape[2]), values[later, kept].ravel(), run.proposal
    )
    rounds, burned = run.rounds + 1, run.burned + steps
    steady = abs(level - run.level) <= settings.settled_errors * error and burned >= settings.settled_times * time
    steady = steady and rounds >= settings.min_rounds
    settled = steady or rounds >= settings.max_rounds
    return replace(moved, proposal=proposal, time=time, rounds=rounds, burned=burned, level=level, settled=settled)


def produce(run: Run, settings: SampleSettings) -> Run:
    """Empty chains and a frozen proposal; walkers lost during burn-in restart from others of their ensemble."""
    positions = np.concatenate([ensemble.positions for ensemble in run.ensembles])
    values = np.concatenate([ensemble.log_prob for ensemble in run.ensembles])
    lost = outliers(positions, values, settings.outlier_deviations).reshape(len(run.ensembles), -1)
    gathered = tuple(_gathered(ensemble, gone) for ensemble, gone in zip(run.ensembles, lost, strict=True))
    return replace(run, producing=True, ensembles=gathered)


def extend(log_posterior: LogPosterior, run: Run, settings: SampleSettings, steps: int, tau: FloatArray) -> Run:
    """More production steps; `tau` is kept to see how it changes."""
    return replace(_advanced(log_posterior, run, settings, steps), tau=tau)


def refit(run: Run, tau: FloatArray, settings: SampleSettings) -> Run:
    """The same run, or production anew with a proposal fitted to its chains, where that is the shorter way.

    A burn-in may have seen too little of a long or bent posterior. Then the autocorrelation time ``tau`` (d,) is far
    longer than the proposal promised, or than a good one has, and the chains know better.
    """
    longest = float(tau.max())
    due = settings.refit_steps * 2**run.refits
    promised = min(run.time, QUICK)
    if run.refits == settings.most_refits or run.steps < due or not longest > settings.slower * promised:
        return run
    points = np.concatenate([ensemble.chain for ensemble in run.ensembles], axis=1)
    values = np.concatenate([ensemble.chain_log_prob for ensemble in run.ensembles], axis=1)
    every = 1 + values.size // (2 * settings.fitted_draws)
    proposal, time = best_proposal(points[::every].reshape(-1, points.shape[2]), values[::every].ravel(), run.proposal)
    tried = replace(run, refits=run.refits + 1)
    if settings.tau_multiple * (longest - settings.slower * time) < run.steps:
        return tried
    burned = run.burned + run.steps
    return produce(replace(tried, proposal=proposal, time=time, burned=burned, tau=np.full_like(tau, np.inf)), settings)


def _advanced(log_posterior: LogPosterior, run: Run, settings: SampleSettings, steps: int) -> Run:
    ensembles = advance(log_posterior, run.ensembles, moves(run.proposal, run.time, settings), steps)
    evaluations = steps * sum(len(ensemble.positions) for ensemble in ensembles)
    return replace(run, ensembles=ensembles, evaluations=run.evaluations + evaluations)


def _gathered(ensemble: Ensemble, lost: NDArray[np.bool_]) -> Ensemble:
    """The ensemble with an empty chain, its lost walkers on places where others of its later burn-in have been."""
    if not lost.any() or lost.all():
        return Ensemble.at(ensemble.positions, ensemble.log_prob, ensemble.random_state)
    random = ensemble.generator()
    step = random.randint(len(ensemble.chain) // 2, len(ensemble.chain), size=lost.sum())
    walker = random.choice(np.flatnonzero(~lost), size=lost.sum())
    positions, log_prob = ensemble.positions.copy(), ensemble.log_prob.copy()
    positions[lost] = ensemble.chain[step, walker]
    log_prob[lost] = ensemble.chain_log_prob[step, walker]
    return Ensemble.at(positions, log_prob, random.get_state())
