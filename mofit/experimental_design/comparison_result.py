"""What a comparison of experiments holds: every number that the terminal, the page and ``--json`` show."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from mofit._typing import FloatArray
from mofit.experimental_design.augmentation import Augmentation
from mofit.experimental_design.expected_profiles import ProfileInterval
from mofit.experimental_design.identifiability import IDENTIFIABLE
from mofit.experimental_design.information import SourceInformation
from mofit.experimental_design.simulated_identification import SimulatedEstimate


@dataclass(frozen=True)
class ExperimentSet:
    """Tests that are identified together: a name, the place of their source among the files, and their names."""

    name: str
    source: int
    tests: tuple[str, ...]


@dataclass(frozen=True)
class ParameterResult:
    """One parameter in one experiment; SI units, standard deviations at most those of the bounds."""

    parameter: str
    verdict: str
    """One of `mofit.experimental_design.identifiability.VERDICTS`."""
    sd: float
    relative_sd: float
    """Expected standard deviation of the estimate, median over the samples; and over the value's magnitude."""
    sd_at_values: float
    """The same at the reference values alone; from the profile, where one was traced and closes."""
    relative_sd_range: tuple[float, float]
    """Least and largest ``relative_sd`` over the samples."""
    relative_sd_after_60_s: float
    """``relative_sd`` after 60 s of this experiment, at the reference values."""
    bound_sd: float
    """Cramér-Rao bound: of the best estimate that the tests allow, at the reference values."""
    conditional_sd: float
    """All other parameters known, at the reference values."""
    variance_inflation: float
    """Variance inflation factor there."""
    verdicts: Mapping[str, int]
    """How many of the samples have which verdict, before profiles."""
    correlated_with: tuple[str, ...]
    """Parameters that compensate for a change of this one, where it is identifiable only in a combination."""
    profile: ProfileInterval | None
    """Its expected profile, where one was traced."""
    sentence: str


@dataclass(frozen=True, eq=False)
class ExperimentResult:
    """One experiment: its parameters and their correlation at the reference values."""

    experiment: ExperimentSet
    seconds: float
    """Duration of its tests, without calibration tests and pauses."""
    parameters: Mapping[str, ParameterResult]
    covariance: FloatArray
    """Of all parameters in the unit cube with their bounds, (d, d)."""
    condition_index: float
    """The largest of the parameters that no calibration stage estimates, those being nuisances."""


@dataclass(frozen=True)
class InformationShare:
    """How much each of T tests contributes to the information on P parameters in one experiment."""

    experiment: str
    tests: tuple[str, ...]
    share: FloatArray
    """Share of the precision of each parameter, all others estimated along with it, (T, P)."""
    calibration: FloatArray
    """Share of the calibration stages, (P,); what is missing to 1 comes from the bounds."""
    without: FloatArray
    """Standard deviation without the test over that with all, (T, P)."""


@dataclass(frozen=True, eq=False)
class Comparison:
    """Experiments side by side."""

    parameters: tuple[str, ...]
    """Those that are shown."""
    required: tuple[str, ...]
    """Those asked for by name."""
    sources: tuple[SourceInformation, ...]
    """Information of the tests of each file."""
    experiments: tuple[ExperimentResult, ...]
    shares: tuple[InformationShare, ...]
    """Of every experiment of several tests."""
    notes: tuple[str, ...]
    """What a reader should know, in sentences."""
    augmentations: Mapping[str, Augmentation | None] = field(default_factory=dict)
    """For required parameters that no experiment identifies: the cheapest test that would help, if there is one."""
    simulated: Mapping[str, Mapping[str, SimulatedEstimate]] = field(default_factory=dict)
    """Estimates from simulated data, by experiment and parameter."""

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
