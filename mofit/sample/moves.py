"""Proposals for emcee: an independent Student-t draw, and a snooker step."""

from __future__ import annotations

import numpy as np

from mofit.parameters import Array
from mofit.sample.lean_emcee import RedBlueMove
from mofit.sample.student import Students


class StudentMove(RedBlueMove):
    r"""Propose a fresh draw from a fixed mixture q of Student-t distributions inside the unit cube.

    The draw does not depend on where the walker is, so with a good q the next position is nearly independent of the
    last. The Hastings factor is :math:`q(x) / q(x')`; the constant by which q is cut off at the faces cancels. The
    heavy tails of q keep :math:`\pi / q` bounded for any posterior with Gaussian tails, so no walker sticks for long.

    Parameters
    ----------
    proposal
        The distribution q.
    """

    def __init__(self, proposal: Students) -> None:
        super().__init__(nsplits=1)  # no walker looks at another: all may move at once
        self.proposal = proposal

    def get_proposal(self, s: Array, c: list[Array], random: np.random.RandomState) -> tuple[Array, Array]:
        """Proposals for the walkers `s`, and their log Hastings factors."""
        drawn = self.proposal.draw_inside(random, len(s))
        return drawn, self.proposal.log_density(s) - self.proposal.log_density(drawn)


class SnookerMove(RedBlueMove):
    r"""Differential-evolution snooker step: along the line through another walker.

    With z, a, b three walkers of the other half and :math:`e = (x - z)/|x - z|`,

    .. math:: x' = x + \gamma\, e e^T (a - b), \qquad
              \ln\text{factor} = (d - 1) \ln\frac{|x' - z|}{|x - z|}.

    emcee 3.1.6 ships one that divides by the square root of the distance instead of the distance and halves the factor,
    which does not leave the target invariant; mended upstream in pull request 531, after that release.

    References
    ----------
    Ter Braak, Vrugt: Differential evolution Markov chain with snooker updater and fewer chains (2008).
    """

    gamma = 1.7  # the authors' recommendation

    def get_proposal(self, s: Array, c: list[Array], random: np.random.RandomState) -> tuple[Array, Array]:
        """Proposals for the walkers `s` from the others `c`, and their log Hastings factors."""
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
