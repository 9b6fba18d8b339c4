"""Values per objective on the axes of the result tree: over tests, and over outputs where a model has several."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, DTypeLike

from mofit._typing import FloatArray
from mofit.models import Channel
from mofit.problem import Problem
from mofit.quantities import title_of
from mofit.results import OUTPUT_UNIT, Computed, Signal, axis, quantity, signal_dataset
from mofit.simulation import measured_outputs, objective_pairs

#: Numbers of a long test that are simulated together, before they are stored in fewer bytes.
AT_ONCE = 500_000


def test_axes(problem: Problem) -> dict[str, xr.Variable]:
    """Labels of the tests, and of the outputs with their units where there are several."""
    outputs = problem.model.outputs
    return {"test": axis("test", list(problem.tests)), **(_output_axis(outputs) if len(outputs) > 1 else {})}


test_axes.__test__ = False  # type: ignore[attr-defined]  # not a pytest function


def over_tests(problem: Problem, values: ArrayLike, outputs: Sequence[Channel] | None = None) -> FloatArray:
    """Values per objective (..., T) of a problem over tests, and over outputs where there are several of these.

    ``outputs`` are those of another model that the problem is compared with. NaN where a test lacks an output.
    """
    values, own = np.asarray(values, dtype=float), problem.model.outputs
    if len(own) > 1:
        spread = np.full((*values.shape[:-1], len(problem.experiments), len(own)), np.nan)
        tests, columns = np.array(objective_pairs(problem.experiments)).T
        spread[..., tests, columns] = values
    else:
        spread = values[..., None]
    return _arranged(spread, own, own if outputs is None else outputs)


def noise_and_range(problem: Problem) -> dict[str, FloatArray]:
    """Noise, noise floor and peak-to-peak range of every output, as variables of the root."""
    noise, extent = [], []
    for test, output in objective_pairs(problem.experiments):
        name = problem.model.outputs[output].name
        noise.append(problem.signals[test].noise_sd[name])
        extent.append(float(np.ptp(problem.measurements[test].channel(name))))
    found: dict[str, ArrayLike] = {"noise_sd": noise, "noise_floor": problem.noise.floor, "range": extent}
    return {name: over_tests(problem, values) for name, values in found.items()}


def simulated_signals(
    problem: Problem,
    points: FloatArray,
    outputs: Sequence[Channel] | None = None,
    dtype: DTypeLike = float,
) -> xr.Dataset:
    """Simulated outputs of every test at points (..., d), as signals that are computed when they are read.

    ``outputs`` are those of another model that the problem is compared with.
    """
    own, lead = problem.model.outputs, points.shape[:-1]
    wanted = own if outputs is None else outputs
    p = problem.layout.full(points.reshape(-1, points.shape[-1]))
    simulator = problem.simulator.without_tables()

    def compute(test: int) -> FloatArray:
        recorded = problem.experiments[test].recorded
        values, at_once = np.empty((len(p), recorded, len(own)), dtype), max(1, AT_ONCE // recorded)
        for first in range(0, len(p), at_once):
            values[first : first + at_once] = simulator.one(test, p[first : first + at_once])
        return _arranged(values.reshape(*lead, *values.shape[1:]), own, wanted)

    last = (len(wanted),) * (len(wanted) > 1)
    values = [
        Computed(partial(compute, test), (*lead, experiment.recorded, *last), dtype)
        for test, experiment in enumerate(problem.experiments)
    ]
    return _signals(problem, values, wanted, "simulated ")


def _signals(
    problem: Problem, values: Sequence[FloatArray | Computed], wanted: Sequence[Channel], what: str = ""
) -> xr.Dataset:
    """The wanted outputs of every test as signals; ``what`` says in a word what they are."""
    title = " and ".join(title_of(channel.name, channel.description) for channel in wanted)
    unit, several = unit_of(wanted), len(wanted) > 1
    found = signal_dataset(
        {
            m.name: Signal(m.name, m.time, ours, unit, what + title, several)
            for m, ours in zip(problem.measurements, values, strict=True)
        }
    )
    return found.assign_coords(_output_axis(wanted)) if several else found


def measured_signals(problem: Problem) -> xr.Dataset:
    """The measured outputs of every test; NaN where it lacks one."""
    values, outputs = [], problem.model.outputs
    for measurement in problem.measurements:
        have = measured_outputs(problem.model, measurement)
        lacking = np.full(len(measurement.time), np.nan)
        columns = [measurement.channel(c.name) if c.name in have else lacking for c in outputs]
        values.append(np.stack(columns, axis=-1) if len(outputs) > 1 else columns[0])
    return _signals(problem, values, outputs)


def _output_axis(outputs: Sequence[Channel]) -> dict[str, xr.Variable]:
    """Names of several outputs, and their units beside them."""
    return {
        "output": axis("output", [channel.name for channel in outputs]),
        "output_unit": quantity("output", [channel.unit for channel in outputs], "1", "SI unit of the output"),
    }


def unit_of(outputs: Sequence[Channel]) -> str:
    """Unit of what has the unit of the output; of several the coordinate beside them names it."""
    return outputs[0].unit if len(outputs) == 1 else OUTPUT_UNIT


def _arranged(values: FloatArray, own: Sequence[Channel], wanted: Sequence[Channel]) -> FloatArray:
    """Values over ``own`` outputs, the last axis, over the wanted ones; a single one has no axis. NaN: not there."""
    if len(wanted) == len(own) == 1:
        return values[..., 0]
    names = [channel.name for channel in own]
    missing = np.full(values.shape[:-1], np.nan, dtype=values.dtype)
    columns = [values[..., names.index(c.name)] if c.name in names else missing for c in wanted]
    return np.stack(columns, axis=-1) if len(wanted) > 1 else columns[0]
