"""Where the diagnosis draws its lines, each with its reason."""

from __future__ import annotations

from dataclasses import dataclass, replace


@dataclass(frozen=True)
class Thresholds:
    """Defaults hold for all campaigns; the benchmark withheld-effects measures what false alarms they make.

    Parameters
    ----------
    gap
        Chance below which a gap is one, corrected for the number of candidates and clues.
    more
        The same for one more effect beside those found.
    left
        Chance below which the best explanation leaves a gap.
    left_share
        Share of the gap's squares that must be left, and
    left_share_of_several
        (where one effect did not do: what several bend to follow is not explained yet), and
    left_of_peak
        share of the output's peak that its root mean square must reach, before "unknown" is said: with enough real
        data everything is significant.
    coarse
        Share of the output's peak from which a gap that is not explained down to the noise is looked at coarsely: a
        model that misses so much misses more than one thing, and the main one is worth a name.
    resolution
        Then what is smaller than this share of the gap counts as noise;
    coarse_share
        and the one effect that does best is named if it leaves no more than this share of the gap's squares (and no
        more than the gap's share of the peak: the finer the gap, the more must be explained),
    coarse_lead
        any other leaving this many times as much.
    alike
        Difference of the information criterion below which explanations count as alike: ten times less probable.
    alike_of_several
        The same where the best has several effects: half as probable. A rival less probable than that is right in one
        case of three at most, and of sets there are more that come close than of single effects.
    possible
        The same below which one is not ruled out yet: above, it is a hundred times less probable. A next test must
        part these as well, or they come back with it.
    promising, hopeless
        Share of the largest T from which a candidate is refitted; and from which where no better one explains the gap.
    next_promising
        The same for one more effect, by what it promises to better the best criterion: what is left is small, and the
        score test is nearly exact.
    contender
        Difference of the criterion up to which both ways are fitted in full, with the effect in the calibration tests
        and without.
    near
        Shares of the gap's white squares that one effect and two may leave for one more to be looked for: of two that
        cause it, the better one explains more, and of three the best two do. What an effect moves is always looked at.
    most_effects
        Most effects at once.
    """

    gap: float = 5e-3
    more: float = 3e-3
    left: float = 1e-3
    left_share: float = 0.02
    left_share_of_several: float = 0.002
    left_of_peak: float = 2e-4
    coarse: float = 0.02
    resolution: float = 0.1
    coarse_share: float = 0.4
    coarse_lead: float = 2.0
    alike: float = 4.6
    alike_of_several: float = 1.4
    possible: float = 9.2
    promising: float = 0.1
    hopeless: float = 0.01
    next_promising: float = 0.5
    contender: float = 60.0
    near: tuple[float, ...] = (0.8, 0.5)
    most_effects: int = 3

    def roughly(self, coarseness: float) -> Thresholds:
        """For a coarse gap, this share of the output's peak: one effect, and a remainder let pass."""
        share = min(self.coarse_share, coarseness)
        return replace(self, most_effects=1, left_share=share, left_share_of_several=share)
