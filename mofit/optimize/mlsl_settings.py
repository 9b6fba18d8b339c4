"""Settings of multi-level single linkage: how it samples and descends, and how the budget is shared."""

from __future__ import annotations

from dataclasses import dataclass, field

from mofit.errors import check_settings
from mofit.optimize.bfgs import DescentSettings


@dataclass(frozen=True)
class MlslSettings:
    """Settings of `mofit.optimize.single_linkage.SingleLinkage`. Lengths are shares of the box."""

    evaluations: int = 600
    """Budget."""
    gradient_cost: int = 1
    """Evaluations that a value with its gradient counts."""
    round: int = 32
    """Sobol points per round, or a twentieth of all so far, if that is more; a power of 2 fills the box evenly."""
    start_share: float = 0.5
    """Better share of the points from which a descent may start."""
    late_share: float = 0.1
    """That share later, or the share of minima that are deep, if it is more: where many evaluations have not found all
    minima, the deep ones count."""
    deep: float = 0.1
    """Minima less than this share of the cost's range above the best are deep."""
    late: int = 50_000
    """Evaluations that are many."""
    together: int = 4
    """Descents that advance together: the kernel is faster in batches, but each knows fewer of the minima found."""
    test_starts: bool = False
    """Whether a start is left out if the cost only falls on the line from it to the nearest minimum: the test costs one
    to five evaluations, the descent some fifteen."""
    merge: float = 5e-3
    """Ends this close are one minimum."""
    tabu: float = 0.5
    """A descent within this share of the tabu radius of a known minimum is rejected."""
    undiscovered: float | None = 0.01
    """Stop when the expected number of undiscovered minima of the weighted mean falls below this; None: use the whole
    budget."""
    final_tolerance: float | None = None
    """Descend once more from all minima, to steps below this."""
    final_share: float = 0.1
    """Share of the budget reserved for that, at most,"""
    final_each: int = 10
    """And so many evaluations per minimum and parameter: from where a descent ended it takes few."""
    single_share: float = 0.2
    """Share of the budget reserved, with several objectives, for single-objective minima."""
    single_starts: int = 4
    """Best minima of the weighted mean from which each single objective is minimised."""
    front_share: float = 0.3
    """Share of the budget reserved, with several objectives, for filling the Pareto front."""
    single_most: int | None = None
    """Evaluations for minima of single objectives at most; None: what the reserve for the front leaves."""
    front_most: int | None = None
    """Evaluations for filling the front at most; None: what is left."""
    front_candidates: int = 1
    """Points of which one, in a sparse place, is evaluated there."""
    descent: DescentSettings = field(default_factory=DescentSettings)

    def __post_init__(self) -> None:
        checks = [
            ("evaluations", self.evaluations >= 10, "Give at least 10"),
            ("round", self.round >= 1, "Give at least 1"),
            ("start_share", 0 < self.start_share <= 1, "Give a share in (0, 1]"),
            ("late_share", 0 < self.late_share <= 1, "Give a share in (0, 1]"),
            ("late", self.late >= 0, "Give 0 or more"),
            ("together", self.together >= 1, "Give at least 1"),
            ("final_share", 0 <= self.final_share < 1, "Give a share in [0, 1)"),
            ("single_share", 0 <= self.single_share < 1, "Give a share in [0, 1)"),
            ("front_share", 0 <= self.front_share < 1, "Give a share in [0, 1)"),
        ]
        check_settings("search", self, checks)

    def start_share_after(self, used: int, deep: float) -> float:
        """Share of the points that may start a descent, after so many evaluations and with a share of deep minima."""
        return self.start_share if used < self.late else min(self.start_share, max(self.late_share, deep))

    def reserved(self, objectives: int, minima: int | None = None, dimension: int = 1) -> int:
        """Evaluations that are not for finding minima of the weighted mean, of which so many are known."""
        final = int(self.final_share * self.evaluations) if self.final_tolerance else 0
        if minima is not None:
            final = min(final, self.final_each * dimension * minima)
        if objectives == 1:
            return final
        if self.single_most is None or self.front_most is None:
            return final + int((self.single_share + self.front_share) * self.evaluations)
        return final + self.single_evaluations + self.front_evaluations

    @property
    def single_evaluations(self) -> int:
        """For minima of single objectives."""
        share = int(self.single_share * self.evaluations)
        return share if self.single_most is None else min(share, self.single_most)

    @property
    def front_evaluations(self) -> int:
        """For filling the front."""
        share = int(self.front_share * self.evaluations)
        return share if self.front_most is None else min(share, self.front_most)
