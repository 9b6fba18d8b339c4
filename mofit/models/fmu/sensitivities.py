r"""Sensitivities of an FMU for model exchange, from its directional derivatives.

With the states x, :math:`\dot x = f(x, p, u)` and :math:`y = g(x, p, u)`, the derivatives S of the states by a
parameter p follow :math:`\dot S = f_x S + f_p`, and those of the outputs are :math:`g_x S + g_p`. The FMU gives
:math:`f_x S + f_p` in one call, with S and a one for p as the direction.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from ctypes import POINTER, c_double
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from mofit._typing import FloatArray
from mofit.models.black_box import Record
from mofit.models.fmu.co_simulation import constants
from mofit.models.fmu.mapping import FmuMapping, Port
from mofit.quantities import HOLD

#: Step of the differences that a directional derivative is checked with, and how well both must agree.
_STEP, _ALIKE = 1e-4, 1e-3


def sensitivities(
    fresh: Callable[[], Any],
    description: Any,
    mapping: FmuMapping,
    record: Record,
    parameters: Mapping[str, float],
    free: tuple[str, ...],
) -> FloatArray | None:
    """Derivatives (n, ny, nf) of the outputs by free parameters, in SI units; None where the FMU does not give them.

    It need not: FMI leaves open whether parameters are among the directions. So each is checked against differences at
    the first sample. Nor are there any over an event: those that the FMU announces, and the jumps of held inputs.
    """
    if record.interpolation == HOLD:
        return None
    try:
        model = _Model(fresh, description, mapping, record, parameters, free)
        return _integrated(model, record.time) if model.checked() else None
    except Exception:  # noqa: BLE001  an FMU without the functions raises whatever FMPy raises
        return None


def _integrated(model: _Model, time: FloatArray) -> FloatArray | None:
    x0, s0 = model.start()
    nx, nf = len(x0), len(s0)

    def rate(t: float, state: FloatArray) -> FloatArray:
        x, s = state[:nx], state[nx:].reshape(nf, nx)
        model.move(t, x)
        return np.concatenate([model.rates(), *model.along(model.derivatives, s)])

    tolerance = model.mapping.tolerance
    size = model.nominals()
    scale = np.concatenate([size, *(size / parameter for parameter in model.sizes)])
    state = np.concatenate([x0, s0.ravel()])
    if nx:
        found = solve_ivp(
            rate, (time[0], time[-1]), state, method="LSODA", t_eval=time,
            rtol=tolerance, atol=tolerance * scale, max_step=4 * (time[1] - time[0]),
        )  # fmt: skip
        if not found.success:
            return None
        states = found.y.T
    else:
        states = np.tile(state, (len(time), 1))
    factors = np.array([port.factor for port in model.mapping.outputs])
    slopes = []
    for t, state in zip(time, states, strict=True):
        model.move(t, state[:nx])
        slopes.append(factors[:, np.newaxis] * model.along(model.outputs, state[nx:].reshape(nf, nx)).T)
    return np.stack(slopes)


class _Model:
    """The FMU in its continuous-time mode."""

    def __init__(
        self,
        fresh: Callable[[], Any],
        description: Any,
        mapping: FmuMapping,
        record: Record,
        parameters: Mapping[str, float],
        free: tuple[str, ...],
    ) -> None:
        self.fresh, self.mapping, self.record, self.parameters = fresh, mapping, record, dict(parameters)
        self.three = description.fmiMajorVersion == 3
        self.derivatives = [one.variable.valueReference for one in description.derivatives]
        self.states = [one.variable.derivative.valueReference for one in description.derivatives]
        self.outputs = [port.reference for port in mapping.outputs]
        ports = {port.name: port for port in mapping.parameters}
        self.free = [ports[name] for name in free]
        self.sizes = [abs(parameters[name]) or 1.0 for name in free]
        self.fmu: Any = None

    def initialise(self, values: Mapping[str, float]) -> FloatArray:
        """Begin anew; returns the states at the first sample.

        Raises
        ------
        RuntimeError
            If the FMU announces an event.
        """
        fmu = self.fmu = self.fresh()
        end = float(self.record.time[-1])
        if not self.three:
            fmu.setupExperiment(tolerance=self.mapping.tolerance, startTime=0.0, stopTime=end)
        self._set(*constants(self.mapping, self.record, values))
        if self.three:
            fmu.enterInitializationMode(tolerance=self.mapping.tolerance, startTime=0.0, stopTime=end)
        else:
            fmu.enterInitializationMode()
        self._set_inputs(0.0)
        fmu.exitInitializationMode()
        again = True
        while again:
            again, ends, _, _, event, _ = fmu.updateDiscreteStates() if self.three else fmu.newDiscreteStates()
            if ends or event:
                raise RuntimeError("the FMU announces an event")
        fmu.enterContinuousTimeMode()
        return self._read(fmu.getContinuousStates)

    def start(self) -> tuple[FloatArray, FloatArray]:
        """States (nx,) at the first sample and their derivatives (nf, nx) by the free parameters, by differences."""
        slopes = []
        for port, size in zip(self.free, self.sizes, strict=True):
            ends = [self.initialise(self._moved(port, side * _STEP * size)) for side in (1, -1)]
            slopes.append((ends[0] - ends[1]) / (2 * _STEP * size))
        return self.initialise(self.parameters), np.array(slopes).reshape(len(self.free), len(self.states))

    def checked(self) -> bool:
        """Whether directional derivatives by the parameters agree with differences, at a point where all matter."""
        x = self.initialise(self.parameters)
        x = x + self.nominals() * (0.3 + 0.1 * np.arange(len(x)))
        inputs = [np.abs(self.record.inputs[port.name]) for port in self.mapping.inputs]
        t = float(self.record.time[int(np.argmax(inputs[0]))]) if inputs else 0.0
        self.move(t, x)
        told = self.along(self.derivatives + self.outputs, np.zeros((len(self.free), len(x))))
        for port, size, own in zip(self.free, self.sizes, told, strict=True):
            ends = []
            for side in (1, -1):
                self.initialise(self._moved(port, side * _STEP * size))
                self.move(t, x)
                ends.append(np.concatenate([self.rates(), self._values(self.outputs)]))
            found = (ends[0] - ends[1]) / (2 * _STEP * size)
            rounding = 1e-12 * np.abs(ends[0]) / (_STEP * size)
            if np.any(np.abs(own - found) > _ALIKE * np.abs(found).max(initial=0.0) + rounding):
                return False
        return True

    def move(self, t: float, x: FloatArray) -> None:
        """Go to a time and to states."""
        self.fmu.setTime(float(t))
        if len(x):
            x = np.ascontiguousarray(x, dtype=float)
            self.fmu.setContinuousStates(x.ctypes.data_as(POINTER(c_double)), len(x))
        self._set_inputs(float(t))

    def rates(self) -> FloatArray:
        """Derivatives of the states by time, (nx,)."""
        return self._read(self.fmu.getContinuousStateDerivatives if self.three else self.fmu.getDerivatives)

    def along(self, unknowns: list[int], s: FloatArray) -> FloatArray:
        """Derivatives of unknowns by each free parameter, (nf, ·), with those of the states (nf, nx)."""
        rows = []
        for port, own in zip(self.free, s, strict=True):
            knowns = [*self.states, port.reference]
            seed = [*own.tolist(), 1.0 / port.factor]
            rows.append(self.fmu.getDirectionalDerivative(unknowns, knowns, seed) if unknowns else [])
        return np.array(rows, dtype=float)

    def nominals(self) -> FloatArray:
        """Typical sizes of the states, (nx,)."""
        return np.abs(self._read(self.fmu.getNominalsOfContinuousStates))

    def _moved(self, port: Port, by: float) -> dict[str, float]:
        return {**self.parameters, port.name: self.parameters[port.name] + by}

    def _values(self, references: list[int]) -> FloatArray:
        return np.array(self.fmu.getFloat64(references) if self.three else self.fmu.getReal(references), dtype=float)

    def _set(self, references: list[int], values: list[float]) -> None:
        if references:
            (self.fmu.setFloat64 if self.three else self.fmu.setReal)(references, values)

    def _set_inputs(self, t: float) -> None:
        t = min(t, float(self.record.time[-1]))
        values = [float(port.from_si(self.record.curve(port.name)(t)[0])) for port in self.mapping.inputs]
        self._set([port.reference for port in self.mapping.inputs], values)

    def _read(self, function: Callable[..., Any]) -> FloatArray:
        values = np.zeros(len(self.states))
        if len(values):
            function(values.ctypes.data_as(POINTER(c_double)), len(values))
        return values
