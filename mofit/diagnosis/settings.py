"""What decides a diagnosis, each number with its reason."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True)
class NextExperimentSettings:
    """Proposed experiments: sines around the campaign's usual one."""

    frequencies: tuple[float, ...] = (0.125, 0.5, 1.0, 1.5, 2.0, 3.0, 5.0)
    """Factors on the largest frequency,"""
    amplitudes: tuple[float, ...] = (0.5, 1.0, 2.0, 3.0)
    """on the usual amplitude,"""
    speeds: tuple[float, ...] = (1 / 3, 1.0, 1.5)
    """on the usual speed,"""
    rates: tuple[int, ...] = (1, 2, 4)
    """and on the sampling rate; what needs a higher one is tried up to the usual amplitude."""
    samples_per_period: float = 16
    """Fewest: with 12 the third harmonic of a delayed force is off by 1 %, which a rig with little noise sees."""
    shortest: float = 20.0
    """Shortest experiment, s."""
    longest: float = 600.0
    """Longest experiment, s."""
    periods: int = 4
    """Fewest periods."""
    samples: int = 4000
    """Most samples that are simulated, but for the periods: information grows in proportion to the length."""
    settling: float = 1.0
    """Periods at the start that are not used."""
    odds: float = 10.0
    """A competing model is ruled out once it is this many times less probable."""
    power: float = 0.95
    """Probability from which an experiment discriminates between models."""
    aim: float = 0.98
    """Probability that its length is chosen for: the forecast is uncertain itself."""
    nearly: float = 0.98
    """Share of what the longest experiment rules out that is enough where it does not discriminate between all."""
    worthwhile: float = 0.5
    """Probability from which an experiment is proposed although it may leave several models."""


@dataclass(frozen=True)
class DiagnosisSettings:
    """What decides between the verdicts. The benchmark withheld_effects counts what errors the defaults make.

    p-values are corrected for the number of tests of which each is the smallest.
    """

    gap_p_value: float = 5e-3
    """p-value below which there is a gap; of score tests alone, if an effect gains more than its penalty as well."""
    one_more_p_value: float = 3e-3
    """p-value below which one more effect is tried beside those found."""
    residual_p_value: float = 1e-3
    """p-value below which the best candidate model leaves a gap."""
    promising: float = 0.1
    """Share of the largest T from which a candidate is refitted."""
    extension_promising: float = 0.5
    """Share of the largest promised decrease of the criterion from which one more effect is tried: what is left is
    small, so the score test is nearly exact."""
    contender: float = 60.0
    """Difference of the criterion up to which an effect is fitted both with and without it in the calibration tests."""
    most_refits: int = 12
    """Most candidates that are refitted at once; all are where none of these explains the gap."""
    most_extensions: int = 6
    """Most sets of one more effect that are fitted at once."""
    most_effects: int = 3
    """Most effects of one model: every further one multiplies the fits."""
    unexplained: tuple[float, ...] = (0.8, 0.5)
    """Largest shares of the gap's whitened squares that one effect and two may leave for one more to be tried. Of two
    effects the better one explains more, and of three the best two do. What an effect moves is always tried."""
    doubt: float = 2.0
    """Standard deviations of the noise's squares by which one effect must exceed its share; a third effect is rarer."""
    residual_share: float = 0.02
    """Share of the gap's squares that one effect may leave and explain it: with enough real data everything is
    significant."""
    residual_share_of_several: float = 0.002
    """The same where one effect was not enough: what several effects must bend to follow is not explained yet."""
    residual_of_peak: float = 2e-4
    """Root mean square, relative to the output's peak, that must be left as well."""
    partly: float = 0.6
    """Share of the gap's squares that a cause must explain on tests left out where it leaves more than the limits: the
    right cause with another law leaves a third at most, the nearest of wrong causes two thirds."""
    dominance: float = 2.0
    """Every model without one of these causes must leave this many times as much."""
    resolution: float = 0.1
    """Where no cause stands out, a discrepancy of this share of the gap counts as noise: the lines with the least noise
    may hide the main cause."""
    propose: bool = True
    """Whether a term is learnt from the data where no known effect explains the gap."""
    indistinguishable: float = 4.6
    """Difference of the criterion below which models are indistinguishable: less than ten times less probable."""
    indistinguishable_of_several: float = 1.4
    """The same where the best has several effects: half as probable. A less probable one is right in one case of three
    at most, and more sets come close than single effects."""
    possible: float = 9.2
    """Difference up to which a model is not ruled out (a hundred times less probable): the next experiment must
    distinguish these as well, or they come back with it."""
    next_experiment: NextExperimentSettings = field(default_factory=NextExperimentSettings)
