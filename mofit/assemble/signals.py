"""Measured and simulated signals, each over the time of its own test."""

from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mofit.labels import title_of
from mofit.problem import Problem
from mofit.result import Signal, signal_dataset

Array = NDArray[np.float64]


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
    for measurement, drive in zip(problem.measurements, problem.drives, strict=True):
        for column, channel in enumerate(problem.model.inputs):
            signals[f"{measurement.name}_{channel.name}"] = Signal(
                measurement.name,
                measurement.time,
                drive.inputs[:, column],
                channel.unit,
                title_of(channel.name, channel.description),
            )
        signals[f"{measurement.name}_weight"] = Signal(
            measurement.name, measurement.time, (drive.weights[:, 0] > 0).astype(np.int8), "1", "1 where judged"
        )
    return signal_dataset(signals)


def predictions(problem: Problem, point: Array) -> xr.Dataset:
    """Simulated output of every test at one point (d,)."""
    return _simulated(problem, [values[0, :, 0] for values in problem.simulate(point[None])])


def predictive(problem: Problem, draws: Array) -> xr.Dataset:
    """Simulated output of every test at posterior draws (chain, draw, d)."""
    chains, count, dimension = draws.shape
    simulated = problem.simulate(draws.reshape(-1, dimension))
    return _simulated(problem, [s[:, :, 0].reshape(chains, count, -1).astype(np.float32) for s in simulated])


def _simulated(problem: Problem, values: list[Array]) -> xr.Dataset:
    output = problem.model.outputs[0]
    return signal_dataset(
        {
            m.name: Signal(
                m.name, m.time, values[i], output.unit, f"simulated {title_of(output.name, output.description)}"
            )
            for i, m in enumerate(problem.measurements)
        }
    )
