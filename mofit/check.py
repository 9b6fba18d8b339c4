"""All that is wrong or odd with a campaign file, in one list."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations
from pathlib import Path

import numpy as np

from mofit.campaign import Array, Campaign, Measurement
from mofit.campaign_file import load
from mofit.errors import Fault
from mofit.labels import EXPECTED_CONDITIONS, PERIODIC_KINDS
from mofit.signals import Record, analyse, quantum, settled_samples

#: relative departure of the label from the data above which it is worth a word
FREQUENCY_OFF = 0.005
AMPLITUDE_OFF = 0.05
#: below this the shape of a period cannot be seen
SAMPLES_PER_PERIOD = 20
#: change of the output's mean over the record, in ranges
DRIFT = 0.05
#: resolution step, in ranges
COARSE = 0.01
#: NRMSD that a perfect model would reach, above which a test says little
NOISY = 0.1
#: equal samples in a row at an extreme value, and the share of the record that lies there
FLAT_RUN = 5
FLAT_SHARE = 0.005


def check_campaign(path: str | Path) -> list[Fault]:
    """Every fault of a campaign file: errors first, then warnings. An empty list means that all is well."""
    campaign, faults = load(path)
    if campaign is not None:
        for measurement in campaign.measurements:
            faults += oddities(measurement)
        faults += _across(campaign)
    return sorted(faults, key=lambda fault: fault.severity != "error")


def oddities(measurement: Measurement) -> list[Fault]:
    """What is odd with a sound test, as warnings."""
    record = analyse(measurement)
    return [
        Fault(f"group '{measurement.name}'{place}", what, cure, "warning")
        for check in (_label, _periods, _settling, _levels, _noise, _conditions)
        for place, what, cure in check(measurement, record)
    ]


_Found = Iterator[tuple[str, str, str]]


def _label(measurement: Measurement, record: Record) -> _Found:
    """Frequency and amplitude against the data."""
    procedure = measurement.procedure
    if measurement.kind not in PERIODIC_KINDS or record.period is None:
        return
    found = 1 / record.period
    if procedure.frequency and abs(found / procedure.frequency - 1) > FREQUENCY_OFF:
        off = 100 * (found / procedure.frequency - 1)
        what = f"labelled {procedure.frequency:.6g} Hz, the data say {found:.6g} Hz ({off:+.2f} %)"
        yield (
            ", attribute 'frequency'",
            what,
            "Nothing to do: the true frequency is used; correct the label if you like",
        )
    if procedure.amplitude and procedure.inputs:
        name, values = next(iter(procedure.inputs.items()))
        kept = settled_samples(measurement.time, record.transient, record.tail)
        amplitude = float(np.ptp(values[kept])) / 2
        if abs(amplitude / procedure.amplitude - 1) > AMPLITUDE_OFF:
            what = f"labelled {procedure.amplitude:.4g}, half the range of '{name}' is {amplitude:.4g} in its SI unit"
            yield ", attribute 'amplitude'", what, "Check the unit and the stroke; the data are used"


def _periods(measurement: Measurement, record: Record) -> _Found:
    """Whether a periodic test is one, and long and fine enough."""
    if record.period is None:
        if measurement.kind in PERIODIC_KINDS:
            yield (
                "",
                f"a {measurement.kind} test whose input does not repeat",
                "Check the input, or name another procedure",
            )
        return
    if record.periods == 0:
        what = f"no whole period of {record.period:.4g} s after the transient of {record.transient:.3g} s"
        yield "", what, "Record longer, better three periods"
    elif record.periods < 2 and measurement.kind == "sine":
        yield "", "only one whole period: noise cannot be told from the response", "Record at least three periods"
    per_period = record.period / measurement.procedure.step
    if measurement.kind == "sine" and per_period < SAMPLES_PER_PERIOD:
        yield "", f"{per_period:.1f} samples per period", f"Sample at least {SAMPLES_PER_PERIOD} times per period"


def _settling(measurement: Measurement, record: Record) -> _Found:
    """Transients, stops and drift."""
    duration = float(measurement.time[-1] - measurement.time[0])
    if record.transient > 0.4 * duration:
        what = f"the transient takes {record.transient:.3g} s of {duration:.3g} s"
        yield "", what, "Record longer, or check whether the rig ran steadily"
    if record.tail > 0:
        yield "", f"the last {record.tail:.3g} s do not repeat: the rig stopped", "Cut the record if that disturbs"
    if record.period is None or record.periods < 2:
        return
    kept = settled_samples(measurement.time, record.transient, record.tail)
    for name, values in measurement.outputs.items():
        drift = _drift(measurement.time[kept], values[kept], record.period) / float(np.ptp(values))
        if abs(drift) > DRIFT:
            what = f"its mean drifts by {100 * drift:+.1f} % of its range over the record"
            yield f", variable '{name}'", what, "Warm up the rig, or correct the zero of the sensor"


def _levels(measurement: Measurement, record: Record) -> _Found:
    """Clipping and coarse resolution."""
    for name, values in measurement.outputs.items():
        place = f", variable '{name}'"
        if measurement.kind != "step" and (run := max(_flat(values), _flat(-values))) >= FLAT_RUN:
            what = f"{run} equal samples in a row at its extreme, as if clipped or saturated"
            yield place, what, "Check the range of the sensor and the amplifier"
        if (step := quantum(values)) > COARSE * np.ptp(values):
            what = f"resolved in steps of {100 * step / np.ptp(values):.1f} % of its range"
            yield place, what, "Measure with a finer range"


def _noise(measurement: Measurement, record: Record) -> _Found:
    for name, floor in record.noise_floor.items():
        if floor > NOISY:
            what = f"noise is {100 * floor:.0f} % of its range ({record.noise_method})"
            yield f", variable '{name}'", what, "Average more periods, or raise the amplitude"
    if record.noise_method == "top of spectrum":
        what = "the noise can only be bounded from below: the signal is broad and does not repeat"
        yield "", what, "Repeat the test, or trust the noise of a periodic test of the same rig"


def _conditions(measurement: Measurement, record: Record) -> _Found:
    wanted = {name for channel in measurement.procedure.inputs for name in EXPECTED_CONDITIONS.get(channel, ())}
    for name in sorted(wanted - set(measurement.procedure.conditions)):
        yield "", f"no condition '{name}'", "Add it as a scalar variable with units to the root, or to the group"


def _across(campaign: Campaign) -> list[Fault]:
    """What is odd between tests: copies, and tests that ran at the same time."""
    faults = []
    for one, other in combinations(campaign.measurements, 2):
        where = f"groups '{one.name}' and '{other.name}'"
        if any(np.array_equal(v, other.outputs[name]) for name, v in one.outputs.items() if name in other.outputs):
            cure = "Leave one out: a copy counts twice in the identification"
            faults.append(Fault(where, "hold the same output, sample by sample", cure, "warning"))
        starts = one.procedure.start_time, other.procedure.start_time
        if starts[0] is not None and starts[1] is not None:
            (start, first), (later, _) = sorted(zip(starts, (one, other), strict=True), key=lambda pair: pair[0] or 0.0)
            if (later or 0.0) < (start or 0.0) + float(first.time[-1] - first.time[0]):
                faults.append(Fault(where, "overlap in time", "Correct their 'start_time'", "warning"))
    return faults


def _flat(values: Array) -> int:
    """Longest run of samples at the maximum, beyond what a resolution step makes of a smooth peak."""
    top = values == values.max()
    edges = np.flatnonzero(np.diff(np.concatenate([[0], top.astype(int), [0]])))
    longest = int(np.max(edges[1::2] - edges[::2]))
    step = quantum(values)
    near = np.mean(values > values.max() - 2 * step) if step else 0.0
    # of a smooth peak half the samples within two steps lie within one; clipped, nearly all do
    return longest if np.mean(top) > max(FLAT_SHARE, 0.8 * near) else 0


def _drift(time: Array, values: Array, period: float) -> float:
    """Change of the period's mean from the first to the last whole period."""
    step = (time[-1] - time[0]) / (len(time) - 1)
    samples = round(period / step)
    return float(values[-samples:].mean() - values[:samples].mean())
