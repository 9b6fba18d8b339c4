"""Co-simulation of an FMU over a record."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from mofit._typing import FloatArray
from mofit.models.black_box import Record
from mofit.models.fmu.mapping import FmuMapping, Port
from mofit.quantities import HOLD

#: Share of a communication step that its last part takes: what an FMU makes of the input during it is an error.
_LAST = 1e-5


def co_simulate(
    fmu: Any, description: Any, folder: str, mapping: FmuMapping, record: Record, parameters: Mapping[str, float]
) -> FloatArray:
    r"""Outputs (n, ny) in SI units at the samples of a record.

    Inputs run between samples as the record says. Each sampling interval takes one or more communication steps
    (`FmuMapping.steps_in`); see `_schedule` for what the FMU is told of its inputs in each.

    Raises
    ------
    RuntimeError
        If the FMU ends the simulation before the record ends.
    """
    three = description.fmiMajorVersion == 3
    setter, getter = (fmu.setFloat64, fmu.getFloat64) if three else (fmu.setReal, fmu.getReal)
    interpolates = not three and description.coSimulation.canInterpolateInputs
    interval = float(record.time[-1]) / (len(record.time) - 1) if len(record.time) > 1 else 1.0
    sloping = interpolates and record.interpolation != HOLD
    schedule = _schedule(mapping.steps_in(interval), sloping, mapping.fixed_step is not None)
    inputs, references = _Inputs(mapping, record), [port.reference for port in mapping.inputs]
    told = [(inputs.at(place), inputs.slopes(begin, length)) for begin, length, place in schedule]
    seen = [port.reference for port in mapping.outputs]
    found = np.empty((len(record.time), len(seen)))

    _initialise(fmu, three, mapping, record, parameters, setter, inputs.samples[0].tolist())
    found[0] = getter(seen)
    for k in range(len(found) - 1):
        for (begin, length, _), (values, slopes) in zip(schedule, told, strict=True):
            if references:
                setter(references, values[k].tolist())
            if references and sloping:
                fmu.setRealInputDerivatives(references, [1] * len(references), slopes[k].tolist())
            ended = fmu.doStep(
                currentCommunicationPoint=(k + begin) * interval, communicationStepSize=length * interval
            )
            if three and (ended[1] or ended[2]):
                raise RuntimeError(f"the FMU ended the simulation at {ended[3]:g} s")
        found[k + 1] = getter(seen)
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


def _schedule(steps: int, sloping: bool, fixed: bool) -> list[tuple[float, float, float]]:
    """Begin and length of each communication step, and where its input is taken, as shares of a sampling interval.

    - An FMU that interpolates (FMI 2, ``canInterpolateInputs``) takes a sloping input at the beginning, with its slope.
    - Any other one holds the input during the step: it takes that of the middle, which is right to second order, and
      exact where the record holds it too. A last, very short step takes the input at the sample, so that an output
      that follows it at once is exact.
    - One with a fixed step takes the input at the end: such an output is exact, the rest half a step early.
    """
    whole = [(j / steps, 1 / steps) for j in range(steps)]
    if sloping:
        return [(begin, length, begin) for begin, length in whole]
    if fixed:
        return [*((begin, length, begin + length) for begin, length in whole[:-1]), (*whole[-1], 1.0)]
    held = [(begin, length, begin + length / 2) for begin, length in whole]
    begin, length, middle = held.pop()
    return [*held, (begin, (1 - _LAST) * length, middle), (1 - _LAST * length, _LAST * length, 1.0)]


class _Inputs:
    """The inputs of an FMU in its own units, between the samples of a record."""

    def __init__(self, mapping: FmuMapping, record: Record) -> None:
        self.interval = float(record.time[-1]) / (len(record.time) - 1) if len(record.time) > 1 else 1.0
        self.ports, self.curves = mapping.inputs, [record.curve(port.name) for port in mapping.inputs]
        columns = [port.from_si(record.inputs[port.name]) for port in mapping.inputs]
        self.samples = np.stack(columns, axis=1) if columns else np.zeros((len(record.time), 0))

    def at(self, share: float) -> FloatArray:
        """Values at a share of every sampling interval, (n - 1, nu); at 1 those of the next sample."""
        return self.samples[1:] if share == 1 else self._before(share)

    def slopes(self, begin: float, length: float) -> FloatArray:
        """Mean slopes over a part of every sampling interval, (n - 1, nu)."""
        return (self._before(begin + length) - self._before(begin)) / (length * self.interval)

    def _before(self, share: float) -> FloatArray:
        """The polynomials themselves: no rounding of a time leads into the interval beside, where an input jumps."""
        count = len(self.samples) - 1
        columns = [
            port.from_si(np.polyval(curve.c[:, :count, 0], share * self.interval))
            for port, curve in zip(self.ports, self.curves, strict=True)
        ]
        return np.stack(columns, axis=1) if columns else np.zeros((count, 0))


def _in_si(found: FloatArray, ports: tuple[Port, ...]) -> FloatArray:
    return np.stack([port.to_si(found[:, k]) for k, port in enumerate(ports)], axis=1)
