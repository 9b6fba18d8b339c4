"""Simulators of the study of any simulator: plain functions around solve_ivp, each beside a model with equations."""

from __future__ import annotations

import time

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter

from mofit import Record, Simulator
from mofit._typing import FloatArray
from mofit.models import Addition, Channel, Condition
from mofit.parameters import Parameter

#: seconds that the slow simulator takes per record
SLOW = 0.2
#: points of the exact solution per sample: straight lines between them follow the spline of the input
FINE = 16

DAMPER = (
    Parameter("c", "N/m", 5e3, 5e4, 2e4, "log"),
    Parameter("d", "N s/m", 1e2, 2e3, 5e2, "log"),
    Parameter("c_M", "N/m", 5e3, 5e4, 2e4, "log"),
    Parameter("d_M", "N s/m", 3e2, 6e3, 1e3, "log"),
)
MOTION = (Channel("displacement", "m"), Channel("velocity", "m/s", derivative_of="displacement"))


def branch_damper(record: Record, parameters: dict[str, float]) -> FloatArray:
    """A spring, a damper and a Maxwell branch, by solve_ivp."""
    x, v = record.inputs["displacement"], record.inputs["velocity"]
    curve, rate = CubicSpline(record.time, x), parameters["c_M"] / parameters["d_M"]
    found = solve_ivp(
        lambda t, z: rate * (curve(t) - z), (0.0, record.time[-1]), x[:1], t_eval=record.time, rtol=1e-7, atol=1e-9
    )
    return parameters["c"] * x + parameters["d"] * v + parameters["c_M"] * (x - found.y[0])


def quick_damper(record: Record, parameters: dict[str, float]) -> FloatArray:
    """The same in closed form, for straight lines between many points."""
    x, v = record.inputs["displacement"], record.inputs["velocity"]
    many = np.linspace(0.0, record.time[-1], (len(record.time) - 1) * FINE + 1)
    curve, step = CubicSpline(record.time, x)(many), many[1] * parameters["c_M"] / parameters["d_M"]
    decay = np.exp(-step)
    there = 1 - (1 - decay) / step
    driven = np.concatenate([curve[:1], (1 - decay - there) * curve[:-1] + there * curve[1:]])
    branch = lfilter([1.0], [1.0, -decay], driven)[::FINE]
    return parameters["c"] * x + parameters["d"] * v + parameters["c_M"] * (x - branch)


def slow_damper(record: Record, parameters: dict[str, float]) -> FloatArray:
    """The same after a pause."""
    time.sleep(SLOW)
    return quick_damper(record, parameters)


def tanks(record: Record, parameters: dict[str, float]) -> FloatArray:
    """Two equal tanks (`records_cases.tanks.EqualTanks`) by solve_ivp, the pump held between samples.

    The solver begins anew where the pump steps: across a step its error is a thousand times its tolerance.
    """
    pump, step = record.inputs["pump"], record.time[1]
    k_1, k_3, k_4 = (parameters[name] for name in ("k_1", "k_3", "k_4"))

    def flow(level: float) -> float:
        return level / (level * level + 0.01) ** 0.25

    def rates(t: float, x: FloatArray, voltage: float) -> tuple[float, float]:
        out = k_1 * flow(x[0])
        return k_4 * voltage - out, out - k_3 * flow(x[1])

    levels = np.empty((len(pump), 2))
    levels[0] = parameters["x_1"], parameters["x_2"]
    for k, voltage in enumerate(pump[:-1]):
        found = solve_ivp(rates, (0.0, step), levels[k], args=(voltage,), rtol=1e-6, atol=1e-6)
        levels[k + 1] = found.y[:, -1]
    return levels[:, 1]


def cell(record: Record, parameters: dict[str, float]) -> FloatArray:
    """A cell with one RC branch (`records_cases.battery.ChargedCell`), its open-circuit voltage left out.

    The current runs in straight lines between samples, as in the records. No step is longer than one.
    """
    time, current = record.time, record.inputs["current"]
    p, low = parameters, np.exp((0.1 - record.conditions["state_of_charge"]) / parameters["w"])
    series, branch, tau = (
        p[name] * (1 + p[rise] * low) for name, rise in (("R_0", "r_0"), ("R_1", "r_1"), ("tau", "r_t"))
    )
    found = solve_ivp(
        lambda t, x: (branch * np.interp(t, time, current) - x) / tau,
        (0.0, time[-1]), [0.0], t_eval=time, rtol=1e-6, atol=1e-9, max_step=time[1],
    )  # fmt: skip
    return series * current + found.y[0]


class OpenCircuit(Addition):
    """The open-circuit voltage of a record, added to what the cell's simulator gives."""

    name = "open_circuit"
    on = ("voltage",)
    parameters = (Parameter("U_0", "V", 0.0, 4.5, 3.7, description="open-circuit voltage", per="test", neutral=0.0),)


def _rate(name: str, unit: str) -> Parameter:
    return Parameter(name, unit, 5e-3, 0.5, 0.05, "log")


def _rise(name: str) -> Parameter:
    return Parameter(name, "1", 1e-2, 1e2, 1.0, "log")


FORCE = (Channel("force", "N"),)
damper_simulator = Simulator(branch_damper, DAMPER, MOTION, FORCE)
quick_simulator = Simulator(quick_damper, DAMPER, MOTION, FORCE)
slow_simulator = Simulator(slow_damper, DAMPER, MOTION, FORCE)
tanks_simulator = Simulator(
    tanks,
    (
        _rate("k_1", "V/s"),
        _rate("k_3", "V/s"),
        _rate("k_4", "1/s"),
        Parameter("x_1", "V", 0.0, 20.0, 5.0),
        Parameter("x_2", "V", 0.0, 10.0, 5.0),
    ),
    (Channel("pump", "V"),),
    (Channel("level", "V"),),
)
cell_simulator = Simulator(
    cell,
    (
        Parameter("R_0", "ohm", 1e-3, 1.0, 0.03, "log"),
        Parameter("R_1", "ohm", 1e-4, 1.0, 0.01, "log"),
        Parameter("tau", "s", 0.1, 100.0, 5.0, "log"),
        _rise("r_0"),
        _rise("r_1"),
        _rise("r_t"),
        Parameter("w", "1", 1e-2, 1.0, 0.1, "log"),
    ),
    (Channel("current", "A"),),
    (Channel("voltage", "V"),),
    conditions=(Condition("state_of_charge", "1"),),
)
