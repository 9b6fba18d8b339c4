"""Runs as far as an FMU needs them, their tests as an importer drives them, and what mofit simulates beside."""

from __future__ import annotations

import json
import shutil
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from mofit.models import Model, build_system
from mofit.results.fmu.archive import write_fmu
from mofit.results.fmu.variables import contents
from mofit.simulation import ExperimentData, Simulator

fmpy = pytest.importorskip("fmpy", reason="fmpy is not installed: pip install 'mofit[fmu]'")
validate_fmu = pytest.importorskip("fmpy.validation").validate_fmu

COMPILER = next((found for name in ("cc", "gcc", "clang") if (found := shutil.which(name))), None)
needs_compiler = pytest.mark.skipif(COMPILER is None, reason="no C compiler on this machine")
ROLLING = {"longitudinal_velocity": 60 / 3.6, "slip_normalisation": 1.0, "fictitious_velocity": 0.01}

#: Shares of a sampling interval by which derivatives are looked up after a sample: they jump there.
AFTER = 1e-6


def stroke(step=0.002, samples=800):
    """Two sines of a displacement, and their rate."""
    time = np.arange(samples) * step
    return [
        0.01 * np.sin(9 * time) + 0.002 * np.sin(37 * time + 1),
        0.09 * np.cos(9 * time) + 0.074 * np.cos(37 * time + 1),
    ]


def steer(step=0.01, samples=300):
    """A sine of a slip angle."""
    return [np.deg2rad(3) * np.sin(13 * np.arange(samples) * step)]


def run_of(
    model: Model,
    values: Mapping[str, float] | None = None,
    conditions: Mapping[str, list[float]] | None = None,
    tests: Mapping[str, ExperimentData] | None = None,
    scoped: Mapping[str, list[float]] | None = None,
) -> xr.DataTree:
    """A run that found these values, the nominal ones by default; conditions and scoped values are per test."""
    values, tests, scoped = values or {}, tests or {}, scoped or {}
    free = [p for p in model.parameters if p.name not in scoped]
    mean = np.array([values.get(p.name, p.nominal) for p in free])
    columns = {
        "value": 1.01 * mean, "mean": mean, "sd": 0.1 * np.abs(mean),
        "q05": mean - 0.16 * np.abs(mean), "q95": mean + 0.16 * np.abs(mean),
    }  # fmt: skip
    mode = xr.Dataset(
        {name: ("parameter", own) for name, own in columns.items()}, {"parameter": [p.name for p in free]}
    )
    mode["verdict"] = "parameter", ["identified"] * len(free)
    configuration = {"equations": build_system(model).hash(), "fixed": {}}
    attributes = {"model": model.name, "title": f"{model.name} on a rig", "configuration": json.dumps(configuration)}
    names = list(tests) or [f"test_{k}" for k in range(len(next(iter((conditions or scoped).values()), [])))]
    groups = {"/": xr.Dataset(coords={"test": names}, attrs=attributes), "/modes/m1": mode}
    if conditions:
        table = np.array(list(conditions.values())).T
        axes = {"test": names, "condition": list(conditions)}
        groups["/conditions"] = xr.Dataset({"value": (("test", "condition"), table)}, axes)
    if scoped:
        table, axes = np.array(list(scoped.values())).T, {"test": names, "parameter_scoped": list(scoped)}
        data = {"value": table, "sd": 0.1 + 0 * table, "label": [[name] * len(scoped) for name in names]}
        dims = ("test", "parameter_scoped")
        groups["/modes/m1/scoped"] = xr.Dataset({key: (dims, own) for key, own in data.items()}, axes)
    signals, axes = {}, {}
    for name, test in tests.items():
        axes[f"time_{name}"] = np.arange(test.samples) * test.step
        for channel, column in zip(model.inputs, test.inputs.T, strict=True):
            signals[f"{name}_{channel.name}"] = f"time_{name}", column
    return xr.DataTree.from_dict({**groups, "/constant_data": xr.Dataset(signals, axes)})


def record(
    model: Model, inputs: list[np.ndarray], step: float, conditions=(), interpolation: str = "cubic"
) -> ExperimentData:
    """A test with these inputs of the model, time as the last one if it reads that, and one output."""
    clock = [step * np.arange(len(inputs[0]))] * (len(model.inputs) - len(inputs))
    columns = np.stack([*inputs, *clock], axis=1)
    nothing = np.zeros((len(columns), 1))
    return ExperimentData("drive", step, columns, interpolation, np.array(conditions, float), nothing, nothing)


def simulated(
    model: Model, test: ExperimentData, values: Mapping[str, float] | None = None, steps: int | None = None
) -> np.ndarray:
    """The first output of the model by mofit's own integration, at its default tolerance or with fixed steps."""
    system = build_system(model)
    given = {p.name: p.nominal for p in model.parameters} | dict(values or {})
    p = [given[name] for name in system.parameters]
    return Simulator(system, [test], tolerance=1e-6, steps=steps).simulate([p])[0][0, :, 0]


def drive(tree: xr.DataTree, model: Model, test: ExperimentData, parts: int = 1) -> np.ndarray:
    """The inputs of the model's FMU at ``parts`` communication points per sample, with all their derivatives."""
    found = contents(tree, model)
    places = {channel.name: k for k, channel in enumerate(model.inputs)}
    time = np.arange((test.samples - 1) * parts + 1) * test.step / parts
    columns = {"time": time}
    names = [variable.name for _, variable in found.of("input")]
    for number, signal in enumerate(found.signals):
        own = names[number * found.orders : (number + 1) * found.orders]
        named = {order: places[name] for name, order in signal.orders.items()}
        for order, name in enumerate(own):
            # from the nearest channel below: its value, or its derivatives
            base = max((k for k in named if k <= order), default=None)
            if base is None:
                continue
            curve = test.curve if order == base else test.curve.derivative(order - base)
            at = time if order == base else time + AFTER * test.step
            columns[name] = curve(np.minimum(at, time[-1]))[:, named[base]]
    table = np.zeros(len(time), dtype=[(name, float) for name in columns])
    for name, values in columns.items():
        table[name] = values
    return table


def fmu_of(tree: xr.DataTree, model: Model, folder: Path, **options) -> Path:
    """The FMU in a folder."""
    path = folder / f"model{len(list(folder.iterdir()))}.fmu"
    write_fmu(tree, model, path, **options)
    return path


def run(path, signals, step, **options):
    """The output of an FMU at communication points one step apart."""
    start = signals["time"][0]
    stop = start + step * (len(signals) - 1)
    found = fmpy.simulate_fmu(
        str(path), start_time=start, stop_time=stop, output_interval=step, input=signals, **options
    )
    (name,) = [name for name in found.dtype.names if name != "time"]
    return np.asarray(found[name])


class Master:
    """An importer's loop of its own: what it sets at a communication point is what it reads there."""

    def __init__(self, path, start_time=0.0):
        self.description = fmpy.read_model_description(str(path))
        self.references = {v.name: v.valueReference for v in self.description.modelVariables}
        self.fmu = fmpy.instantiate_fmu(fmpy.extract(str(path)), self.description, "CoSimulation")
        self.time = start_time
        self.three = self.description.fmiVersion == "3.0"

    def initialise(self, **inputs):
        if self.three:
            self.fmu.enterInitializationMode(startTime=self.time)
        else:
            self.fmu.setupExperiment(startTime=self.time)
            self.fmu.enterInitializationMode()
        self.set(**inputs)
        self.fmu.exitInitializationMode()
        return self

    def set(self, **values):
        setter = self.fmu.setFloat64 if self.three else self.fmu.setReal
        setter([self.references[name] for name in values], list(values.values()))

    def get(self, name):
        getter = self.fmu.getFloat64 if self.three else self.fmu.getReal
        return getter([self.references[name]])[0]

    def step(self, length):
        self.fmu.doStep(currentCommunicationPoint=self.time, communicationStepSize=length)
        self.time += length
