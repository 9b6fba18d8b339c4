"""The sampling of one mode as a state that can be stored and continued."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mofit.parameters import Array
from mofit.sample.ensemble import Ensemble, LogPosterior, advance, fresh, moves, start
from mofit.sample.settings import SampleSettings
from mofit.sample.strays import outliers


@dataclass(frozen=True)
class Run:
    """All ensembles of one mode and what their next step depends on.

    Parameters
    ----------
    ensembles
        The ensembles; during burn-in, their chains hold the last round only.
    mean, scale
        Of the Student-t proposal, shapes (d,) and (d, d).
    rounds
        Rounds of burn-in done.
    level
        Mean log posterior over the last round.
    settled
        The burn-in is over.
    producing
        The chains are production chains; the proposal is frozen.
    tau
        Largest autocorrelation time at the last check; nan before the first.
    evaluations
        Log posteriors computed so far.
    """

    ensembles: tuple[Ensemble, ...]
    mean: Array
    scale: Array
    rounds: int = 0
    level: float = -np.inf
    settled: bool = False
    producing: bool = False
    tau: float = np.nan
    evaluations: int = 0

    @property
    def steps(self) -> int:
        """Production steps so far."""
        return len(self.ensembles[0].chain) if self.producing else 0


def begin(
    log_posterior: LogPosterior,
    centre: Array,
    covariance: Array,
    seed: np.random.SeedSequence,
    settings: SampleSettings,
) -> Run:
    """Walkers drawn from the Laplace approximation, each ensemble with a seed of its own."""
    walkers = settings.walkers_for(len(centre))
    started = [
        start(log_posterior, centre, covariance, walkers, own_seed) for own_seed in seed.spawn(settings.ensembles)
    ]
    return Run(
        tuple(ensemble for ensemble, _ in started), centre, covariance, evaluations=sum(count for _, count in started)
    )


def burn_in(log_posterior: LogPosterior, run: Run, settings: SampleSettings) -> Run:
    """One round of burn-in: step, then fit the proposal to where all walkers are.

    Settled when the mean log posterior of two successive rounds differs by less than four of its standard errors
    (walkers counted as independent, steps not), or after `max_rounds`.
    """
    emptied = replace(run, ensembles=tuple(_emptied(ensemble) for ensemble in run.ensembles))
    moved = _advanced(log_posterior, emptied, settings, settings.round_steps)
    half = settings.round_steps // 2
    points = np.concatenate([ensemble.chain[half:] for ensemble in moved.ensembles], axis=1)
    values = np.concatenate([ensemble.chain_log_prob[half:] for ensemble in moved.ensembles], axis=1)
    crowd = ~outliers(points[-1], values[-1])
    mean, scale = fitted(points[:, crowd], run.scale)

    level = float(values[:, crowd].mean())
    error = float(values[:, crowd].std()) / np.sqrt(crowd.sum())
    rounds = run.rounds + 1
    steady = rounds >= settings.min_rounds and abs(level - run.level) <= 4 * error
    return replace(
        moved, mean=mean, scale=scale, rounds=rounds, level=level, settled=steady or rounds >= settings.max_rounds
    )


def fitted(points: Array, former: Array) -> tuple[Array, Array]:
    r"""Mean and scale matrix of the proposal from walkers, shape (step, walker, d).

    .. math:: S = (n C + d S_0) / (n + d)

    with C the covariance of the points, n the number of walkers (their steps are correlated) and :math:`S_0` the former
    scale matrix, which keeps S positive definite.
    """
    _, count, dimension = points.shape
    flat = points.reshape(-1, dimension)
    covariance = np.cov(flat, rowvar=False).reshape(dimension, dimension)
    return flat.mean(axis=0), (count * covariance + dimension * former) / (count + dimension)


def produce(run: Run) -> Run:
    """Empty chains and a frozen proposal; walkers lost during burn-in restart from others of their ensemble."""
    positions = np.concatenate([ensemble.positions for ensemble in run.ensembles])
    values = np.concatenate([ensemble.log_prob for ensemble in run.ensembles])
    lost = outliers(positions, values).reshape(len(run.ensembles), -1)
    gathered = tuple(_gathered(ensemble, gone) for ensemble, gone in zip(run.ensembles, lost, strict=True))
    return replace(run, producing=True, ensembles=gathered)


def extend(log_posterior: LogPosterior, run: Run, settings: SampleSettings, steps: int, tau: float) -> Run:
    """More production steps; `tau` is kept to see how it changes."""
    return replace(_advanced(log_posterior, run, settings, steps), tau=tau)


def _emptied(ensemble: Ensemble) -> Ensemble:
    return fresh(ensemble.positions, ensemble.log_prob, ensemble.random_state)


def _advanced(log_posterior: LogPosterior, run: Run, settings: SampleSettings, steps: int) -> Run:
    mixture = moves(run.mean, run.scale, settings)
    ensembles = tuple(advance(log_posterior, ensemble, mixture, steps) for ensemble in run.ensembles)
    evaluations = steps * sum(len(ensemble.positions) for ensemble in ensembles)
    return replace(run, ensembles=ensembles, evaluations=run.evaluations + evaluations)


def _gathered(ensemble: Ensemble, lost: NDArray[np.bool_]) -> Ensemble:
    """The ensemble with an empty chain, its lost walkers on places where others of its last round have been."""
    if not lost.any() or lost.all():
        return _emptied(ensemble)
    random = np.random.RandomState()
    random.set_state(ensemble.random_state)
    step = random.randint(len(ensemble.chain), size=lost.sum())
    walker = random.choice(np.flatnonzero(~lost), size=lost.sum())
    positions, log_prob = ensemble.positions.copy(), ensemble.log_prob.copy()
    positions[lost] = ensemble.chain[step, walker]
    log_prob[lost] = ensemble.chain_log_prob[step, walker]
    return fresh(positions, log_prob, random.get_state())
