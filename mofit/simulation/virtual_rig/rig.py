"""The virtual test rig: plan in, campaign out."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline

from mofit._typing import FloatArray
from mofit.data import Campaign, Experiment, Measurement
from mofit.data.signals import smooth_derivatives
from mofit.errors import InputError
from mofit.models import build_system
from mofit.models.model import TIME, derivations
from mofit.simulation.experiment import in_model_order
from mofit.simulation.requirements import derived_channels
from mofit.simulation.simulator import Simulator
from mofit.simulation.virtual_rig.plan import Plan, read_plan
from mofit.simulation.virtual_rig.setup import Setup, TestSetup, set_up
from mofit.simulation.virtual_rig.signals import noise


def simulate(path: str | Path) -> Campaign:
    """Run the plan's tests on a virtual rig.

    The plan's model responds to a test, unless a calibration stage of that model uses the whole record of such tests:
    then the stage's model responds. An effect joins wherever it can act. All draws come from the plan's seed, so the
    same plan gives the same campaign.

    Parameters
    ----------
    path
        Plan file (TOML), see docs/models.md.

    Raises
    ------
    InputError
        With all issues of the plan together.
    """
    path = Path(path)
    return run_plan(read_plan(path), f"plan '{path.name}'")


def run_plan(plan: Plan, where: str = "plan") -> Campaign:
    """The campaign of a plan; ``where`` names it in errors. See `simulate`."""
    setup = set_up(plan, where)
    rng = np.random.default_rng(plan.seed)
    measurements, clock = [], 0.0
    for test in setup.tests:
        experiment = test.experiment(rng, {}, clock)
        channels = {
            name: values + noise(values, rng, **setup.noise[name]) if name in setup.noise else values
            for name, values in {**experiment.inputs, **respond(setup, test, experiment)}.items()
        }
        outputs = {name: channels[name] for name in sorted(c.name for c in test.model.outputs)}
        inputs = {name: channels[name] for name in experiment.inputs}
        units = {**test.input_units, **{channel.name: channel.unit for channel in test.model.outputs}}
        measurements.append(Measurement(replace(experiment, inputs=inputs), outputs, units))
        clock += float(experiment.time[-1]) + setup.pause
    return Campaign(
        title=plan.title,
        source="simulated",
        conditions=setup.conditions,
        measurements=tuple(measurements),
        attributes={
            **plan.attributes,
            "made_with": "mofit simulate: a virtual rig, not a measurement",
            "simulated_model": "+".join([plan.model, *(effect.name for effect in plan.effects)]),
            "simulated_parameters": json.dumps(dict(setup.values)),
            "simulated_noise": json.dumps({name: entry.model_dump() for name, entry in plan.noise.items()}),
            "seed": plan.seed,
        },
        units=setup.units,
    )


def respond(setup: Setup, test: TestSetup, experiment: Experiment) -> dict[str, FloatArray]:
    """Outputs of one test without noise, shape (n,) each."""
    model, system = test.model, build_system(test.model)
    columns = _columns(test, experiment)
    p = np.array([setup.values[name] for name in system.parameters])
    shape = (len(experiment.time), len(system.outputs))
    complete = replace(experiment, conditions={**setup.conditions, **test.conditions})
    data = in_model_order(model, complete, columns, np.zeros(shape), np.ones(shape))
    output = Simulator(system, [data], ()).simulate(p)[0][0]
    if not np.all(np.isfinite(output)):
        raise InputError.of(
            f"test '{experiment.name}'", f"model '{model.name}' gave no finite output", "Check its parameters"
        )
    return dict(zip(system.outputs, output.T, strict=True))


def _columns(test: TestSetup, experiment: Experiment) -> dict[str, FloatArray]:
    """The model's inputs (n,) with their derivatives.

    A planned signal is exact: the slope of its spline is as good as its derivative. A record is measured: where its
    derivative is needed, it is smoothed with it, as an identification sees it.
    """
    inputs, time = [c for c in test.model.inputs if c.name != TIME.name], experiment.time
    if test.record is None:
        signal = experiment.inputs[test.excited.name]
        spline = CubicSpline(time, signal)
        return {name: spline(time, k) if k else signal for name, (_, k) in derivations(inputs).items()}
    columns = dict(experiment.inputs)
    for name, orders in derived_channels(test.model).items():
        smooth = smooth_derivatives(time, experiment.inputs[name], max(orders.values()))
        columns |= {name: smooth[0], **{derivative: smooth[order] for derivative, order in orders.items()}}
    return columns
