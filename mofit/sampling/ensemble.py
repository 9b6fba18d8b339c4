"""Ensembles of walkers that take the same moves side by side: state in, steps, state out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mofit._typing import FloatArray
from mofit.errors import InputError
from mofit.sampling.independence_proposal import StudentTMixture, in_cube
from mofit.sampling.moves import Move

LogPosterior = Callable[[FloatArray], FloatArray]
"""Points (n, d) in unit coordinates to log posterior (n,); -inf outside the cube or where the simulation failed."""
GAUSSIAN = 1e6
"""Degrees of freedom at which a Student-t distribution is normal."""
RandomState = Any
"""The tuple that `numpy.random.RandomState.get_state` returns; emcee draws from such a generator."""


@dataclass(frozen=True)
class Ensemble:
    """An ensemble of walkers, its own generator and its chain so far."""

    positions: FloatArray  # (walker, d)
    log_prob: FloatArray  # (walker,)
    random_state: RandomState
    chain: FloatArray  # (step, walker, d)
    chain_log_prob: FloatArray  # (step, walker)
    accepted: FloatArray  # proposals over these steps, (walker,)

    @classmethod
    def at(cls, positions: FloatArray, log_prob: FloatArray, random_state: RandomState) -> Ensemble:
        """An ensemble with an empty chain."""
        chain, walkers = np.empty((0, *positions.shape)), len(positions)
        return cls(positions, log_prob, random_state, chain, np.empty((0, walkers)), np.zeros(walkers))

    def generator(self) -> np.random.RandomState:
        """A generator in the state of the ensemble's own."""
        random = np.random.RandomState()
        random.set_state(self.random_state)
        return random


def restricted(log_posterior: LogPosterior, belongs: Callable[[FloatArray], NDArray[np.bool_]]) -> LogPosterior:
    """The same function, -inf outside a region (not evaluated there) and where it returns nan."""

    def within(points: FloatArray) -> FloatArray:
        values, mine = np.full(len(points), -np.inf), belongs(points)
        if mine.any():
            found = np.asarray(log_posterior(points[mine]), dtype=float)
            values[mine] = np.where(np.isnan(found), -np.inf, found)
        return values

    return within


def safe(log_posterior: LogPosterior) -> LogPosterior:
    """The same function, restricted to the unit cube."""
    return restricted(log_posterior, in_cube)


def start(
    log_posterior: LogPosterior, around: StudentTMixture, walkers: int, seed: np.random.SeedSequence
) -> tuple[Ensemble, int]:
    """An ensemble drawn from a mixture around a minimum, inside the cube and where the posterior is not zero.

    Walkers that fall on failed simulations are drawn again, ever closer to the means.

    Returns
    -------
    The ensemble, and the number of evaluations.

    Raises
    ------
    InputError
        If the posterior vanishes around the centre.
    """
    random = np.random.RandomState(np.random.MT19937(seed))
    positions = np.empty((walkers, around.means.shape[1]))
    log_prob = np.full(walkers, -np.inf)
    evaluations = 0
    for attempt in range(20):
        missing = np.flatnonzero(~np.isfinite(log_prob))
        if missing.size == 0:
            return Ensemble.at(positions, log_prob, random.get_state()), evaluations
        near = replace(around, scales=around.scales * 0.5**attempt, freedom=GAUSSIAN)
        positions[missing] = np.clip(near.draw_inside(random, len(missing)), 0.0, 1.0)
        log_prob[missing] = log_posterior(positions[missing])
        evaluations += len(missing)
    raise InputError.of(
        "sample",
        f"the posterior is zero for {int(np.sum(~np.isfinite(log_prob)))} of {walkers} points drawn around the minimum",
        "Check the model near its bounds",
    )


def advance(
    log_posterior: LogPosterior,
    ensembles: Sequence[Ensemble],
    mixture: Sequence[tuple[Move, float]],
    steps: int,
) -> tuple[Ensemble, ...]:
    """The ensembles after some more steps, their chains grown by them.

    They share the kind of move of each step, and thus the call of the posterior, which is cheaper per point the more
    points it gets. All else each draws from its own generator: they stay independent.
    """
    randoms = [ensemble.generator() for ensemble in ensembles]
    positions = np.stack([ensemble.positions for ensemble in ensembles])
    log_prob = np.stack([ensemble.log_prob for ensemble in ensembles])
    accepted = np.stack([ensemble.accepted for ensemble in ensembles])
    chain, chain_log_prob = np.empty((steps, *positions.shape)), np.empty((steps, *log_prob.shape))
    shares = np.cumsum([share for _, share in mixture])
    for step in range(steps):
        chosen = np.searchsorted(shares, shares[-1] * randoms[0].random_sample(), side="right")
        _step(log_posterior, mixture[chosen][0], positions, log_prob, accepted, randoms)
        chain[step], chain_log_prob[step] = positions, log_prob
    return tuple(
        Ensemble(
            positions=positions[k],
            log_prob=log_prob[k],
            random_state=randoms[k].get_state(),
            chain=np.concatenate([ensemble.chain, chain[:, k]]),
            chain_log_prob=np.concatenate([ensemble.chain_log_prob, chain_log_prob[:, k]]),
            accepted=accepted[k],
        )
        for k, ensemble in enumerate(ensembles)
    )


def _step(
    log_posterior: LogPosterior,
    move: Move,
    positions: FloatArray,
    log_prob: FloatArray,
    accepted: FloatArray,
    randoms: Sequence[np.random.RandomState],
) -> None:
    """One step in place: each part of every ensemble in turn moves, looking at the rest of its own ensemble."""
    count, walkers, dimension = positions.shape
    parts = np.stack([random.permutation(walkers) for random in randoms]) % move.nsplits
    for part in range(move.nsplits):
        active = np.nonzero(parts == part)
        proposals = [
            move.get_proposal(walker[turn], [walker[~turn]], random)
            for walker, turn, random in zip(positions, parts == part, randoms, strict=True)
        ]
        new = np.concatenate([proposal for proposal, _ in proposals])
        factor = np.concatenate([log_factor for _, log_factor in proposals])
        threshold = -np.concatenate([random.standard_exponential(len(new) // count) for random in randoms])
        values = log_posterior(new.reshape(-1, dimension))
        taken = factor + values - log_prob[active] > threshold  # -Exp(1) is the log of a uniform draw
        place = active[0][taken], active[1][taken]
        positions[place], log_prob[place] = new[taken], values[taken]
        accepted[place] += 1
