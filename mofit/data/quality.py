"""Data quality: every error and every warning about a campaign file, in one list."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import numpy as np

from mofit._typing import FloatArray
from mofit.data.campaign import Campaign, Measurement
from mofit.data.campaign_file import load
from mofit.data.copies import copy_issues
from mofit.data.likely_causes import far_sizes, frequency_cause, unlikely_sizes
from mofit.data.other_units import other_unit_issues
from mofit.data.response import responses
from mofit.data.sign_and_delay import sign_and_delay_issues
from mofit.data.signals import SignalAnalysis, analyse, steady_samples
from mofit.data.signals.smoothing import quantisation_step
from mofit.errors import Issue
from mofit.quantities import EXPECTED_CONDITIONS, PERIODIC_EXCITATIONS, SINGLE_EXCITATIONS
from mofit.runtime.progress import Progress, silent


@dataclass(frozen=True)
class QualityLimits:
    """Limits above or below which a property of the data is a warning."""

    frequency: float = 0.005
    """Relative error of the frequency label: rigs hold their speed to a few per mille."""
    amplitude: float = 0.05
    """Relative error of the amplitude label; a wrong unit makes far more."""
    samples_per_period: int = 20
    """With fewer the shape of a period cannot be seen."""
    transient: float = 0.4
    """Share of the record: the steady part should be the larger one."""
    drift: float = 0.05
    """Change of the output's mean over the record, in ranges."""
    resolution: float = 0.01
    """Quantisation step, in ranges: its noise is then 0.3 % of the range."""
    noise: float = 0.1
    """Noise floor (NRMSD of a perfect model) above which a test contributes little."""
    clipped_samples: int = 5
    """Equal samples in a row at an extreme value; a smooth peak has two or three."""
    clipped_share: float = 0.005
    """Share of the record at the extreme value."""


LIMITS = QualityLimits()


def check_campaign(campaign: Campaign | str | Path, progress: Progress = silent) -> list[Issue]:
    """Every issue of a campaign or its file: errors first, then warnings. An empty list means that there is none."""
    if isinstance(campaign, Campaign):
        return campaign_warnings(campaign, progress)
    progress("read", 0, 0, "")
    sound, issues = load(campaign)
    if sound is not None:
        issues += campaign_warnings(sound, progress)
    return sorted(issues, key=lambda issue: issue.severity != "error")


def campaign_warnings(campaign: Campaign, progress: Progress = silent) -> list[Issue]:
    """Data-quality warnings about the tests of a campaign, one by one and beside each other."""
    issues, analyses, count = [], {}, len(campaign.measurements)
    for done, measurement in enumerate(campaign.measurements):
        progress("check", done, count, measurement.name)
        analyses[measurement.name] = analyse(measurement)
        issues += quality_warnings(measurement)
    progress("compare", 0, 1, "the tests with each other")
    issues += _sizes(campaign.measurements, analyses)
    issues += sign_and_delay_issues(responses(campaign.measurements, analyses), campaign.measurements)
    issues += [*copy_issues(campaign), *_overlaps(campaign)]
    progress("compare", 1, 1, "")
    return issues


def _sizes(measurements: Sequence[Measurement], analyses: Mapping[str, SignalAnalysis]) -> list[Issue]:
    """Channels of an unusual size; of several words on one place the most telling."""
    found = [*unlikely_sizes(measurements), *other_unit_issues(measurements, analyses), *far_sizes(measurements)]
    said: dict[str, Issue] = {}
    for issue in found:
        said.setdefault(issue.where, issue)
    return list(said.values())


def quality_warnings(measurement: Measurement) -> list[Issue]:
    """Data-quality warnings about a test without errors."""
    analysis = analyse(measurement)
    return [
        Issue(f"group '{measurement.name}'{place}", message, hint, "warning")
        for check in (_label, _periods, _steadiness, _levels, _noise, _conditions)
        for place, message, hint in check(measurement, analysis)
    ]


_Found = Iterator[tuple[str, str, str]]


def _label(measurement: Measurement, analysis: SignalAnalysis) -> _Found:
    """Frequency and amplitude against the data."""
    experiment = measurement.experiment
    found = analysis.frequency
    if measurement.kind not in PERIODIC_EXCITATIONS or found is None:
        return
    if experiment.frequency and abs(off := found / experiment.frequency - 1) > LIMITS.frequency:
        message = f"labelled {experiment.frequency:.6g} Hz, the data show {found:.6g} Hz ({100 * off:+.2f} %)"
        cause, hint = frequency_cause(experiment.frequency, found, 1 / experiment.step)
        message += f": {cause}" if cause else ""
        yield ", attribute 'frequency'", message, hint
    if experiment.amplitude and experiment.inputs:
        name, values = next(iter(experiment.inputs.items()))
        kept = steady_samples(measurement.time, analysis.transient, analysis.tail)
        amplitude = float(np.ptp(values[kept])) / 2
        if abs(amplitude / experiment.amplitude - 1) > LIMITS.amplitude:
            message = (
                f"labelled {experiment.amplitude:.4g}, half the range of '{name}' is {amplitude:.4g} in its SI unit"
            )
            yield ", attribute 'amplitude'", message, "Check the unit and the stroke; the data are used"


def _periods(measurement: Measurement, analysis: SignalAnalysis) -> _Found:
    """Whether a periodic test is one, and long and fine enough."""
    kind = measurement.kind
    if analysis.period is None:
        if kind in PERIODIC_EXCITATIONS and analysis.frequency is None:
            yield "", f"a {kind} test whose input does not repeat", "Check the input, or name another procedure"
        elif kind in PERIODIC_EXCITATIONS:
            message = "the input has a frequency, but no two periods of it are equal"
            yield "", message, "Used as a whole record, ramps included; if the rig should run steadily, check it"
        return
    if analysis.periods == 0:
        message = f"no whole period of {analysis.period:.4g} s after the transient of {analysis.transient:.3g} s"
        yield "", message, "Record longer, better three periods"
    elif analysis.periods < 2 and kind == "sine":
        message = "only one whole period: noise and response cannot be separated"
        yield "", message, "Record at least three periods"
    per_period = analysis.period / measurement.experiment.step
    if kind == "sine" and per_period < LIMITS.samples_per_period:
        hint = f"Sample at least {LIMITS.samples_per_period} times per period"
        yield "", f"{per_period:.1f} samples per period", hint


def _steadiness(measurement: Measurement, analysis: SignalAnalysis) -> _Found:
    """Transients, stops and drift."""
    duration = float(measurement.time[-1] - measurement.time[0])
    if analysis.transient > LIMITS.transient * duration:
        message = f"the transient takes {analysis.transient:.3g} s of {duration:.3g} s"
        yield "", message, "Record longer, or check whether the rig ran steadily"
    if analysis.tail > 0:
        message = f"the last {analysis.tail:.3g} s do not repeat: the rig stopped"
        yield "", message, "These samples are not used; cut the record if you like"
    if analysis.period is None or analysis.periods < 2:
        return
    kept = steady_samples(measurement.time, analysis.transient, analysis.tail)
    for name, values in measurement.outputs.items():
        drift = _drift(values[kept], analysis.period / measurement.experiment.step) / float(np.ptp(values))
        if abs(drift) > LIMITS.drift:
            message = f"its mean drifts by {100 * drift:+.1f} % of its range over the record"
            yield f", variable '{name}'", message, "Warm up the rig, or correct the zero of the sensor"


def _levels(measurement: Measurement, analysis: SignalAnalysis) -> _Found:
    """Clipping and coarse resolution."""
    for name, values in measurement.outputs.items():
        place = f", variable '{name}'"
        run = max(_clipped(values), _clipped(-values))
        if measurement.kind not in SINGLE_EXCITATIONS and run >= LIMITS.clipped_samples:
            message = f"{run} equal samples in a row at its extreme, as if clipped or saturated"
            yield place, message, "Check the range of the sensor and the amplifier"
        if (step := quantisation_step(values)) > LIMITS.resolution * np.ptp(values):
            message = f"resolved in steps of {100 * step / np.ptp(values):.1f} % of its range"
            yield place, message, "Measure with a finer range"


def _noise(measurement: Measurement, analysis: SignalAnalysis) -> _Found:
    for name, floor in analysis.noise_floor.items():
        if floor > LIMITS.noise:
            message = f"noise is {100 * floor:.0f} % of its range ({analysis.noise_method})"
            yield f", variable '{name}'", message, "Average more periods, or raise the amplitude"
    if analysis.noise_method == "top of spectrum":
        message = "only a lower bound of the noise is known: the signal is broad and does not repeat"
        yield "", message, "Repeat the test, or rely on the noise of a periodic test of the same rig"


def _conditions(measurement: Measurement, analysis: SignalAnalysis) -> _Found:
    wanted = {name for channel in measurement.experiment.inputs for name in EXPECTED_CONDITIONS.get(channel, ())}
    for name in sorted(wanted - set(measurement.experiment.conditions)):
        yield "", f"no condition '{name}'", "Add it as a scalar variable with units to the root, or to the group"


def _overlaps(campaign: Campaign) -> Iterator[Issue]:
    """Tests that ran at the same time."""
    for one, other in combinations(campaign.measurements, 2):
        spans = [
            (m.experiment.start_time, m.experiment.start_time + float(m.time[-1] - m.time[0]))
            for m in (one, other)
            if m.experiment.start_time is not None
        ]
        if len(spans) == 2 and max(begin for begin, _ in spans) < min(end for _, end in spans):
            where = f"groups '{one.name}' and '{other.name}'"
            yield Issue(where, "overlap in time", "Correct their 'start_time'", "warning")


def _clipped(values: FloatArray) -> int:
    """Longest run of samples at the maximum; 0 where a quantised smooth peak explains them."""
    top = values == values.max()
    edges = np.flatnonzero(np.diff(np.concatenate([[0], top.astype(int), [0]])))
    longest = int(np.max(edges[1::2] - edges[::2]))
    step = quantisation_step(values)
    near = np.mean(values > values.max() - 2 * step) if step else 0.0
    # of a smooth peak half the samples within two steps lie within one; clipped, nearly all do
    return longest if np.mean(top) > max(LIMITS.clipped_share, 0.8 * near) else 0


def _drift(values: FloatArray, per_period: float) -> float:
    """Change of the period's mean from the first to the last whole period."""
    samples = round(per_period)
    return float(values[-samples:].mean() - values[:samples].mean())
