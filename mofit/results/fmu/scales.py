"""Sizes of inputs and states in the identified tests: what the integrator's tolerance is relative to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import casadi as ca
import numpy as np
import xarray as xr

from mofit._typing import FloatArray
from mofit.models import Model, System
from mofit.simulation import ExperimentData, Simulator

#: samples of a record that are looked at: a size needs no more
_MOST = 20_000
#: integration error, relative to the range of a state
_TOLERANCE = 1e-4


def recorded_inputs(tree: xr.DataTree, model: Model) -> dict[str, tuple[FloatArray, FloatArray]]:
    """Of every test that holds all inputs of the model: its time (n,) and inputs (m, nu), as the run simulated them.

    Of a long one only the first inputs.
    """
    if "constant_data" not in tree.children or "test" not in tree.coords:
        return {}
    data, found = tree["constant_data"].dataset, {}
    for test in map(str, tree.coords["test"].values):
        names = [f"{test}_{channel.name}" for channel in model.inputs]
        if all(name in data for name in names):
            time = np.asarray(data[f"time_{test}"].values, dtype=float)
            found[test] = time, np.stack([np.asarray(data[name][:_MOST].values, dtype=float) for name in names], axis=1)
    return found


def input_sizes(tree: xr.DataTree, model: Model) -> dict[str, float]:
    """Largest magnitude of every input over the tests; those that are always zero or unknown are left out."""
    records = [inputs for _, inputs in recorded_inputs(tree, model).values()]
    if not records:
        return {}
    largest = np.max([np.max(np.abs(inputs), axis=0) for inputs in records], axis=0)
    sizes = dict(zip((channel.name for channel in model.inputs), largest.tolist(), strict=True))
    return {name: size for name, size in sizes.items() if np.isfinite(size) and size > 0}


def state_sizes(
    tree: xr.DataTree, model: Model, system: System, parameters: Mapping[str, float], conditions: Mapping[str, float]
) -> list[float]:
    """Largest magnitude of every state, simulated over the tests; 1 where it stays zero or no test is known."""
    own = np.array([conditions[c.name] for c in model.conditions], dtype=float)
    experiments = [
        _experiment(test, float(time[1] - time[0]), inputs, own, len(system.states))
        for test, (time, inputs) in recorded_inputs(tree, model).items()
        if len(time) > 1 and np.all(np.isfinite(inputs))
    ]
    if not experiments or not system.states:
        return [1.0] * len(system.states)
    x, u, p, c = system.rhs.sx_in()
    watched = replace(system, outputs=system.states, out=ca.Function("states", [x, u, p, c], [x]))
    values = np.array([parameters[name] for name in system.parameters], dtype=float)
    simulated = Simulator(watched, experiments, (), tolerance=_TOLERANCE, box=(values, values)).simulate(values)
    # a test in which the model runs away says nothing of sizes
    whole = [np.abs(states[0]) for states in simulated if np.isfinite(states).all()]
    sizes = np.max([np.zeros(len(system.states)), *(states.max(axis=0) for states in whole)], axis=0)
    return [float(size) if size > 0 else 1.0 for size in sizes]


def _experiment(name: str, step: float, inputs: FloatArray, conditions: FloatArray, ny: int) -> ExperimentData:
    nothing = np.zeros((len(inputs), ny))
    return ExperimentData(name, step, inputs, "linear", conditions, nothing, nothing)
