"""Model exchange: FMPy integrates the equations of an FMU over a record, with CVode and all events."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from mofit._typing import FloatArray
from mofit.models.black_box import Record
from mofit.models.fmu.mapping import FmuMapping
from mofit.quantities import HOLD


def exchange(
    fmu: Any, description: Any, folder: str, mapping: FmuMapping, record: Record, parameters: Mapping[str, float]
) -> FloatArray:
    """Outputs (n, ny) in SI units at the samples of a record, between which inputs run as it says.

    Raises
    ------
    RuntimeError
        If the FMU ends the simulation before the record ends.
    """
    from fmpy import simulate_fmu

    n = len(record.time)
    step = float(record.time[-1]) / (n - 1) if n > 1 else 1.0
    start = {name: value for name, _, value in mapping.values}
    start |= {port.variable: float(port.from_si(parameters[port.name])) for port in mapping.parameters}
    start |= {port.variable: float(port.from_si(record.conditions[port.name])) for port in mapping.conditions}
    if record.interpolation != HOLD:
        _follow_inputs(fmu, description, mapping, record)
    result = simulate_fmu(
        folder,
        validate=False,
        start_time=0.0,
        stop_time=float(record.time[-1]),
        output_interval=step,
        relative_tolerance=mapping.tolerance,
        fmi_type="ModelExchange",
        record_events=False,
        start_values=start,
        input=_signals(mapping, record),
        output=[port.variable for port in mapping.outputs],
        model_description=description,
        fmu_instance=fmu,
    )
    if len(result) != n:
        raise RuntimeError(f"the FMU ended the simulation at {result['time'][-1]:g} s")
    return np.stack([port.to_si(np.asarray(result[port.variable], dtype=float)) for port in mapping.outputs], axis=1)


def _follow_inputs(fmu: Any, description: Any, mapping: FmuMapping, record: Record) -> None:
    """Let every time that the solver sets bring its inputs along.

    FMPy by itself sets inputs at samples, and between them only where there are event indicators: without, they would
    be held during a step, half a sample late on average.
    """
    three, references = description.fmiMajorVersion == 3, [port.reference for port in mapping.inputs]
    setter = fmu.setFloat64 if three else fmu.setReal
    curves, end = [(port, record.curve(port.name)) for port in mapping.inputs], float(record.time[-1])

    def set_time(time: float) -> None:
        type(fmu).setTime(fmu, time)
        if references:
            setter(references, [float(port.from_si(curve(min(time, end))[0])) for port, curve in curves])

    fmu.setTime = set_time


def _signals(mapping: FmuMapping, record: Record) -> Any:
    """Inputs as FMPy takes them: a structured array with the time.

    A time that stands there twice is an event: so an input that is held jumps at samples, and the solver begins anew.
    """
    if not mapping.inputs:
        return None
    n, held = len(record.time), record.interpolation == HOLD
    times = np.repeat(np.arange(n), 2)[1:] if held else np.arange(n)
    values = np.repeat(np.arange(n), 2)[:-1] if held else times
    names = ["time", *(port.variable for port in mapping.inputs)]
    signals = np.zeros(len(times), dtype=[(name, np.float64) for name in names])
    signals["time"] = record.time[times]
    for port in mapping.inputs:
        signals[port.variable] = port.from_si(record.inputs[port.name])[values]
    return signals
