"""Measured and simulated signals, each over the time of its own test."""

from __future__ import annotations

import numpy as np
import xarray as xr

from mofit._typing import FloatArray
from mofit.problem import Problem
from mofit.quantities import title_of
from mofit.results import Signal, signal_dataset


def observed_data(problem: Problem) -> xr.Dataset:
    """The measured output of every test."""
    output = problem.model.outputs[0]
    return signal_dataset(
        {
            m.name: Signal(
                m.name, m.time, m.channel(output.name), output.unit, title_of(output.name, output.description)
            )
            for m in problem.measurements
        }
    )


def constant_data(problem: Problem) -> xr.Dataset:
    """Inputs as the simulation saw them, and where samples count."""
    signals = {}
    for measurement, experiment in zip(problem.measurements, problem.experiments, strict=True):
        for column, channel in enumerate(problem.model.inputs):
            signals[f"{measurement.name}_{channel.name}"] = Signal(
                measurement.name,
                measurement.time,
                experiment.inputs[:, column],
                channel.unit,
                title_of(channel.name, channel.description),
            )
        signals[f"{measurement.name}_weight"] = Signal(
            measurement.name,
            measurement.time,
            (experiment.weights[:, 0] > 0).astype(np.int8),
            "1",
            "1 where it is used",
        )
    return signal_dataset(signals)


def predictions(problem: Problem, point: FloatArray) -> xr.Dataset:
    """Simulated output of every test at one point (d,)."""
    return _simulated(problem, [values[0, :, 0] for values in problem.simulate(point[None])])


def predictive(problem: Problem, draws: FloatArray) -> xr.Dataset:
    """Simulated output of every test at posterior draws (chain, draw, d)."""
    chains, count, dimension = draws.shape
    simulated = problem.simulate(draws.reshape(-1, dimension))
    return _simulated(problem, [s[:, :, 0].reshape(chains, count, -1).astype(np.float32) for s in simulated])


def _simulated(problem: Problem, values: list[FloatArray]) -> xr.Dataset:
    output = problem.model.outputs[0]
    return signal_dataset(
        {
            m.name: Signal(
                m.name, m.time, values[i], output.unit, f"simulated {title_of(output.name, output.description)}"
            )
            for i, m in enumerate(problem.measurements)
        }
    )
