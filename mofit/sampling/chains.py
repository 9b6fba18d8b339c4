"""The chains of one mode: nearly independent draws, and whether the chains have converged."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mofit._typing import FloatArray
from mofit.sampling.convergence import autocorrelation_time, effective_size, r_hat, stuck_walkers
from mofit.sampling.settings import SampleSettings
from mofit.sampling.state import Run


@dataclass(frozen=True)
class Draws:
    """Nearly independent draws; a chain is what an ensemble has.

    Parameters
    ----------
    points
        Shape (chain, draw, d).
    log_prob
        Log posterior, shape (chain, draw).
    walker, step
        Where each draw comes from, shape (chain, draw).
    """

    points: FloatArray
    log_prob: FloatArray
    walker: NDArray[np.int64]
    step: NDArray[np.int64]


def thin(chain: FloatArray, log_prob: FloatArray, home: NDArray[np.bool_], every: int, first: int = 0) -> Draws:
    """Every `every`-th step of each ensemble, the walkers side by side.

    Parameters
    ----------
    chain, log_prob
        Shapes (ensemble, step, walker, d) and (ensemble, step, walker).
    home
        Walkers to use, shape (ensemble, walker); of each ensemble as many as the smallest has.
    every
        Steps from draw to draw: the autocorrelation time makes them nearly independent.
    first
        Steps left out at the beginning.

    Returns
    -------
    Draws in the order of the steps, so that a split of the draws is a split in time.
    """
    steps = np.arange(first + every - 1, chain.shape[1], every)
    count = int(home.sum(axis=1).min())
    walkers = np.stack([np.flatnonzero(row)[:count] for row in home])
    picked = np.arange(len(chain))[:, None, None], steps[None, :, None], walkers[:, None, :]
    shape = (len(chain), len(steps) * count)
    return Draws(
        points=chain[picked].reshape(*shape, chain.shape[3]),
        log_prob=log_prob[picked].reshape(shape),
        walker=np.broadcast_to(picked[2], (len(chain), len(steps), count)).reshape(shape),
        step=np.broadcast_to(picked[1], (len(chain), len(steps), count)).reshape(shape),
    )


@dataclass(frozen=True)
class Chains:
    """Production chains of one mode in unit coordinates, with their convergence numbers.

    Parameters
    ----------
    chain, log_prob
        Raw steps, shapes (ensemble, step, walker, d) and (ensemble, step, walker).
    acceptance
        Share of accepted proposals, shape (ensemble,).
    tau
        Autocorrelation time in steps, per parameter, over the walkers of all ensembles, shape (d,).
    ess, r_hat
        Effective number and rank-normalised split R-hat of `thinned` draws, shape (d,): what ArviZ shows for them.
    discard
        First steps left out of the draws: two autocorrelation times.
    stuck, left
        Walkers that did not move, or left for another mode (`stuck_walkers`), (ensemble, walker); not in the draws.
    converged, reasons
        Whether every requirement of the settings is met, and if not, which are not.
    burn_in
        Steps of burn-in per ensemble (not in `chain`).
    evaluations
        Log posteriors computed in all.
    """

    chain: FloatArray
    log_prob: FloatArray
    acceptance: FloatArray
    tau: FloatArray
    ess: FloatArray
    r_hat: FloatArray
    discard: int
    stuck: NDArray[np.bool_]
    left: NDArray[np.bool_]
    converged: bool
    reasons: tuple[str, ...]
    burn_in: int
    evaluations: int

    @property
    def steps(self) -> int:
        """Production steps per ensemble."""
        return self.chain.shape[1]

    @property
    def effective_draws(self) -> float:
        """Effective number of all draws that are kept, N over tau, of the parameter that mixes worst."""
        draws = (self.steps - self.discard) * int((~(self.stuck | self.left)).sum())
        return float(draws / self.tau.max())

    def thinned(self) -> Draws:
        """Nearly independent draws: every ceil(2 tau)-th step of the walkers that stayed."""
        return _draws(self.chain, self.log_prob, self.stuck | self.left, self.tau, self.discard)


def assess(run: Run, settings: SampleSettings) -> Chains:
    """Convergence of a run as it stands: whether every requirement holds, see `SampleSettings`."""
    chain = np.stack([ensemble.chain for ensemble in run.ensembles])
    log_prob = np.stack([ensemble.chain_log_prob for ensemble in run.ensembles])
    steps = chain.shape[1]
    tau = autocorrelation_time(_side_by_side(chain))
    stuck, left = stuck_walkers(chain, log_prob, float(tau.max()), settings)
    lost = stuck | left
    if lost.any() and not lost.all():
        tau = autocorrelation_time(_side_by_side(chain)[:, ~lost.ravel()])
    longest = float(tau.max())
    discard = int(min(np.ceil(2 * longest), steps // 2)) if np.isfinite(longest) else steps // 2
    points = _draws(chain, log_prob, lost, tau, discard).points
    ess, mixing = effective_size(points), r_hat(points)

    share = float(lost.mean())
    usable, wanted = steps - discard, settings.tau_multiple * longest
    change = float(np.max(np.abs(tau - run.tau) / tau)) if np.isfinite(longest) else np.inf
    requirements = [
        (len(chain) >= settings.least_ensembles, f"{len(chain)} ensembles are fewer than {settings.least_ensembles}"),
        (usable > wanted, f"{usable} steps are fewer than {settings.tau_multiple:g} tau = {wanted:.0f}"),
        (change <= settings.tau_change, f"tau still changes, by {100 * change:.1f} % between checks"),
        (bool(np.all(mixing <= settings.max_r_hat)), f"R-hat is {np.max(mixing):.4f}, above {settings.max_r_hat:g}"),
        (bool(np.all(ess >= settings.min_ess)), f"ESS is {np.min(ess):.0f}, below {settings.min_ess:g}"),
        (
            share <= settings.max_stuck,
            f"{int(stuck.sum())} walkers stuck and {int(left.sum())} of {lost.size} left for another mode",
        ),
    ]
    reasons = tuple(reason for fine, reason in requirements if not fine)
    return Chains(
        chain=chain,
        log_prob=log_prob,
        acceptance=np.array([ensemble.accepted.mean() / max(steps, 1) for ensemble in run.ensembles]),
        tau=tau,
        ess=ess,
        r_hat=mixing,
        discard=discard,
        stuck=stuck,
        left=left,
        converged=not reasons,
        reasons=reasons,
        burn_in=run.burned,
        evaluations=run.evaluations,
    )


def _side_by_side(chain: FloatArray) -> FloatArray:
    """Shape (ensemble, step, walker, d) to (step, any walker, d)."""
    ensembles, steps, walkers, dimension = chain.shape
    return chain.transpose(1, 0, 2, 3).reshape(steps, ensembles * walkers, dimension)


def _draws(chain: FloatArray, log_prob: FloatArray, lost: NDArray[np.bool_], tau: FloatArray, discard: int) -> Draws:
    longest = float(tau.max())
    steps = max(chain.shape[1] - discard, 1)
    every = int(np.ceil(min(2 * longest, steps)))  # at least one draw per walker, even of a chain too short for its tau
    home = np.where(lost.all(axis=1, keepdims=True), True, ~lost)
    return thin(chain, log_prob, home, every, discard)
