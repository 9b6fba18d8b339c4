"""The variables of an FMU: names, value references, units and start values; of both versions of FMI alike."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal
from uuid import NAMESPACE_OID, uuid5

import xarray as xr

from mofit.models import Model, System
from mofit.models.model import TIME, derivations
from mofit.quantities import known_unit, title_of
from mofit.results.export import system_with_equations
from mofit.results.fmu.scales import input_sizes, state_sizes
from mofit.results.fmu.values import condition_starts, limits_of, parameter_starts

Causality = Literal["independent", "input", "parameter", "output", "local"]

#: highest derivative of what the equations read that an importer may give: that of a cubic spline
CUBIC = 3
_STRUCTURED = re.compile(r"[A-Za-z_]\w*|der\([A-Za-z_]\w*(,\d+)?\)", re.ASCII)
#: what XML cannot hold, and line breaks
_UNWRITABLE = re.compile("[^ -\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


@dataclass(frozen=True)
class FmuVariable:
    """A variable of an FMU, a real number; its value reference is its place among all."""

    name: str
    causality: Causality
    unit: str
    description: str
    start: float | None = None
    minimum: float | None = None
    maximum: float | None = None
    nominal: float | None = None


@dataclass(frozen=True)
class Signal:
    """A channel that drives the model, with its derivatives: the order of each input of the model that follows from it.

    Between communication points it runs as the polynomial of its value and its derivatives.
    """

    source: str
    orders: Mapping[str, int]

    @property
    def read(self) -> int:
        """Highest derivative that the equations read."""
        return max(self.orders.values())


@dataclass(frozen=True)
class Contents:
    """All that an FMU says of a model."""

    model: Model
    system: System
    signals: tuple[Signal, ...]
    variables: tuple[FmuVariable, ...]
    """Time, then inputs signal by signal with rising order, parameters, conditions, outputs, states."""

    @cached_property
    def orders(self) -> int:
        """Number of inputs that every signal has: itself and its derivatives."""
        return 1 + CUBIC + max((signal.read for signal in self.signals), default=0)

    @cached_property
    def token(self) -> str:
        """Tells this FMU from others: it follows from equations, names and numbers."""
        return f"{{{uuid5(NAMESPACE_OID, self.system.hash() + repr(self.variables))}}}"

    def of(self, causality: Causality) -> list[tuple[int, FmuVariable]]:
        """Variables of a causality with their value references."""
        return [(k, variable) for k, variable in enumerate(self.variables) if variable.causality == causality]

    @property
    def structured(self) -> bool:
        """Whether all names follow FMI's structured naming convention; else it is the flat one."""
        return all(_STRUCTURED.fullmatch(variable.name) for variable in self.variables)


def contents(tree: xr.DataTree, model: Model, mode: str = "m1", test: str | None = None) -> Contents:
    """The variables of a run's model with its numbers, see `mofit.results.fmu.values`.

    Raises
    ------
    InputError
        If the run lacks the mode, the test or a value, if a condition differs between the tests and none is named, or
        if the model has no equations.
    """
    system = system_with_equations(model)
    parameters, conditions = parameter_starts(tree, model, mode, test), condition_starts(tree, model, test)
    numbers = ({name: start.value for name, start in own.items()} for own in (parameters, conditions))
    inputs, states = input_sizes(tree, model), state_sizes(tree, model, system, *numbers)
    signals = _signals(model)
    found = [FmuVariable(TIME.name, "independent", "s", "simulation time")]
    orders = Contents(model, system, signals, ()).orders
    found += [variable for signal in signals for variable in _inputs(model, signal, orders, inputs)]
    for own in model.parameters:
        start = parameters[own.name]
        low, high = limits_of(own, start.value)
        text = f"{own.description or own.name}; {start.origin}"
        size = abs(start.value) or None
        found.append(FmuVariable(own.name, "parameter", own.unit, text, start.value, low, high, size))
    for condition in model.conditions:
        start = conditions[condition.name]
        text = f"{title_of(condition.name, condition.description)}; {start.origin}"
        found.append(FmuVariable(condition.name, "parameter", condition.unit, text, start.value))
    for output in model.outputs:
        found.append(FmuVariable(output.name, "output", output.unit, title_of(output.name, output.description)))
    for state, size in zip(model.states, states, strict=True):
        text = f"{title_of(state.name, state.description)}; state"
        found.append(FmuVariable(state.name, "local", state.unit, text, nominal=size))
    return Contents(model, system, signals, tuple(_each_named_once(found)))


def _signals(model: Model) -> tuple[Signal, ...]:
    """What drives the model, but for time, which every FMU knows."""
    found: dict[str, dict[str, int]] = {}
    for name, (source, order) in derivations(model.inputs).items():
        if source != TIME.name:
            found.setdefault(source, {})[name] = order
    return tuple(Signal(source, orders) for source, orders in found.items())


def _inputs(model: Model, signal: Signal, orders: int, sizes: Mapping[str, float]) -> Iterable[FmuVariable]:
    """The signal and its derivatives: those that the model names by that name, the others as ``der(NAME,ORDER)``."""
    channels = {channel.name: channel for channel in model.inputs}
    named = {order: name for name, order in signal.orders.items()}
    unit = channels[signal.source].unit if signal.source in channels else known_unit(signal.source)
    for order in range(orders):
        if order in named:
            own = channels[named[order]]
            text = title_of(own.name, own.description)
            if order:
                text += f"; {_ordinal(order)} time derivative of {signal.source}, estimated where it is not set"
            yield FmuVariable(own.name, "input", own.unit, text, 0.0, nominal=sizes.get(own.name))
        elif not order:
            yield FmuVariable(signal.source, "input", unit or "", title_of(signal.source), 0.0)
        else:
            name = f"der({signal.source})" if order == 1 else f"der({signal.source},{order})"
            text = f"{_ordinal(order)} time derivative of {signal.source} from the communication point on"
            over = f"{unit}/s" if order == 1 else f"{unit}/s^{order}"
            yield FmuVariable(name, "input", over if unit else "", text, 0.0)


def _ordinal(order: int) -> str:
    return {1: "first", 2: "second", 3: "third", 4: "fourth", 5: "fifth"}.get(order, f"{order}th")


def _each_named_once(variables: Iterable[FmuVariable]) -> Iterable[FmuVariable]:
    """All with texts that XML can hold; a name that another has already gets a number."""
    taken: set[str] = set()
    for variable in variables:
        plain = writable(variable.name).strip() or "variable"
        name, number = plain, 1
        while name in taken:
            number += 1
            name = f"{plain}_{number}"
        taken.add(name)
        yield replace(variable, name=name, unit=writable(variable.unit), description=writable(variable.description))


def writable(text: str) -> str:
    """Text that an attribute of an XML file can hold: a blank for everything else."""
    return _UNWRITABLE.sub(" ", text)
