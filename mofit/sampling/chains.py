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
    """Nearly independent draws and where each comes from; a chain is what an ensemble has."""

    points: FloatArray  # (chain, draw, d)
    log_prob: FloatArray  # log posterior, (chain, draw)
    walker: NDArray[np.int64]  # (chain, draw)
    step: NDArray[np.int64]  # (chain, draw)


def thin(chain: FloatArray, log_prob: FloatArray, home: NDArray[np.bool_], every: int, first: int = 0) -> Draws:
    """Every `every`-th step of each ensemble after the `first` ones, the walkers side by side.

    Draws are in the order of the steps, so that a split of the draws is a split in time.

    Parameters
    ----------
    chain, log_prob
        Shapes (ensemble, step, walker, d) and (ensemble, step, walker).
    home
        Walkers to use, shape (ensemble, walker); of each ensemble as many as the smallest has.
    """
    steps = np.arange(first + every - 1, chain.shape[1], every)
    count = int(home.sum(axis=1).min())
    walkers = np.stack([np.flatnonzero(row)[:count] for row in home])
    picked = np.arange(len(chain))[:, None, None], steps[None, :, None], walkers[:, None, :]
    shape = (len(chain), len(steps) * count)
    _, step, walker = np.broadcast_arrays(*picked)
    return Draws(
        points=chain[picked].reshape(*shape, chain.shape[3]),
        log_prob=log_prob[picked].reshape(shape),
        walker=walker.reshape(shape),
        step=step.reshape(shape),
    )


@dataclass(frozen=True)
class Chains:
    """Production chains of one mode in unit coordinates, with their convergence numbers."""

    chain: FloatArray
    """Raw steps, shape (ensemble, step, walker, d)."""
    log_prob: FloatArray
    """Their log posterior, shape (ensemble, step, walker)."""
    acceptance: FloatArray
    """Share of accepted proposals, shape (ensemble,)."""
    tau: FloatArray
    """Autocorrelation time in steps, per parameter, over the walkers of all ensembles, shape (d,)."""
    ess: FloatArray
    """Effective number of `thinned` draws, shape (d,): what ArviZ shows for them; likewise `r_hat`."""
    r_hat: FloatArray
    """Rank-normalised split R-hat."""
    discard: int
    """First steps left out of the draws: two autocorrelation times."""
    stuck: NDArray[np.bool_]
    """Walkers that did not move (`stuck_walkers`), (ensemble, walker); not in the draws."""
    left: NDArray[np.bool_]
    """Walkers that left for another mode, likewise."""
    converged: bool
    """Whether every requirement of the settings is met."""
    reasons: tuple[str, ...]
    """Those that are not."""
    burn_in: int
    """Steps of burn-in per ensemble (not in `chain`)."""
    evaluations: int
    """Log posteriors computed in all."""

    @classmethod
    def none(cls, dimension: int, reason: str) -> Chains:
        """Of a mode that was not sampled."""
        empty, nothing = np.empty((1, 0, 1, dimension)), np.zeros((1, 1), dtype=bool)
        unknown = np.full(dimension, np.nan)
        return cls(
            empty, empty[..., 0], np.zeros(1), unknown, np.zeros(dimension), unknown, 0, nothing, nothing, False,
            (reason,), 0, 0,
        )  # fmt: skip

    @property
    def steps(self) -> int:
        """Production steps per ensemble."""
        return self.chain.shape[1]

    def hopeless(self, earlier: FloatArray, settings: SampleSettings) -> bool:
        """Whether more steps would not do: by the autocorrelation times (d,) now and at the earlier check."""
        return _does_not_mix(self.steps, float(self.tau.max()), float(np.max(earlier)), settings)

    @property
    def effective_draws(self) -> float:
        """Effective number of all draws that are kept, N over tau, of the parameter that mixes worst."""
        draws = (self.steps - self.discard) * int((~(self.stuck | self.left)).sum())
        return float(draws / self.tau.max())

    def thinned(self) -> Draws:
        """Nearly independent draws: every ceil(2 tau)-th step of the walkers that stayed."""
        return _draws(self.chain, self.log_prob, self.stuck | self.left, self.tau, self.discard)


def assess(run: Run, settings: SampleSettings, last: bool = False) -> Chains:
    """Convergence of a run as it stands: whether every requirement holds, see `SampleSettings`.

    R-hat and ESS are computed once all others hold, and after the ``last`` step.
    """
    last = run.steps >= settings.max_steps or last
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

    usable, wanted = steps - discard, settings.tau_multiple * longest
    growth = float(np.max((tau - run.tau) / tau)) if np.isfinite([longest, *run.tau]).all() else np.inf
    astray = f"{stuck.sum()} walkers stuck and {left.sum()} of {lost.size} left for another mode"
    requirements = [
        (len(chain) >= settings.least_ensembles, f"{len(chain)} ensembles are fewer than {settings.least_ensembles}"),
        (usable > wanted, f"{usable} steps are fewer than {settings.tau_multiple:g} tau = {wanted:.0f}"),
        (growth <= settings.tau_growth, f"tau still grows, by {100 * growth:.1f} % between checks"),
        (lost.mean() <= settings.max_stuck, astray),
    ]
    ess, mixing = np.zeros(chain.shape[3]), np.full(chain.shape[3], np.nan)
    if last or all(fine for fine, _ in requirements):  # they take longer than the others, and matter only after them
        ess, mixing = effective_size(points), r_hat(points)
        highest, least = float(np.max(mixing)), float(np.min(ess))
        requirements += [
            (highest <= settings.max_r_hat, f"R-hat is {highest:.4f}, above {settings.max_r_hat:g}"),
            (least >= settings.min_ess, f"ESS is {least:.0f}, below {settings.min_ess:g}"),
        ]
    if _does_not_mix(steps, longest, float(np.max(run.tau)), settings):
        much = settings.max_steps / settings.tau_multiple
        requirements.insert(
            0, (False, f"the chains do not mix: tau is {longest:.0f} steps and grows; {much:.0f} would do")
        )
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


def _does_not_mix(steps: int, tau: float, earlier: float, settings: SampleSettings) -> bool:
    """Whether the most steps are too few by both autocorrelation times, or these grow with the chain."""
    if steps < settings.fewest_steps or not np.isfinite(tau) or not np.isfinite(earlier):
        return False
    grows = steps >= 2 * settings.fewest_steps and tau > settings.growth * earlier
    grows = grows and settings.tau_multiple * tau * tau / earlier > settings.max_steps  # grown as much once more
    return grows or settings.tau_multiple * min(tau, earlier) > settings.max_steps


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
