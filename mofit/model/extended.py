"""A model with effects added: again a model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TypeVar

import casadi as ca

from mofit.errors import InputError, did_you_mean
from mofit.model.effect import UNIT_OF_TARGET, Effect
from mofit.model.model import Channel, Condition, Equations, Model
from mofit.model.symbols import Symbols
from mofit.parameters import Parameter

Named = TypeVar("Named", Channel, Condition)
Owned = TypeVar("Owned", Channel, Parameter)


class ExtendedModel(Model):
    """``base`` with ``hooks``: pairs of an effect and the name of what it acts on."""

    def __init__(self, base: Model, hooks: Sequence[tuple[Effect, str]]) -> None:
        self.base = base
        self.hooks = tuple(hooks)
        effects = [effect for effect, _ in self.hooks]
        self.name = "+".join([base.name, *(effect.name for effect in effects)])
        self.title = " with ".join(
            [base.title or base.name, ", ".join(effect.title or effect.name for effect in effects)]
        )
        units = [_unit_of(base, target) for _, target in self.hooks]
        self.parameters = base.parameters + _own([effect.parameters for effect in effects], units)
        self.states = base.states + _own([effect.states for effect in effects], units)
        self.inputs = _joined(base.inputs, *(effect.inputs for effect in effects))
        self.conditions = _joined(base.conditions, *(effect.conditions for effect in effects))
        self.outputs = base.outputs
        self.procedures, self.baseline, self.stages = base.procedures, base.baseline, base.stages

    def equations(self, s: Symbols) -> Equations:
        """The base model's equations; the effects act through the symbols."""
        return self.base.equations(s)


def _unit_of(model: Model, name: str) -> str:
    """Unit of a channel, parameter or condition; named quantities have none."""
    units: dict[str, str] = {}
    for group in (model.inputs, model.outputs, model.parameters, model.conditions):
        units |= {item.name: item.unit for item in group}
    return units.get(name, "1")


def _own(groups: Sequence[tuple[Owned, ...]], units: Sequence[str]) -> tuple[Owned, ...]:
    """Parameters or states of all effects, with the unit of what each acts on filled in."""
    return tuple(
        replace(item, unit=unit) if item.unit == UNIT_OF_TARGET else item
        for group, unit in zip(groups, units, strict=True)
        for item in group
    )


def _joined(*groups: tuple[Named, ...]) -> tuple[Named, ...]:
    """All of them, each name once: the first that has it."""
    found: dict[str, Named] = {}
    for group in groups:
        found = {**{item.name: item for item in group}, **found}
    order = dict.fromkeys(item.name for group in groups for item in group)
    return tuple(found[name] for name in order)


def quantity_names(model: Model) -> tuple[str, ...]:
    """Names that effects can act on: inputs, announced quantities, outputs, parameters and conditions of the model."""
    inputs, outputs = ([channel.name for channel in group] for group in (model.inputs, model.outputs))
    constants = [*(p.name for p in model.parameters), *(c.name for c in model.conditions)]
    states = [state.name for state in model.states]
    symbols = Symbols({name: ca.SX.sym(name) for name in (*states, *inputs, *constants)})
    model.equations(symbols)
    return (*inputs, *symbols.quantities, *outputs, *constants)


def target_of(effect: Effect, model: Model) -> str:
    """What the effect acts on in the model.

    Raises
    ------
    InputError
        If the model has none of the effect's targets, or lacks something that the effect needs.
    """
    names = quantity_names(model)
    known = {*names, *(state.name for state in model.states)}
    stands_for = {"output": model.outputs[0].name} if model.outputs else {}
    target = next((name for name in (stands_for.get(entry, entry) for entry in effect.on) if name in names), None)
    if target is None:
        raise InputError.of(
            f"effect '{effect.name}'",
            f"acts on {' or '.join(effect.on)}, which model '{model.name}' does not have",
            did_you_mean(effect.on[0], names),
        )
    if missing := [entry for entry in effect.needs if not known & set(entry.split(" or "))]:
        raise InputError.of(
            f"effect '{effect.name}'",
            f"needs {', '.join(missing)}, which model '{model.name}' does not have",
            did_you_mean(missing[0], known),
        )
    return target


def why_not(effect: Effect, model: Model) -> str | None:
    """Why the model does not admit the effect; None if it does."""
    try:
        target_of(effect, model.base if isinstance(model, ExtendedModel) else model)
    except InputError as error:
        return error.faults[0].what
    return None


def with_effects(model: Model, *effects: Effect) -> Model:
    """The model extended by effects, each on the first of its targets that the model has.

    Raises
    ------
    InputError
        If the model has none of an effect's targets, or lacks something that it needs.
    """
    if not effects:
        return model
    if isinstance(model, ExtendedModel):
        return with_effects(model.base, *(effect for effect, _ in model.hooks), *effects)
    return ExtendedModel(model, [(effect, target_of(effect, model)) for effect in effects])
