"""A model with effects added: again a model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import chain
from typing import TypeVar

import casadi as ca

from mofit.errors import InputError, did_you_mean
from mofit.models.declarations import TARGET_UNIT, Channel, Condition, Equations
from mofit.models.effect import Effect
from mofit.models.model import Model
from mofit.models.symbols import Symbols
from mofit.parameters import Parameter

Named = TypeVar("Named", Channel, Condition)
Owned = TypeVar("Owned", Channel, Parameter)


class ExtendedModel(Model):
    """``base`` with ``effects``: pairs of an effect and the name of what it acts on."""

    def __init__(self, base: Model, effects: Sequence[tuple[Effect, str]]) -> None:
        self.base, self.effects = base, tuple(effects)
        own = [effect for effect, _ in self.effects]
        self.name = "+".join([base.name, *(effect.name for effect in own)])
        self.title = f"{base.title or base.name} with {', '.join(effect.title or effect.name for effect in own)}"
        units = [_unit_of(base, target) for _, target in self.effects]
        self.parameters = base.parameters + _with_units([effect.parameters for effect in own], units)
        self.states = base.states + _with_units([effect.states for effect in own], units)
        self.inputs = _each_once(base.inputs, *(effect.inputs for effect in own))
        self.conditions = _each_once(base.conditions, *(effect.conditions for effect in own))
        self.outputs = base.outputs
        self.excitations, self.baseline, self.stages = base.excitations, base.baseline, base.stages
        self.branches = base.branches

    def equations(self, s: Symbols) -> Equations:
        """The base model's equations; the effects act through the symbols."""
        return self.base.equations(s)


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
        return with_effects(model.base, *(effect for effect, _ in model.effects), *effects)
    return ExtendedModel(model, [(effect, target_of(effect, model)) for effect in effects])


def target_of(effect: Effect, model: Model) -> str:
    """What the effect acts on in the model.

    Raises
    ------
    InputError
        If the model has none of the effect's targets, or lacks something that the effect needs.
    """
    targets = _possible_targets(model)
    known = {*targets, *(state.name for state in model.states)}
    first = {"output": model.outputs[0].name} if model.outputs else {}
    target = next((name for name in (first.get(entry, entry) for entry in effect.on) if name in targets), None)
    if target is None:
        raise InputError.of(
            f"effect '{effect.name}'",
            f"acts on {' or '.join(effect.on)}, which model '{model.name}' does not have",
            did_you_mean(effect.on[0], targets),
        )
    if missing := [entry for entry in effect.needs if not known & set(entry.split(" or "))]:
        raise InputError.of(
            f"effect '{effect.name}'",
            f"needs {', '.join(missing)}, which model '{model.name}' does not have",
            did_you_mean(missing[0], known),
        )
    return target


def incompatibility(effect: Effect, model: Model) -> str | None:
    """Why the model does not admit the effect; None if it does."""
    try:
        target_of(effect, model.base if isinstance(model, ExtendedModel) else model)
    except InputError as error:
        return error.issues[0].message
    return None


def _possible_targets(model: Model) -> tuple[str, ...]:
    """Inputs, announced quantities, outputs, parameters and conditions of the model."""
    groups = (model.states, model.inputs, model.parameters, model.conditions)
    states, inputs, *constants = ([item.name for item in group] for group in groups)
    symbols = Symbols({name: ca.SX.sym(name) for name in chain(states, inputs, *constants)})
    model.equations(symbols)
    return (*inputs, *symbols.quantities, *(channel.name for channel in model.outputs), *chain(*constants))


def _unit_of(model: Model, name: str) -> str:
    """Unit of a channel, parameter or condition; announced quantities have none."""
    groups = (model.inputs, model.outputs, model.parameters, model.conditions)
    return {item.name: item.unit for group in groups for item in group}.get(name, "1")


def _with_units(groups: Sequence[tuple[Owned, ...]], units: Sequence[str]) -> tuple[Owned, ...]:
    """Parameters or states of all effects, with the unit of what each effect acts on filled in."""
    return tuple(
        replace(item, unit=unit) if item.unit == TARGET_UNIT else item
        for group, unit in zip(groups, units, strict=True)
        for item in group
    )


def _each_once(*groups: tuple[Named, ...]) -> tuple[Named, ...]:
    """All of them, each name once: the first that has it."""
    found: dict[str, Named] = {}
    for item in chain(*groups):
        found.setdefault(item.name, item)
    return tuple(found.values())
