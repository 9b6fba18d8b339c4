"""Models with effects, which are models again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import chain
from typing import TypeVar
from weakref import WeakKeyDictionary

import casadi as ca

from mofit.errors import InputError, did_you_mean
from mofit.models.black_box import Simulator
from mofit.models.effect import Effect
from mofit.models.model import TARGET_UNIT, Channel, Condition, Equations, Model, Symbols
from mofit.models.own_names import with_own_names
from mofit.parameters import Parameter

Named = TypeVar("Named", Channel, Condition)
Owned = TypeVar("Owned", Channel, Parameter)


class ExtendedModel(Model):
    """``base`` with ``effects``: pairs of an effect and the name of what it acts on."""

    def __init__(self, base: Model, effects: Sequence[tuple[Effect, str]]) -> None:
        self.base, self.effects = base, tuple(effects)
        own = [effect for effect, _ in self.effects]
        named = [effect for effect in own if effect.part_of_name]
        self.name = "+".join([base.name, *(effect.name for effect in named)])
        with_these = f" with {', '.join(effect.title or effect.name for effect in named)}" if named else ""
        self.title = (base.title or base.name) + with_these
        units = [_units_of(base, target) for _, target in self.effects]
        self.parameters = base.parameters + _with_units([effect.parameters for effect in own], units)
        self.states = base.states + _with_units([effect.states for effect in own], units)
        self.inputs = _each_once(base.inputs, *(effect.inputs for effect in own))
        self.conditions = _each_once(base.conditions, *(effect.conditions for effect in own))
        self.outputs = base.outputs
        self.excitations, self.baseline, self.stages = base.excitations, base.baseline, base.stages
        self.branches, self.typical = base.branches, base.typical

    @property
    def dynamic(self) -> bool:
        """Whether outputs depend on the past of the inputs."""
        return bool(self.states) or self.base.dynamic

    def equations(self, s: Symbols) -> Equations:
        """The base model's equations; the effects act through the symbols."""
        return self.base.equations(s)


def with_effects(model: Model, *effects: Effect) -> Model:
    """The model extended by effects, each on the first of its targets that the model has.

    Where an effect's parameter or state bears a name of the model's, it gets one of its own (`apart`).

    Raises
    ------
    InputError
        If the model has none of an effect's targets, or lacks something that it needs.
    """
    if not effects:
        return model
    base, present = base_and_effects(model)
    own = [apart(effect, base) for effect in (*present, *effects)]
    return ExtendedModel(base, [(effect, target_of(effect, base)) for effect in own])


def apart(effect: Effect, model: Model) -> Effect:
    """The effect, its parameters and states named apart from what the model without effects names so."""
    base, _ = base_and_effects(model)
    return with_own_names(effect, {item.name for group in (base.parameters, base.states) for item in group})


def base_and_effects(model: Model) -> tuple[Model, tuple[Effect, ...]]:
    """The model that no effect extends, and the effects that extend it."""
    if not isinstance(model, ExtendedModel):
        return model, ()
    return model.base, tuple(effect for effect, _ in model.effects)


def target_of(effect: Effect, model: Model) -> str:
    """What the effect acts on in the model.

    Raises
    ------
    InputError
        If the model has none of the effect's targets, or lacks something that the effect needs.
    """
    where, lacking = f"effect '{effect.name}'", f"which model '{model.name}' does not have"
    targets = possible_targets(model)
    first = {"output": model.outputs[0].name} if model.outputs else {}
    target = next((name for name in (first.get(entry, entry) for entry in effect.on) if name in targets), None)
    if target is None and isinstance(model, Simulator):
        what = f"acts on {' or '.join(effect.on)}: out of reach, inside the simulator '{model.name}'"
        raise InputError.of(where, what, f"Within reach are {', '.join(dict.fromkeys(targets))}")
    if target is None:
        hint = did_you_mean(effect.on[0], targets)
        raise InputError.of(where, f"acts on {' or '.join(effect.on)}, {lacking}", hint)
    known = {*targets, *(state.name for state in model.states)}
    if missing := [entry for entry in effect.needs if not known & set(entry.split(" or "))]:
        raise InputError.of(where, f"needs {', '.join(missing)}, {lacking}", did_you_mean(missing[0], known))
    if closer := known & set(effect.unless):
        message = f"is for models without {', '.join(closer)}"
        raise InputError.of(where, message, "Name an effect of the same family that acts there")
    return target


def incompatibility(effect: Effect, model: Model) -> str | None:
    """Why the model does not admit the effect; None if it does."""
    try:
        target_of(effect, base_and_effects(model)[0])
    except InputError as error:
        return error.issues[0].message
    return None


def possible_targets(model: Model) -> tuple[str, ...]:
    """Inputs, announced quantities, outputs, rates of states, parameters and conditions of the model."""
    try:
        known = _targets.get(model)
    except TypeError:  # a user's data class has no hash
        return _possible_targets(model)
    if known is None:
        known = _targets[model] = _possible_targets(model)
    return known


#: by model, with which they go: every effect asks for them, and the equations must be run for what they announce
_targets: WeakKeyDictionary[Model, tuple[str, ...]] = WeakKeyDictionary()


def _possible_targets(model: Model) -> tuple[str, ...]:
    groups = (model.states, model.inputs, model.parameters, model.conditions)
    states, inputs, *constants = ([item.name for item in group] for group in groups)
    symbols = Symbols({name: ca.SX.sym(name) for name in chain(states, inputs, *constants)})
    model.equations(symbols)
    outputs = (channel.name for channel in model.outputs)
    return (*inputs, *symbols.quantities, *outputs, *map(rate_of, states), *chain(*constants))


def rate_of(state: str) -> str:
    """Name of a state's derivative as a target of effects."""
    return f"rate of {state}"


def _units_of(model: Model, target: str) -> dict[str, str]:
    """Units that an effect may leave to the model: that of its target, and those of channels and states by name.

    Announced quantities have none.
    """
    groups = (model.states, model.inputs, model.outputs, model.parameters, model.conditions)
    units = {item.name: item.unit for group in groups for item in group}
    own = units.get(target, "1") if target not in {state.name for state in model.states} else "1"
    return {f"unit of {name}": unit for name, unit in units.items()} | {TARGET_UNIT: own}


def _with_units(groups: Sequence[tuple[Owned, ...]], units: Sequence[Mapping[str, str]]) -> tuple[Owned, ...]:
    """Parameters or states of all effects, with the units that they leave to the model filled in."""
    return tuple(
        replace(item, unit=known.get(item.unit, item.unit))
        for group, known in zip(groups, units, strict=True)
        for item in group
    )


def _each_once(*groups: tuple[Named, ...]) -> tuple[Named, ...]:
    """All of them, each name once: the first that has it."""
    found: dict[str, Named] = {}
    for item in chain(*groups):
        found.setdefault(item.name, item)
    return tuple(found.values())
