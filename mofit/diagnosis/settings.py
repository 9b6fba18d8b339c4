"""Settings of the diagnosis, grouped by its steps, each with its reason."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from mofit.optimize import RefineSettings


@dataclass(frozen=True)
class SpectralSettings:
    """Spectral lines and their classes."""

    fewest_periods: float = 1.99
    """Periods from which on what repeats can be told from noise: two, less the rounding of the record's length."""
    harmonics: int = 10
    """Harmonics of the excitation with a class of their own; higher ones hold too little of a smooth effect."""
    subharmonics: int = 3
    """Odd multiples of half the excitation's frequency with a class of their own."""
    leakage: float = 1.5
    """Lines on each side that a frequency between two lines reaches: the main lobe of a rectangular window, nearly."""
    modulation: int = 2
    """Lines on each side of the excitation that a slow change of gain fills."""
    excited_power: float = 0.999
    """Share of an aperiodic input's power that its excited lines hold; what is weaker moves no output beyond noise."""
    drum_radius: float = 0.61
    """Radius of the test drum, m, where a campaign does not state ``drum_radius``: 4.35 Hz at 60 km/h."""
    interference_p_value: float = 1e-4
    """p-value below which a frequency common to all tests counts as interference, corrected for all frequencies."""
    interference_frequencies: int = 6
    """Most such frequencies: a mains frequency, its multiples and a gear."""


@dataclass(frozen=True)
class IntegrationSettings:
    """Runge–Kutta steps per sampling interval. Noise has standard deviation 1 in a whitened observation."""

    fewest_steps: int = 1
    most_steps: int = 16
    """What is stiffer than this (a sharp dry friction) takes too long to fit."""
    most_steps_to_stabilise: int = 64
    """In slowly sampled records more steps keep fast states of an effect stable."""
    output_change: float = 0.05
    """Largest change of a whitened observation when the step is halved: small beside the noise."""
    sensitivity_change: float = 0.01
    """Relative change of a score test's direction when the step is halved: costs 1e-4 of the test's power."""
    static_steps: int = 2
    """Steps for an effect without states: nothing moves faster than in the fitted model."""
    calibration_steps: int = 4
    """Steps in the calibration tests, which are slow."""
    calibration_output_change: float = 0.3
    """The same as `output_change`, for all whitened samples of a stage together (root of the sum of squares)."""
    calibration_sensitivity_change: float = 0.03
    """The same as `sensitivity_change`, in the calibration tests."""
    new_test_steps: int = 8
    """Steps in proposed experiments, where no noise is known yet."""


#: A refit ends 0.02 standard deviations from the minimum: criteria differ by far more than the 1e-3 that it leaves.
#: Where steps a thousandth as long as Newton's fail, derivatives and values disagree: shorter steps gain nothing.
_REFINE = RefineSettings(max_iterations=40, gradient_tolerance=0.02, decrease_tolerance=1e-3, most_damping=1e3)
_FINE_REFINE = replace(_REFINE, lanes=4, max_iterations=20)
_REFIT = RefineSettings(
    max_iterations=4, gradient_tolerance=0.0, decrease_tolerance=0.0, damping=1e-6, least_damping=1e-6
)


@dataclass(frozen=True)
class FitSettings:
    """Fits of the baseline and of candidate models."""

    starts: int = 7
    """Starts of the baseline beside the nominal values: with them as many as SIMD lanes."""
    refine: RefineSettings = _REFINE
    fine_refine: RefineSettings = _FINE_REFINE
    """Where integration takes most of the time: there four points are as fast as one."""
    fine_steps: int = 8
    """Steps per sample from which on `fine_refine` holds."""
    grid_starts: int = 3
    """Grid points of an effect that a refit starts from, each twice: with the typical size no more than lanes."""
    condition_starts: int = 13
    """Starts along an effect that moves a condition of the tests: one per turn of the wheel over `condition_reach`."""
    condition_reach: float = 3.0
    """How far those reach to each side, in standard deviations of the effect's size."""
    stage_evaluations: int = 30
    """Most evaluations when a calibration stage is fitted again with an effect; it starts near its minimum."""
    stage_rounds: int = 10
    """Most rounds of refitting the stages and the model in turn."""
    stage_tolerance: float = 0.1
    """Change of the log posterior at which those rounds end."""
    stage_gain: float = 300.0
    """Largest decrease of the sum of squares to expect of the first of those rounds, generously."""


@dataclass(frozen=True)
class ResidualSettings:
    """Residual tests and residual maps."""

    smooth_harmonics: int = 5
    """Harmonics whose change with frequency is tested one by one."""
    smooth_degree: int = 2
    """Degree of the polynomial in log frequency that such a change follows."""
    listed: float = 0.01
    """p-value, corrected for the number of tests, below which an entry is listed."""
    map_cells: int = 12
    """Cells of the map over input and rate, each way."""
    map_intervals: int = 10
    """Intervals of a record in the map over time."""
    widest_estimate: float = 0.5
    """Standard deviation, relative to a uniform prior's, from which a single test says nothing of a parameter."""


@dataclass(frozen=True)
class SignificanceSettings:
    """p-values, each corrected for the number of tests it is the smallest of."""

    gap: float = 5e-3
    """Below: there is a gap."""
    one_more: float = 3e-3
    """Below: one more effect is tried beside those found."""
    residual: float = 1e-3
    """Below: the best candidate model leaves a gap."""


@dataclass(frozen=True)
class SearchSettings:
    """Which candidate models are fitted."""

    promising: float = 0.1
    """Share of the largest T from which a candidate is refitted."""
    relaxed_promising: float = 0.01
    """The same where none of the promising ones explains the gap: a strong effect bends its own direction."""
    extension_promising: float = 0.5
    """Share of the largest promised decrease of the criterion from which one more effect is tried: what is left is
    small, so the score test is nearly exact."""
    contender: float = 60.0
    """Difference of the criterion up to which an effect is fitted both with and without it in the calibration tests."""
    most_refits: int = 12
    """Most candidates that are refitted at once."""
    most_extensions: int = 6
    """Most sets of one more effect that are fitted at once."""
    most_effects: int = 3
    unexplained: tuple[float, ...] = (0.8, 0.5)
    """Largest shares of the gap's whitened squares that one effect and two may leave for one more to be tried. Of two
    effects the better one explains more, and of three the best two do. What an effect moves is always tried."""
    doubt: float = 2.0
    """Standard deviations of the noise's squares by which one effect must exceed its share; a third effect is rarer."""


@dataclass(frozen=True)
class VerdictSettings:
    """When a gap counts as explained, and which candidate models count as indistinguishable."""

    residual_share: float = 0.02
    """Share of the gap's squares that must be left before the verdict is "unknown": with enough real data everything
    is significant."""
    residual_share_of_several: float = 0.002
    """The same where one effect was not enough: what several effects must bend to follow is not explained yet."""
    residual_of_peak: float = 2e-4
    """Root mean square, relative to the output's peak, that must be left as well."""
    reported_share: float = 0.02
    """Share from which a significant remainder is reported beside the effect."""
    coarse: float = 0.02
    """Gap relative to the output's peak from which the relaxed criterion is tried if nothing explains the gap: such a
    model misses more than one thing, and the main one is worth a name."""
    resolution: float = 0.1
    """Relaxed criterion: a discrepancy of this share of the gap counts as noise,"""
    coarse_share: float = 0.4
    """the best single effect may leave this share of the gap's squares (never more than the gap's share of the peak:
    the smaller the gap, the more must be explained),"""
    coarse_factor: float = 2.0
    """and any other must leave this many times as much."""
    indistinguishable: float = 4.6
    """Difference of the criterion below which models are indistinguishable: less than ten times less probable."""
    indistinguishable_of_several: float = 1.4
    """The same where the best has several effects: half as probable. A less probable one is right in one case of three
    at most, and more sets come close than single effects."""
    possible: float = 9.2
    """Difference up to which a model is not ruled out (a hundred times less probable): the next experiment must
    distinguish these as well, or they come back with it."""


@dataclass(frozen=True)
class CrossValidationSettings:
    """The share of the gap that is removed on held-out tests."""

    refit: RefineSettings = _REFIT
    """Four Gauss–Newton steps from the minimum of all tests to that of all but one, which is near; the damping keeps
    flat directions solvable."""
    draws: int = 400
    """Draws of the parameters for the interval: 5 % quantiles within 1 % of probability."""
    p_value: float = 0.01
    """p-value below which rotating and slow lines hold a gap that counts on the raw data."""
    clear: float = 4.0
    """Standard deviations of the noise's power beyond which the linearised effect leaves a gap."""


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
    divergence: float = 100.0
    """Multiple of the largest measured output past which a simulation has diverged."""


@dataclass(frozen=True)
class DiagnosisSettings:
    """All settings of a diagnosis. The benchmark withheld_effects counts what errors the defaults make."""

    spectral: SpectralSettings = field(default_factory=SpectralSettings)
    integration: IntegrationSettings = field(default_factory=IntegrationSettings)
    fit: FitSettings = field(default_factory=FitSettings)
    residual: ResidualSettings = field(default_factory=ResidualSettings)
    significance: SignificanceSettings = field(default_factory=SignificanceSettings)
    search: SearchSettings = field(default_factory=SearchSettings)
    verdict: VerdictSettings = field(default_factory=VerdictSettings)
    cross_validation: CrossValidationSettings = field(default_factory=CrossValidationSettings)
    next_experiment: NextExperimentSettings = field(default_factory=NextExperimentSettings)

    def relaxed(self, gap: float) -> DiagnosisSettings:
        """The relaxed criterion for a large gap (relative to the output's peak): one effect, a remainder allowed."""
        share = min(self.verdict.coarse_share, gap)
        verdict = replace(self.verdict, residual_share=share, residual_share_of_several=share)
        return replace(self, search=replace(self.search, most_effects=1), verdict=verdict)
