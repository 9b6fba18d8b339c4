"""Co-simulation of an FMU over a record."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from mofit._typing import FloatArray
from mofit.models.black_box import Record
from mofit.models.fmu.mapping import FmuMapping, Port


def co_simulate(
    fmu: Any, description: Any, folder: str, mapping: FmuMapping, record: Record, parameters: Mapping[str, float]
) -> FloatArray:
    r"""Outputs (n, ny) in SI units at the samples of a record.

    There are one or more communication steps per sample (`FmuMapping.steps_in`). Inputs are linear between samples. An
    FMU that interpolates (FMI 2, ``canInterpolateInputs``) gets value and slope at the beginning of each step. Any
    other one holds an input during a step of length h: it gets the value at the end of the step, so that its output
    there is that of the input there; inside, it sees the input h / 2 too early on average.

    Raises
    ------
    RuntimeError
        If the FMU ends the simulation before the record ends.
    """
    three = description.fmiMajorVersion == 3
    setter, getter = (fmu.setFloat64, fmu.getFloat64) if three else (fmu.setReal, fmu.getReal)
    interpolates = not three and description.coSimulation.canInterpolateInputs
    interval = float(record.time[-1]) / (len(record.time) - 1) if len(record.time) > 1 else 1.0
    steps = mapping.steps_in(interval)
    step = interval / steps
    inputs, references = _inputs(mapping, record, steps), [port.reference for port in mapping.inputs]
    seen = [port.reference for port in mapping.outputs]
    found = np.empty((len(record.time), len(seen)))

    _initialise(fmu, three, mapping, record, parameters, setter, inputs[0].tolist())
    found[0] = getter(seen)
    for k in range(len(inputs) - 1):
        if references and interpolates:
            setter(references, inputs[k].tolist())
            slopes = ((inputs[k + 1] - inputs[k]) / step).tolist()
            fmu.setRealInputDerivatives(references, [1] * len(references), slopes)
        elif references:
            setter(references, inputs[k + 1].tolist())
        ended = fmu.doStep(currentCommunicationPoint=k * step, communicationStepSize=step)
        if three and (ended[1] or ended[2]):
            raise RuntimeError(f"the FMU ended the simulation at {ended[3]:g} s")
        if (k + 1) % steps == 0:
            found[(k + 1) // steps] = getter(seen)
    fmu.terminate()
    return _in_si(found, mapping.outputs)


def _initialise(
    fmu: Any,
    three: bool,
    mapping: FmuMapping,
    record: Record,
    parameters: Mapping[str, float],
    setter: Any,
    inputs: list[float],
) -> None:
    references, values = constants(mapping, record, parameters)
    end = float(record.time[-1])
    if not three:
        fmu.setupExperiment(tolerance=mapping.tolerance, startTime=0.0, stopTime=end)
    setter(references, values)
    if three:
        fmu.enterInitializationMode(tolerance=mapping.tolerance, startTime=0.0, stopTime=end)
    else:
        fmu.enterInitializationMode()
    if mapping.inputs:
        setter([port.reference for port in mapping.inputs], inputs)
    fmu.exitInitializationMode()


def constants(mapping: FmuMapping, record: Record, parameters: Mapping[str, float]) -> tuple[list[int], list[float]]:
    """References and values, in the FMU's units, of all that does not change during a record."""
    ports = [(port, parameters[port.name]) for port in mapping.parameters]
    ports += [(port, record.conditions[port.name]) for port in mapping.conditions]
    references = [reference for _, reference, _ in mapping.values] + [port.reference for port, _ in ports]
    values = [value for *_, value in mapping.values] + [float(port.from_si(value)) for port, value in ports]
    return references, values


def _inputs(mapping: FmuMapping, record: Record, steps: int) -> FloatArray:
    """Inputs at the communication points, (steps (n - 1) + 1, nu), in the FMU's units."""
    samples = np.arange(len(record.time))
    points = np.arange(steps * (len(samples) - 1) + 1) / steps
    columns = [port.from_si(np.interp(points, samples, record.inputs[port.name])) for port in mapping.inputs]
    return np.stack(columns, axis=1) if columns else np.zeros((len(points), 0))


def _in_si(found: FloatArray, ports: tuple[Port, ...]) -> FloatArray:
    return np.stack([port.to_si(found[:, k]) for k, port in enumerate(ports)], axis=1)
