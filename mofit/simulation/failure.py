"""Where a simulation fails: the first state or output of a test that is not finite, and its time."""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np

from mofit._typing import FloatArray
from mofit.models import BlackBoxSystem, System
from mofit.simulation.evaluation.engine import BlackBoxEngine
from mofit.simulation.experiment import ExperimentData
from mofit.simulation.simulator import Simulator


def find_failure(system: System, experiment: ExperimentData, p: FloatArray) -> str | None:
    """What is not finite first, and when, in words.

    Parameters
    ----------
    system, experiment
        The model and a test of it.
    p
        Values of all parameters, (np,).

    Returns
    -------
    str or None
        For example ``"the derivative of state 'x' is NaN at 0.31 s"``; None if all is finite.
    """
    if isinstance(system, BlackBoxSystem):
        failure = BlackBoxEngine(system, ()).failure(experiment, p)
        return None if failure is None else f"the simulator fails: {failure}"
    values = _watched(system, experiment, p)
    bad = ~np.isfinite(values)
    if not bad.any():
        return None
    sample = int(np.argmax(bad.any(axis=1)))
    when = f"at {sample * experiment.step:.4g} s"
    states = len(system.outputs) + np.arange(len(system.states))
    if sample and bad[sample, states].any():
        return f"{_culprit(system, experiment, p, values[sample - 1, states], sample)} {when}"
    column = int(np.argmax(bad[sample]))
    kind, names = ("output", system.outputs) if column < len(system.outputs) else ("initial state", system.states)
    name = names[column if kind == "output" else column - len(system.outputs)]
    return f"{kind} '{name}' is {_word(values[sample, column])} {when}"


def _watched(system: System, experiment: ExperimentData, p: FloatArray) -> FloatArray:
    """Outputs and states over time, (n, ny + nx)."""
    symbols = [ca.SX.sym(name, system.out.size1_in(i)) for i, name in enumerate("xupc")]
    out = ca.Function("out", symbols, [ca.vertcat(system.out(*symbols), symbols[0])], ["x", "u", "p", "c"], ["y"])
    watched = replace(system, out=out, outputs=(*system.outputs, *system.states))
    shape = (experiment.samples, len(watched.outputs))
    data = replace(experiment, measured=np.zeros(shape), weights=np.ones(shape), origin=None, lead=0)
    with np.errstate(all="ignore"):
        return Simulator(watched, [data], ()).simulate(p)[0][0]


def _culprit(system: System, experiment: ExperimentData, p: FloatArray, x: FloatArray, sample: int) -> str:
    """The state whose derivative is not finite between two samples; where all are, the one that grew most."""
    for u in experiment.inputs[[sample - 1, sample]]:
        slopes = np.asarray(system.rhs(x, u, p, experiment.conditions)).ravel()
        for name, slope in zip(system.states, slopes, strict=True):
            if not np.isfinite(slope):
                return f"the derivative of state '{name}' is {_word(slope)}"
    return f"state '{system.states[int(np.argmax(np.abs(x)))]}' grows past all numbers"


def _word(value: float) -> str:
    return "NaN" if np.isnan(value) else "infinite"
