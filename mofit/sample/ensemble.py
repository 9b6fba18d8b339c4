"""One emcee ensemble: state in, steps, state out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import emcee
import numpy as np

from mofit.errors import InputError
from mofit.parameters import Array
from mofit.sample.gaussian import Student
from mofit.sample.moves import SnookerMove, StudentMove
from mofit.sample.settings import SampleSettings

LogPosterior = Callable[[Array], Array]
"""Points (n, d) in unit coordinates to log posterior (n,); -inf outside the cube or where the simulation failed."""
RandomState = Any
"""The tuple that `numpy.random.RandomState.get_state` returns; emcee draws from such a generator."""


@dataclass(frozen=True)
class Ensemble:
    """An ensemble of walkers and its chain so far.

    Parameters
    ----------
    positions, log_prob
        Where the walkers are, shapes (walker, d) and (walker,).
    random_state
        State of the ensemble's own generator.
    chain, chain_log_prob
        The steps so far, shapes (step, walker, d) and (step, walker).
    accepted
        Accepted proposals per walker over these steps, shape (walker,).
    """

    positions: Array
    log_prob: Array
    random_state: RandomState
    chain: Array
    chain_log_prob: Array
    accepted: Array


def fresh(positions: Array, log_prob: Array, random_state: RandomState) -> Ensemble:
    """An ensemble with an empty chain."""
    walkers, dimension = positions.shape
    return Ensemble(
        positions,
        log_prob,
        random_state,
        np.empty((0, walkers, dimension)),
        np.empty((0, walkers)),
        np.zeros(walkers),
    )


def safe(log_posterior: LogPosterior) -> LogPosterior:
    """The same function, -inf outside the cube (without asking it) and where it returns nan."""

    def guarded(points: Array) -> Array:
        inside = np.all((points >= 0) & (points <= 1), axis=1)
        values = np.full(len(points), -np.inf)
        if inside.any():
            found = np.asarray(log_posterior(points[inside]), dtype=float)
            values[inside] = np.where(np.isnan(found), -np.inf, found)
        return values

    return guarded


def start(
    log_posterior: LogPosterior, centre: Array, covariance: Array, walkers: int, seed: np.random.SeedSequence
) -> tuple[Ensemble, int]:
    """An ensemble drawn from the Gaussian around a minimum, inside the cube and where the posterior is not zero.

    Walkers that fall on failed simulations are drawn again, ever closer to the centre.

    Returns
    -------
    The ensemble, and the number of evaluations.

    Raises
    ------
    InputError
        If the posterior vanishes around the centre.
    """
    random = np.random.RandomState(np.random.MT19937(seed))
    positions = np.empty((walkers, len(centre)))
    log_prob = np.full(walkers, -np.inf)
    evaluations = 0
    for attempt in range(20):
        missing = np.flatnonzero(~np.isfinite(log_prob))
        if missing.size == 0:
            return fresh(positions, log_prob, random.get_state()), evaluations
        near = Student(centre, covariance * 0.5**attempt)
        positions[missing] = np.clip(near.draw_inside(random, len(missing)), 0.0, 1.0)
        log_prob[missing] = log_posterior(positions[missing])
        evaluations += len(missing)
    raise InputError.of(
        "sample",
        f"the posterior is zero for {int(np.sum(~np.isfinite(log_prob)))} of {walkers} points drawn around the minimum",
        "Check the model near its bounds",
    )


def moves(mean: Array, scale: Array, settings: SampleSettings) -> list[tuple[Any, float]]:
    """Emcee's weighted list of moves."""
    mixture = [
        (StudentMove(mean, scale, settings.freedom), settings.student),
        (emcee.moves.DEMove(), settings.differential),
        (emcee.moves.StretchMove(), settings.stretch),
        (SnookerMove(), settings.snooker),
    ]
    return [(move, share) for move, share in mixture if share > 0]


def advance(
    log_posterior: LogPosterior, ensemble: Ensemble, mixture: Sequence[tuple[Any, float]], steps: int
) -> Ensemble:
    """The ensemble after some more steps of emcee, its chain grown by them."""
    sampler = emcee.EnsembleSampler(
        *ensemble.positions.shape, log_posterior, moves=mixture, vectorize=True, backend=emcee.backends.Backend()
    )
    sampler.log_prob_fn = log_posterior  # emcee's wrapper prints every exception, an interruption too
    before = emcee.State(ensemble.positions, log_prob=ensemble.log_prob, random_state=ensemble.random_state, copy=True)
    after = sampler.run_mcmc(before, steps, skip_initial_state_check=True)
    return Ensemble(
        positions=after.coords.copy(),
        log_prob=after.log_prob.copy(),
        random_state=after.random_state,
        chain=np.concatenate([ensemble.chain, sampler.get_chain()]),
        chain_log_prob=np.concatenate([ensemble.chain_log_prob, sampler.get_log_prob()]),
        accepted=ensemble.accepted + sampler.backend.accepted,
    )
