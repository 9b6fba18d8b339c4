"""The grades of a verdict: what it depends on, and when a gap counts as explained."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from mofit.diagnosis.settings import DiagnosisSettings

Verdict = Literal["none", "effect", "group", "several", "partly", "unknown"]


@dataclass(frozen=True)
class Finding:
    """What the verdict depends on.

    Parameters
    ----------
    effects
        Names of the effects of the best model.
    significant
        Whether there is a gap.
    left_p_value, left_of_peak, left_share
        What the best model leaves: the p-value of its residual tests, its root mean square relative to the output's
        peak in the worst test, its share of the gap's mean square.
    doubtful
        Whether other models are indistinguishable from the best.
    removed
        Share of the gap that these effects explain on tests left out; 0 if others explain about as much.
    refuted
        Whether tests left out are no more probable with these effects, or some are far less, or most of the gap stays
        there.
    stretched
        Whether several laws of one family stand for one that is none of them: on some hold-outs no more than half of
        the gap goes, as a series that is fitted to a curve fails beyond its data.
    shown, shown_in_groups
        Whether tests left out show that these effects help, and whether groups of them do.
    in_time
        Whether one of them follows the run order.
    """

    effects: Sequence[str]
    significant: bool
    left_p_value: float
    left_of_peak: float
    left_share: float
    doubtful: bool = False
    removed: float = 0.0
    refuted: bool = False
    stretched: bool = False
    shown: bool = True
    shown_in_groups: bool = True
    in_time: bool = False

    @property
    def unshown(self) -> bool:
        """Whether flexible causes, which also fit what they do not cause, are not shown to help."""
        return (len(self.effects) > 1 or self.in_time) and not self.shown

    def stands_for_most(self, settings: DiagnosisSettings) -> bool:
        """Whether these effects explain most of a gap that they leave something of.

        Of one that follows the run order how far its law reaches is the question: groups of tests must show it, too.
        """
        unshown = self.unshown or (self.in_time and not self.shown_in_groups)
        return bool(self.effects) and not unshown and self.removed >= settings.partly

    def beyond_noise(self, settings: DiagnosisSettings) -> bool:
        """Whether what is left is significant, and large enough to matter; most of a gap, where a gap would be."""
        enough, most = self.left_of_peak > settings.residual_of_peak, self.left_share > 1 - settings.partly
        return self.left_p_value < (settings.gap_p_value if most else settings.residual_p_value) and enough

    def verdict(self, settings: DiagnosisSettings) -> Verdict:
        """The verdict."""
        several = len(self.effects) > 1
        limit = settings.residual_share_of_several if several else settings.residual_share
        unexplained = self.beyond_noise(settings) and self.left_share > limit
        if not self.significant or not (self.effects or unexplained):
            return "none"
        if unexplained or self.refuted or self.stretched or (several and self.unshown) or not self.effects:
            return "partly" if self.stands_for_most(settings) else "unknown"
        return "several" if several else "group" if self.doubtful else "effect"
