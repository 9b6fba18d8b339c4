"""What a comparison of experiments holds: every number that the terminal, the page and ``--json`` show."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from mofit._typing import FloatArray
from mofit.design.augmentation import Augmentation
from mofit.design.expected_profiles import ProfileInterval
from mofit.design.identifiability import IDENTIFIABLE
from mofit.design.information import SourceInformation
from mofit.design.planned_tests import ExperimentSet
from mofit.design.simulated_identification import SimulatedEstimate


@dataclass(frozen=True)
class ParameterResult:
    """One parameter in one experiment; SI units, standard deviations at most those of the bounds.

    Parameters
    ----------
    parameter
        Its name.
    verdict
        One of `mofit.design.identifiability.VERDICTS`.
    sd, relative_sd
        Expected standard deviation of the estimate, median over the parameter samples; and over the value's magnitude.
    sd_at_values
        The same at the reference values alone; from the profile, where one was traced and closes.
    relative_sd_range
        Least and largest ``relative_sd`` over the samples.
    relative_sd_after_60_s
        ``relative_sd`` after 60 s of this experiment, at the reference values.
    bound_sd
        Cramér-Rao bound: of the best estimate that the tests allow, at the reference values.
    conditional_sd
        All other parameters known, at the reference values.
    variance_inflation
        Variance inflation factor there.
    verdicts
        How many of the samples have which verdict, before profiles.
    correlated_with
        Parameters that compensate for a change of this one, where it is identifiable only in a combination.
    profile
        Its expected profile, where one was traced.
    sentence
        The result in words.
    """

    parameter: str
    verdict: str
    sd: float
    relative_sd: float
    sd_at_values: float
    relative_sd_range: tuple[float, float]
    relative_sd_after_60_s: float
    bound_sd: float
    conditional_sd: float
    variance_inflation: float
    verdicts: Mapping[str, int]
    correlated_with: tuple[str, ...]
    profile: ProfileInterval | None
    sentence: str


@dataclass(frozen=True, eq=False)
class ExperimentResult:
    """One experiment: its parameters and their correlation at the reference values.

    Parameters
    ----------
    experiment
        Its tests.
    seconds
        Their duration, without calibration tests and pauses.
    parameters
        Results by parameter.
    covariance
        Of all parameters in the unit cube with their bounds, (d, d).
    condition_index
        The largest of the parameters that no calibration stage estimates, those being nuisances.
    """

    experiment: ExperimentSet
    seconds: float
    parameters: Mapping[str, ParameterResult]
    covariance: FloatArray
    condition_index: float


@dataclass(frozen=True)
class InformationShare:
    """How much each of T tests contributes to the information on P parameters in one experiment.

    Parameters
    ----------
    experiment
        Name of the experiment.
    tests
        Names of its tests.
    share
        Share of the precision of each parameter, all others estimated along with it, (T, P).
    calibration
        Share of the calibration stages, (P,); what is missing to 1 comes from the bounds.
    without
        Standard deviation without the test over that with all, (T, P).
    """

    experiment: str
    tests: tuple[str, ...]
    share: FloatArray
    calibration: FloatArray
    without: FloatArray


@dataclass(frozen=True, eq=False)
class Comparison:
    """Experiments side by side.

    Parameters
    ----------
    parameters
        Those that are shown.
    required
        Those asked for by name.
    sources
        Information of the tests of each file.
    experiments
        Results by experiment.
    shares
        Of every experiment of several tests.
    notes
        What a reader should know, in sentences.
    augmentations
        For required parameters that no experiment identifies: the cheapest test that would help, if there is one.
    simulated
        Estimates from simulated data, by experiment and parameter.
    """

    parameters: tuple[str, ...]
    required: tuple[str, ...]
    sources: tuple[SourceInformation, ...]
    experiments: tuple[ExperimentResult, ...]
    shares: tuple[InformationShare, ...]
    notes: tuple[str, ...]
    augmentations: Mapping[str, Augmentation | None] = field(default_factory=dict)
    simulated: Mapping[str, Mapping[str, SimulatedEstimate]] = field(default_factory=dict)

    @property
    def not_identifiable(self) -> tuple[str, ...]:
        """Required parameters that no experiment identifies."""
        return tuple(
            name
            for name in self.required
            if not any(row.parameters[name].verdict == IDENTIFIABLE for row in self.experiments)
        )

    def best(self, name: str) -> ExperimentResult:
        """The experiment with the least relative standard deviation of a parameter."""
        return min(self.experiments, key=lambda row: row.parameters[name].relative_sd)
