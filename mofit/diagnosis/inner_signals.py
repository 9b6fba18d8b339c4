"""What a fitted model computes between input and output: where a missing term may act, and on what it depends."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from mofit._typing import FloatArray
from mofit.diagnosis.extended_tests import experiments_of
from mofit.diagnosis.fitting import Fitted
from mofit.diagnosis.frozen_simulator import SIMULATED, frozen
from mofit.diagnosis.input_rates import rates_of_inputs
from mofit.diagnosis.linear_response import Linearised, LinearResponse, Motion
from mofit.models import (
    TARGET_UNIT,
    Addition,
    Channel,
    Equations,
    Model,
    Simulator,
    Symbols,
    build_system,
    with_effects,
)
from mofit.models.extended_model import base_and_effects, possible_targets, rate_of
from mofit.parameters import Parameter
from mofit.simulation import ExperimentData

#: The input that every test has.
_TIME = "time"
#: Squared sine of the angle up to which two signals are one.
_SAME = 1e-6
#: Relative error up to which a signal is the rate of another.
_RATE = 0.05
#: Samples at which the ways of acting are compared.
_POINTS = 200


@dataclass(frozen=True)
class Variable:
    """A signal that a term may depend on.

    Parameters
    ----------
    name, unit
        Of a state, an input or an output.
    scale
        Its largest magnitude in the data.
    low, high
        Its range in the data, relative to that.
    rate
        Name of the state or input that is its rate; empty if none is.
    derivative_of
        Name of the measured input whose rate it is, though the model does not read that; otherwise empty.
    is_output
        Whether it is an output of the model: only what acts on that output may depend on it.
    """

    name: str
    unit: str
    scale: float
    low: float
    high: float
    rate: str = ""
    derivative_of: str = ""
    is_output: bool = False

    @property
    def signed(self) -> bool:
        """Whether it has both signs in the data."""
        return self.low < 0 < self.high

    @property
    def channel(self) -> Channel:
        """As an input of an effect."""
        return Channel(self.name, self.unit, f"rate of {self.derivative_of}", self.derivative_of)


@dataclass(frozen=True)
class Target:
    """A quantity that a term may act on; ``alike`` are others on which an added term does the same."""

    name: str
    unit: str
    scale: float
    alike: tuple[str, ...] = ()


class InnerModel(Model):
    """A model whose further outputs are its states, inputs, announced quantities and rates, and effects' ``states``."""

    def __init__(self, base: Model, effects_states: Sequence[str] = ()) -> None:
        self.base = base
        self.name, self.parameters, self.states, self.inputs = base.name, base.parameters, base.states, base.inputs
        self.conditions = base.conditions
        constants = {item.name for group in (base.parameters, base.conditions) for item in group}
        states = tuple(state.name for state in base.states)
        targets = (name for name in possible_targets(base) if name not in constants)
        self.signals = tuple(dict.fromkeys((*states, *targets, *effects_states)))
        self.outputs = (*base.outputs, *(Channel(f"inner signal {name}", "1") for name in self.signals))

    def equations(self, s: Symbols) -> Equations:
        """The base model's, with every signal."""
        own = self.base.equations(s)
        rates = {rate_of(name): value for name, value in own.derivatives.items()}
        known = {**own.outputs, **s.quantities, **rates}
        # without the effects their states are not there
        known |= {name: getattr(s, name) if name in s else ca.SX(0) for name in self.signals if name not in known}
        inner = {name: known[name] for name in self.signals}
        return Equations(
            {**own.outputs, **{f"inner signal {name}": ca.SX(value) for name, value in inner.items()}},
            own.derivatives,
            own.initial,
        )


class _Shift(Addition):
    """A constant added to a quantity."""

    def __init__(self, target: str, number: int) -> None:
        self.name, self.on = f"shift_{number}", (target,)
        self.parameters = (Parameter(self.name, TARGET_UNIT, -1.0, 1.0, 0.0, neutral=0.0),)


@dataclass(frozen=True)
class InnerSignals:
    """Signals of the fitted model per test, by name: (samples,), those before the record included.

    ``used`` are the samples that count.
    """

    fitted: Fitted
    model: Model
    """Without effects; of a user's simulator what stands for it, see `mofit.diagnosis.frozen_simulator`."""
    signals: tuple[Mapping[str, FloatArray], ...]
    used: tuple[slice, ...]
    experiments: tuple[ExperimentData, ...]
    rates: tuple[Channel, ...] = ()
    """Rates of inputs, which the model does not read."""

    def joined(self, name: str) -> FloatArray:
        """The samples used of all tests, one after the other."""
        return np.concatenate([own[name][used] for own, used in zip(self.signals, self.used, strict=True)])

    def variables(self) -> list[Variable]:
        """Moving states, inputs and outputs, each signal once."""
        model = self.model
        known = (one for one in (*model.inputs, *model.states, *model.outputs) if one.name != _TIME)
        channels = [one for one in known if not one.name.startswith(SIMULATED)]
        found: list[tuple[Channel, FloatArray]] = []
        for channel in (*channels, *self.rates):
            values = self.joined(channel.name)
            if np.ptp(values) > _SAME * np.abs(values).max() and not any(same(values, other) for _, other in found):
                found.append((channel, values))
        outputs, unread = {channel.name for channel in model.outputs}, {channel.name for channel in self.rates}
        names = [channel.name for channel, _ in found if channel.name not in outputs | unread]
        variables = [
            Variable(
                channel.name,
                channel.unit,
                scale := float(np.abs(values).max()),
                float(values.min()) / scale,
                float(values.max()) / scale,
                next((other for other in names if self._is_rate(other, channel.name)), ""),
                (channel.derivative_of or "") if channel.name in unread else "",
                channel.name in outputs,
            )
            for channel, values in found
        ]
        moved = {one.name for one in variables if one.rate}
        return [one for one in variables if one.derivative_of not in moved]

    def _is_rate(self, rate: str, of: str) -> bool:
        if rate == of:
            return False
        square, error = 0.0, 0.0
        for own, used, experiment in zip(self.signals, self.used, self.experiments, strict=True):
            slope = np.gradient(own[of], experiment.step)[used]
            square += float(np.sum(slope**2))
            error += float(np.sum((own[rate][used] - slope) ** 2))
        return error < _RATE**2 * square

    def targets(self) -> list[Target]:
        """Quantities on which added terms do different things: outputs first, then the last that is announced."""
        model = self.model
        outputs = [channel.name for channel in model.outputs]
        inputs = [channel.name for channel in model.inputs if channel.name != _TIME]
        rates = [rate_of(state.name) for state in model.states]
        constants = {item.name for group in (model.parameters, model.conditions) for item in group}
        known = {*outputs, *inputs, *rates, *constants, _TIME}
        announced = [name for name in possible_targets(model) if name not in known]
        names = [*outputs, *reversed(announced), *rates, *inputs]
        ways = self._ways(names)
        groups: list[list[int]] = []
        for k, way in enumerate(ways):
            if not np.isfinite(way).all() or not np.any(way):
                continue
            group = next((own for own in groups if same(ways[own[0]], way)), None)
            if group is None:
                groups.append([k])
            else:
                group.append(k)
        units = {one.name: one.unit for one in (*model.inputs, *model.outputs)}
        units |= {rate_of(state.name): f"{state.unit}/s" for state in model.states}
        return [
            Target(
                names[own[0]],
                units.get(names[own[0]], f"unit of {names[own[0]]}"),
                float(np.abs(self.joined(names[own[0]])).max()),
                tuple(names[k] for k in own[1:]),
            )
            for own in groups
        ]

    def responses(self, names: Sequence[str], parameters: Sequence[str] = ()) -> list[LinearResponse]:
        """What is added to quantities and parameters changes in the outputs, to first order; per test."""
        linearised, motions = self._linearised(names, [slice(None)] * len(self.used), parameters)
        return [linearised.response(motion) for motion in motions]

    def _linearised(
        self, names: Sequence[str], samples: Sequence[slice], parameters: Sequence[str] = ()
    ) -> tuple[Linearised, list[Motion]]:
        """The model with quantities of these names shifted, and its motion at some samples of every test."""
        hypothesis = self.fitted.hypothesis
        shifts = [_Shift(name, k) for k, name in enumerate(names)]
        _, present = base_and_effects(hypothesis.observed.problem.model)
        system = build_system(with_effects(self.model, *present, *hypothesis.effects, *shifts))
        still = {shift.name: 0.0 for shift in shifts}
        tests = hypothesis.layout.values_by_test(self.fitted.minimum.point)
        motions = [
            Motion(
                experiment.step,
                stacked(own, system.states, experiment.samples)[picked],
                experiment.inputs[picked],
                np.array([{**values, **still}[name] for name in system.parameters]),
                experiment.conditions,
            )
            for own, experiment, values, picked in zip(self.signals, self.experiments, tests, samples, strict=True)
        ]
        return Linearised(system, [*(shift.name for shift in shifts), *parameters]), motions

    def _ways(self, names: Sequence[str]) -> list[FloatArray]:
        """What one more of each quantity does to rates and outputs at points of the data, (points * signals,) each."""
        every = max(sum(one.stop - one.start for one in self.used) // _POINTS, 1)
        linearised, motions = self._linearised(names, [slice(one.start, one.stop, every) for one in self.used])
        along = [linearised.along(motion) for motion in motions]
        slopes = np.concatenate([np.concatenate([driven, direct], axis=1) for _, driven, _, direct in along])
        # rates and outputs have units of their own
        size = np.sqrt(np.mean(slopes**2, axis=(0, 2), keepdims=True))
        return list((slopes / np.where(size > 0, size, 1.0)).transpose(2, 0, 1).reshape(len(names), -1))


def stacked(signals: Mapping[str, FloatArray], names: Sequence[str], samples: int) -> FloatArray:
    """Signals of these names, (samples, names)."""
    return np.stack([signals[name] for name in names], axis=1) if names else np.empty((samples, 0))


def same(a: FloatArray, b: FloatArray) -> bool:
    """Whether one signal is a multiple of the other."""
    product = float(a @ b) ** 2
    return product >= (1 - _SAME) * float(a @ a) * float(b @ b)


def inner_signals(fitted: Fitted, *, rates: bool = False) -> InnerSignals:
    """Simulate all that the fitted model computes in the tests; maybe with `rates_of_inputs`."""
    hypothesis, observed = fitted.hypothesis, fitted.hypothesis.observed
    base, present = base_and_effects(observed.problem.model)
    effects = (*present, *hypothesis.effects)
    given = experiments_of(observed.problem, hypothesis.effects)
    tests = hypothesis.layout.values_by_test(fitted.minimum.point)
    channels, moving = rates_of_inputs(hypothesis) if rates else ((), [{} for _ in tests])
    if isinstance(base, Simulator):
        base, given = frozen(base, effects, tests, given)
    inner = InnerModel(base, [state.name for effect in effects for state in effect.states])
    first = len(base.outputs)
    shapes = [(one.samples, len(inner.outputs)) for one in given]
    experiments = [
        replace(one.changed(measured=np.zeros(shape), weights=np.ones(shape)), lead=0)
        for one, shape in zip(given, shapes, strict=True)
    ]
    system, simulator = observed.simulators.simulator(with_effects(inner, *effects), experiments, (), hypothesis.steps)
    outputs = simulator.simulate(np.array([[[values[name] for name in system.parameters] for values in tests]]))
    names = list(enumerate(inner.signals, first))
    signals = [{name: one[0, :, k] for k, name in names} | own for one, own in zip(outputs, moving, strict=True)]
    first_used = {test: (given[test].lead + w.start, w.count) for test, _, w in reversed(observed.records)}
    used = [slice(start, start + count) for start, count in (first_used[test] for test in range(len(signals)))]
    return InnerSignals(fitted, base, tuple(signals), tuple(used), tuple(given), channels)
