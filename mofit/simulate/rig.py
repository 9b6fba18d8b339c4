"""The virtual test rig: plan in, campaign out."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from mofit.campaign import Campaign, Measurement, Procedure
from mofit.errors import Fault, InputError, did_you_mean, raise_errors
from mofit.kernel import Drive, Simulator
from mofit.labels import CONDITIONS
from mofit.library import find_effect, find_model
from mofit.model import Effect, Model, build_system, with_effects
from mofit.model.extended import quantity_names
from mofit.readers.map_file import Quantity, quantity
from mofit.simulate.excitation import Excitation, excitation
from mofit.simulate.noise import noise
from mofit.simulate.plan import EffectPlan, Plan, TestPlan, read_plan

Array = NDArray[np.float64]
T = TypeVar("T")

_UNITS = {"sample_rate": "Hz", "frequency": "Hz", "last_frequency": "Hz", "duration": "s", "delay": "s"}


def simulate(path: str | Path) -> Campaign:
    """Run the plan's tests on a virtual rig.

    A test is simulated by the plan's model, except where a calibration stage of that model takes the whole record of
    such a test (the tyre models' quasi-static test: the spring alone); an effect joins wherever it can act.
    All draws come from the plan's seed: the same plan gives the same campaign.

    Parameters
    ----------
    path
        Plan file (TOML), see docs/campaigns.md.

    Raises
    ------
    InputError
        With all faults of the plan together.
    """
    path = Path(path)
    return run_plan(read_plan(path), f"plan '{path.name}'")


def run_plan(plan: Plan, where: str = "plan") -> Campaign:
    """The campaign of a plan; ``where`` names it in errors. See `simulate`."""
    faults: list[Fault] = []
    model, effects = _models(plan, where, faults)
    raise_errors(faults)
    values = _values(plan, model, effects, where, faults)
    conditions, units = _conditions(plan.conditions, model, where, faults)
    sources = {test.name: _source(model, effects, test.kind) for test in plan.tests}
    settings = {t.name: _settings(t, sources[t.name], f"{where}, test '{t.name}'", faults) for t in plan.tests}
    own = {t.name: _conditions(t.conditions, model, f"{where}, test '{t.name}'", faults)[0] for t in plan.tests}
    noises = _noises(plan, list(sources.values()), where, faults)
    pause = _try(faults, lambda: quantity(f"{where}, pause", plan.pause, "s")[0]) or 0.0
    faults += [
        Fault(f"{where}, test '{test.name}'", f"model '{source.name}' needs condition '{c.name}' in {c.unit}", "Add it")
        for test in plan.tests
        for source in [sources[test.name]]
        for c in source.conditions
        if c.default is None and c.name not in {**conditions, **own[test.name]}
    ]
    raise_errors(faults)
    rng = np.random.default_rng(plan.seed)
    measurements, clock = [], 0.0
    for test in plan.tests:
        signal = excitation(test.kind, settings[test.name], test.lines, rng)
        here = {**conditions, **own[test.name]}
        channels = _response(sources[test.name], values, signal, here, test.name)
        noisy = {
            name: y + noise(y, rng, **noises[name]) if name in noises else y for name, y in channels.items()
        }  # fmt: skip
        amplitude = settings[test.name]["amplitude"]
        measurements.append(_measurement(test, sources[test.name], signal, noisy, own[test.name], amplitude, clock))
        clock += float(signal.time[-1]) + pause
    return Campaign(plan.title, "simulated", conditions, tuple(measurements), _attributes(plan, values), units)


def _models(plan: Plan, where: str, faults: list[Fault]) -> tuple[Model, tuple[Effect, ...]]:
    """The model and its effects; a fault if an effect fits nowhere."""
    model = _try(faults, lambda: find_model(plan.model), f"{where}, ")
    found = [_try(faults, lambda name=effect.name: find_effect(name), f"{where}, ") for effect in plan.effects]
    effects = tuple(effect for effect in found if effect is not None)
    if model is not None:
        _try(faults, lambda: build_system(with_effects(model, *effects)), f"{where}, ")
    return model, effects  # type: ignore[return-value]  # without a model there is a fault, and the caller stops


def _values(plan: Plan, model: Model, effects: tuple[Effect, ...], where: str, faults: list[Fault]) -> dict[str, float]:
    """Every parameter's value: the plan's, else nominal."""
    values: dict[str, float] = {}
    owners: list[tuple[str, Model | Effect, Mapping[str, Quantity]]] = [("parameters", model, plan.parameters)]
    plans: tuple[EffectPlan, ...] = plan.effects
    owners += [(f"effect '{e.name}'", e, p.parameters) for e, p in zip(effects, plans, strict=True)]
    for place, owner, given in owners:
        units = {p.name: p.unit for p in owner.parameters}
        values |= {p.name: p.nominal for p in owner.parameters}
        faults += [
            Fault(f"{where}, {place}", f"unknown parameter '{name}'", did_you_mean(name, units))
            for name in given
            if name not in units
        ]
        for name in given.keys() & units.keys():
            value = _try(faults, lambda n=name, g=given, u=units: quantity(f"{where}, {n}", g[n], u[n])[0])
            values[name] = np.nan if value is None else value
    return values


def _conditions(
    given: Mapping[str, Quantity], model: Model, where: str, faults: list[Fault]
) -> tuple[dict[str, float], dict[str, str]]:
    """Conditions in SI units, and their units."""
    known = {name: label.unit for name, label in CONDITIONS.items()} | {c.name: c.unit for c in model.conditions}
    found = {
        name: _try(faults, lambda n=name, v=value: quantity(f"{where}, condition '{n}'", v, known.get(n)))
        for name, value in given.items()
    }
    sound = {name: pair for name, pair in found.items() if pair is not None}
    return {name: value for name, (value, _) in sound.items()}, {name: unit for name, (_, unit) in sound.items()}


def _source(model: Model, effects: tuple[Effect, ...], kind: str) -> Model:
    """What answers to a test of this kind, with the effects that can act on it."""
    stages = [stage for stage in model.stages if kind in stage.procedures and not stage.settled]
    base = find_model(stages[0].model) if stages else model
    names = quantity_names(base)
    return with_effects(base, *(effect for effect in effects if set(effect.on) & set(names)))


def _settings(test: TestPlan, source: Model, where: str, faults: list[Fault]) -> dict[str, float]:
    """The test's numbers in SI units."""
    unit = next(channel.unit for channel in source.inputs if channel.derivative_of is None)
    units = {**_UNITS, "amplitude": unit, "ramp_rate": f"{unit}/s"}
    found: dict[str, float] = {} if test.periods is None else {"periods": test.periods}
    for key, target in units.items():
        value = getattr(test, key)
        if value is not None:
            number = _try(faults, lambda k=key, v=value, u=target: quantity(f"{where}, {k}", v, u)[0])
            found[key] = np.nan if number is None else number
            if number is not None and key not in ("amplitude", "delay") and not number > 0:
                faults.append(Fault(f"{where}, {key}", f"{value} is not above 0", "Give a positive number"))
    return found


def _noises(plan: Plan, sources: list[Model], where: str, faults: list[Fault]) -> dict[str, dict[str, float]]:
    """Noise settings by channel, in SI units."""
    units = {c.name: c.unit for source in sources for c in (*source.inputs, *source.outputs) if not c.derivative_of}
    found = {}
    for name, entry in plan.noise.items():
        if name not in units:
            faults.append(Fault(f"{where}, noise", f"no channel '{name}'", did_you_mean(name, units)))
            continue
        found[name] = entry.model_dump()
        for key in ("sd", "coloured_sd"):
            place = f"{where}, noise of '{name}', {key}"
            found[name][key] = _try(faults, lambda p=place, v=found[name][key], u=units[name]: quantity(p, v, u)[0])
    return found


def _response(
    source: Model, values: Mapping[str, float], signal: Excitation, conditions: Mapping[str, float], name: str
) -> dict[str, Array]:
    """Exact inputs and outputs of one test."""
    system = build_system(source)
    slope = CubicSpline(signal.time, signal.values).derivative()(signal.time)
    columns = [slope if channel.derivative_of else signal.values for channel in source.inputs]
    driven = next(channel.name for channel in source.inputs if channel.derivative_of is None)
    n, p = len(signal.time), np.array([values[q] for q in system.parameters])
    drive = Drive(
        name=name,
        step=float(signal.time[1] - signal.time[0]),
        inputs=np.stack(columns, axis=1),
        hold=signal.hold,
        conditions=np.array([conditions.get(c.name, c.default) for c in source.conditions], dtype=float),
        measured=np.zeros((n, len(system.outputs))),
        weights=np.ones((n, len(system.outputs))),
    )
    output = Simulator(system, [drive], (), box=(p, p)).simulate(p[None])[0][0]
    if not np.all(np.isfinite(output)):
        raise InputError.of(f"test '{name}'", f"model '{source.name}' gave no finite output", "Check its parameters")
    return {driven: signal.values, **{channel: output[:, i] for i, channel in enumerate(system.outputs)}}


def _measurement(
    test: TestPlan, source: Model, signal: Excitation, channels: Mapping[str, Array],
    conditions: Mapping[str, float], amplitude: float, start: float,
) -> Measurement:  # fmt: skip
    outputs = {channel.name for channel in source.outputs}
    procedure = Procedure(
        name=test.name,
        kind=test.kind,
        time=signal.time,
        inputs={name: values for name, values in channels.items() if name not in outputs},
        conditions=conditions,
        frequency=signal.frequency,
        amplitude=amplitude,
        start_time=start,
        hold=signal.hold,
    )
    units = {c.name: c.unit for c in (*source.inputs, *source.outputs) if c.name in channels}
    return Measurement(procedure, {name: channels[name] for name in sorted(outputs)}, units)


def _attributes(plan: Plan, values: Mapping[str, float]) -> dict[str, Any]:
    """What the file says about how it came about."""
    return {
        **plan.attributes,
        "made_with": "mofit simulate: no measurement",
        "simulated_model": "+".join([plan.model, *(effect.name for effect in plan.effects)]),
        "simulated_parameters": json.dumps(dict(values)),
        "simulated_noise": json.dumps({name: entry.model_dump() for name, entry in plan.noise.items()}),
        "seed": plan.seed,
    }


def _try(faults: list[Fault], make: Callable[[], T], prefix: str = "") -> T | None:
    """The value, or None with its faults kept for the one message of all."""
    try:
        return make()
    except InputError as error:
        faults += [Fault(prefix + fault.where, fault.what, fault.cure) for fault in error.faults]
        return None
