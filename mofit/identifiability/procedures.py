"""Tests that need not have been run: as the kernel drives them, judged where a measured one would be."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mofit.campaign import Campaign, Measurement, Procedure
from mofit.drives import require, to_drive
from mofit.errors import InputError
from mofit.kernel import Drive, Simulator
from mofit.model import Model, build_system
from mofit.signals import Record, find_settled, settled_samples

Array = NDArray[np.float64]


def planned_drives(
    model: Model, procedures: Sequence[Procedure], values: Array, jobs: int = 1, *, settled: bool = False
) -> tuple[Drive, ...]:
    """Procedures as the kernel drives them; their outputs are simulated at ``values`` (p,), without noise.

    Transients are left out as the identification does: at least one period of a periodic test, and more where the
    simulated output takes longer to settle; with ``settled``, the first half of a test that does not repeat.

    Raises
    ------
    InputError
        With every channel and condition that a procedure lacks; if the model gives no finite output.
    """
    units = {channel.name: channel.unit for channel in (*model.inputs, *model.outputs)}
    # any signal that is not constant serves until the true one is simulated
    blank = [
        Measurement(p, {c.name: np.linspace(0.0, 1.0, len(p.time)) for c in model.outputs}, units) for p in procedures
    ]
    require(model, Campaign("planned", "simulated", {}, tuple(blank)))
    open_records = [_record(measurement, None) for measurement in blank]
    drives = [to_drive(model, m, r, settled) for m, r in zip(blank, open_records, strict=True)]
    simulator = Simulator(build_system(model), drives, (), jobs=jobs, tolerance=1e-4)
    found = []
    for measurement, outputs in zip(blank, simulator.simulate(values[None]), strict=True):
        if not np.all(np.isfinite(outputs)):
            raise InputError.of(
                f"test '{measurement.name}'",
                f"model '{model.name}' gives no finite output",
                "Check the parameters' values and the test's amplitude",
            )
        channels = {channel.name: outputs[0][:, i] for i, channel in enumerate(model.outputs)}
        simulated = replace(measurement, outputs=channels)
        record = _record(simulated, measurement.procedure.frequency)
        found.append(to_drive(model, simulated, record, settled))
    return tuple(found)


def _record(measurement: Measurement, frequency: float | None) -> Record:
    """What is known of a test without noise: its period from its frequency, its transient from its output."""
    time, procedure = measurement.time, measurement.procedure
    if not frequency or measurement.kind == "step":
        return Record(None, 0, 0.0, 0.0, {}, "none", {})
    period = 1 / frequency
    settled = [find_settled(time, values, period) for values in measurement.outputs.values()]
    transient, tail = max(first for first, _ in settled), max(last for _, last in settled)
    if procedure.transient is not None:
        transient = procedure.transient
    kept = settled_samples(time, transient, tail)
    periods = int((np.count_nonzero(kept) + 0.5) * procedure.step / period)
    return Record(period, periods, transient, tail, {}, "none", {})
