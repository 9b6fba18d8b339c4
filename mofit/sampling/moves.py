"""The moves of the walkers: emcee's, an independent draw from a Student-t mixture, and a snooker step."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from mofit._typing import FloatArray
from mofit.sampling.bend import Bend
from mofit.sampling.independence_proposal import StudentTMixture
from mofit.sampling.settings import SampleSettings


class Move(Protocol):
    """What `mofit.sampling.ensemble.advance` asks of a move; emcee's red-blue moves have it."""

    nsplits: int
    """Parts of an ensemble that move in turn, each looking at the others."""

    def get_proposal(
        self, s: FloatArray, c: list[FloatArray], random: np.random.RandomState
    ) -> tuple[FloatArray, FloatArray]:
        """Proposals for the walkers `s` (n, d) from the other parts `c`, and their log Hastings factors (n,)."""
        ...


class IndependenceMove:
    r"""Propose a draw from a fixed mixture q of Student-t distributions, truncated to the unit cube.

    The Hastings factor is :math:`q(x) / q(x')`; the constant of the truncation cancels. The heavy tails of q keep
    :math:`\pi / q` bounded for any posterior with Gaussian tails, so no walker sticks for long.

    Parameters
    ----------
    proposal
        The distribution q.
    """

    nsplits = 1  # no walker looks at another: all move at once

    def __init__(self, proposal: StudentTMixture) -> None:
        self.proposal = proposal

    def get_proposal(
        self, s: FloatArray, c: list[FloatArray], random: np.random.RandomState
    ) -> tuple[FloatArray, FloatArray]:
        """See `Move`."""
        drawn = self.proposal.draw_inside(random, len(s))
        return drawn, self.proposal.log_density(s) - self.proposal.log_density(drawn)


class SnookerMove:
    r"""Differential-evolution snooker step: along the line through another walker.

    With z, a, b three walkers of the other half and :math:`e = (x - z)/|x - z|`,

    .. math:: x' = x + \gamma\, e e^T (a - b), \qquad
              \ln\text{factor} = (d - 1) \ln\frac{|x' - z|}{|x - z|}.

    The one of emcee 3.1.6 divides by the square root of the distance and halves the factor, which does not leave the
    target invariant (corrected in pull request 531, after that release).

    References
    ----------
    Ter Braak, Vrugt: Differential evolution Markov chain with snooker updater and fewer chains (2008).
    """

    nsplits = 2
    gamma = 1.7  # the authors' recommendation

    def get_proposal(
        self, s: FloatArray, c: list[FloatArray], random: np.random.RandomState
    ) -> tuple[FloatArray, FloatArray]:
        """See `Move`."""
        others = np.concatenate(c)
        keys = random.random_sample((len(s), len(others)))
        z, a, b = (others[pick] for pick in np.argsort(keys, axis=1)[:, :3].T)
        gap = s - z
        distance = np.linalg.norm(gap, axis=1)
        distance[distance == 0] = np.nan  # in the same place: no line, no move
        along = gap / distance[:, None]
        new = s + self.gamma * along * np.sum(along * (a - b), axis=1)[:, None]
        ratio = np.linalg.norm(new - z, axis=1) / distance
        return new, (s.shape[1] - 1) * np.log(ratio)


class StraightenedMove:
    """Another move in the straight coordinates of a bent posterior; its Hastings factor stays, see `Bend`."""

    def __init__(self, move: Move, bend: Bend) -> None:
        self.move, self.bend, self.nsplits = move, bend, move.nsplits

    def get_proposal(
        self, s: FloatArray, c: list[FloatArray], random: np.random.RandomState
    ) -> tuple[FloatArray, FloatArray]:
        """See `Move`."""
        new, factor = self.move.get_proposal(self.bend.straight(s), [self.bend.straight(part) for part in c], random)
        return self.bend.bent(new), factor


def moves(proposal: StudentTMixture, time: float, settings: SampleSettings) -> list[tuple[Move, float]]:
    """Moves and their shares of the steps; `time` is the proposal's predicted autocorrelation time."""
    from emcee.moves import DEMove, StretchMove  # late: emcee imports scipy.stats, which takes half a second

    independence = settings.independence * min(1.0, settings.tolerated_time / time)
    differential = DEMove()
    differential.setup(proposal.means)  # step length for this number of parameters
    local: list[tuple[Move, float]] = [
        (differential, settings.differential),
        (StretchMove(), settings.stretch),
        (SnookerMove(), settings.snooker),
    ]
    if proposal.bend is not None:
        local = [(StraightenedMove(move, proposal.bend), share) for move, share in local]
    mixture = [(IndependenceMove(proposal), independence), *local]
    return [(move, share) for move, share in mixture if share > 0]
