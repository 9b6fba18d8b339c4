"""The virtual test rig: plan in, campaign out."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from mofit.campaign import Campaign, Measurement, Procedure
from mofit.drives import TIME, all_conditions
from mofit.errors import InputError
from mofit.kernel import Drive, Simulator
from mofit.model import build_system
from mofit.simulate.excitation import Excitation, excitation
from mofit.simulate.noise import noise
from mofit.simulate.plan import Plan, read_plan
from mofit.simulate.setup import Setup, TestSetup, set_up

Array = NDArray[np.float64]


def simulate(path: str | Path) -> Campaign:
    """Run the plan's tests on a virtual rig.

    A test is answered by the plan's model, except where a calibration stage of that model takes the whole record of
    such a test (the tyre models' quasi-static test: the spring alone); an effect joins wherever it can act.
    All draws come from the plan's seed: the same plan gives the same campaign.

    Parameters
    ----------
    path
        Plan file (TOML), see docs/models.md.

    Raises
    ------
    InputError
        With all faults of the plan together.
    """
    path = Path(path)
    return run_plan(read_plan(path), f"plan '{path.name}'")


def run_plan(plan: Plan, where: str = "plan") -> Campaign:
    """The campaign of a plan; ``where`` names it in errors. See `simulate`."""
    setup = set_up(plan, where)
    rng = np.random.default_rng(plan.seed)
    measurements, clock = [], 0.0
    for test in setup.tests:
        signal = excitation(test.plan.kind, test.settings, test.plan.lines, rng)
        channels = respond(setup, test, signal, clock)
        noisy = {
            name: values + noise(values, rng, **setup.noise[name]) if name in setup.noise else values
            for name, values in channels.items()
        }
        measurements.append(_measurement(test, signal, noisy, clock))
        clock += float(signal.time[-1]) + setup.pause
    return Campaign(
        title=plan.title,
        source="simulated",
        conditions=setup.conditions,
        measurements=tuple(measurements),
        attributes=_attributes(plan, setup.values),
        units=setup.units,
    )


def respond(setup: Setup, test: TestSetup, signal: Excitation, start: float) -> dict[str, Array]:
    """Channels of one test without noise: the driven input and the outputs, shape (n,) each.

    ``start`` is the time since the campaign began, s.
    """
    source, system = test.source, build_system(test.source)
    # for an exact signal the spline's slope is as good as the derivative
    slope = CubicSpline(signal.time, signal.values).derivative()(signal.time)
    driven = next(channel.name for channel in source.inputs if channel.derivative_of is None)
    columns = {TIME: signal.time, driven: signal.values}
    conditions = all_conditions(_procedure(test, signal, columns, start, setup.conditions))
    p = np.array([setup.values[name] for name in system.parameters])
    shape = (len(signal.time), len(system.outputs))
    drive = Drive(
        name=test.plan.name,
        step=1 / test.settings["sample_rate"],
        inputs=np.stack([slope if c.derivative_of else columns[c.name] for c in source.inputs], axis=1),
        hold=signal.hold,
        conditions=np.array([conditions.get(c.name, c.default) for c in source.conditions], dtype=float),
        measured=np.zeros(shape),
        weights=np.ones(shape),
    )
    output = Simulator(system, [drive], ()).simulate(p[None])[0][0]
    if not np.all(np.isfinite(output)):
        raise InputError.of(
            f"test '{test.plan.name}'", f"model '{source.name}' gave no finite output", "Check its parameters"
        )
    return {driven: signal.values, **{name: output[:, i] for i, name in enumerate(system.outputs)}}


def _measurement(test: TestSetup, signal: Excitation, channels: Mapping[str, Array], start: float) -> Measurement:
    outputs = {channel.name for channel in test.source.outputs}
    inputs = {name: values for name, values in channels.items() if name not in outputs}
    units = {c.name: c.unit for c in (*test.source.inputs, *test.source.outputs) if c.name in channels}
    return Measurement(
        _procedure(test, signal, inputs, start), {name: channels[name] for name in sorted(outputs)}, units
    )


def _procedure(
    test: TestSetup,
    signal: Excitation,
    inputs: Mapping[str, Array],
    start: float,
    common: Mapping[str, float] | None = None,
) -> Procedure:
    """The test as a procedure, with the conditions of its own on top of ``common`` ones."""
    return Procedure(
        name=test.plan.name,
        kind=test.plan.kind,
        time=signal.time,
        inputs=inputs,
        conditions={**(common or {}), **test.conditions},
        frequency=signal.frequency,
        amplitude=test.settings["amplitude"],
        start_time=start,
        hold=signal.hold,
    )


def _attributes(plan: Plan, values: Mapping[str, float]) -> dict[str, Any]:
    """What the file says about how it came about."""
    return {
        **plan.attributes,
        "made_with": "mofit simulate: a virtual rig, not a measurement",
        "simulated_model": "+".join([plan.model, *(effect.name for effect in plan.effects)]),
        "simulated_parameters": json.dumps(dict(values)),
        "simulated_noise": json.dumps({name: entry.model_dump() for name, entry in plan.noise.items()}),
        "seed": plan.seed,
    }
