"""Effects, what a model may leave out, and models with effects, which are models again."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from itertools import chain, product
from typing import TypeVar

import casadi as ca

from mofit.errors import InputError, Issue, did_you_mean
from mofit.models.black_box import Simulator
from mofit.models.model import TARGET_UNIT, Applied, Channel, Condition, Equations, Model, Symbols
from mofit.parameters import PER_CAMPAIGN, Parameter

Named = TypeVar("Named", Channel, Condition)
Owned = TypeVar("Owned", Channel, Parameter)


class Effect(ABC):
    """A model extension: it acts on one named quantity, input, output, parameter or condition.

    Parameters with a neutral value are the effect's *size*; at neutral the model is unchanged. All others (time
    constants, exponents, yield lengths) have no meaning without it, and state a grid of values to try.

    Attributes
    ----------
    title, family
        Its own law, and the cause that it shares with other laws, in the field's words; an effect that states no family
        is one by itself.
    on
        Names of possible targets; the effect acts on the first that the model has. ``"output"`` means the model's
        first output, ``"rate of NAME"`` the derivative of its state.
    needs
        Names of the model that `apply` reads beside the target; ``"one or another"`` where either will do.
    unless
        Names of quantities: for a model that has one of them, other effects say the same more closely.
    parameters, states
        The effect's own. The unit `TARGET_UNIT` means that of the target; ``"unit of NAME"`` that of a channel.
    inputs, conditions
        What it reads of a test beside the model's. Every test has the input ``time`` (s, since its first sample) and
        the conditions ``sample_interval`` and ``record_length`` (s); with ``start_time`` (s, since the campaign began)
        where the file states it.
    candidate
        False for an effect that a diagnosis tries only when it is named.
    of_rig, part_of_name
        Whether the rig or the measuring chain adds it, else the model lacks it; whether the extended model names it.
    """

    name: str
    title: str = ""
    family: str = ""
    on: tuple[str, ...]
    needs: tuple[str, ...] = ()
    unless: tuple[str, ...] = ()
    parameters: tuple[Parameter, ...] = ()
    states: tuple[Channel, ...] = ()
    inputs: tuple[Channel, ...] = ()
    conditions: tuple[Condition, ...] = ()
    candidate: bool = True
    of_rig: bool = False
    part_of_name: bool = True

    @abstractmethod
    def apply(self, s: Symbols, value: ca.SX) -> Applied:
        """The quantity with the effect, from its ``value`` without."""

    @property
    def cause(self) -> str:
        """Its family, or itself where it states none."""
        return self.family or self.title or self.name

    @property
    def size(self) -> tuple[str, ...]:
        """Parameters that make up the size: those with a neutral value."""
        return tuple(p.name for p in self.parameters if p.neutral is not None)

    @property
    def typical(self) -> float:
        """Expected size in the unit of its parameters: the distance of their nominal values from neutral."""
        return math.hypot(*(p.nominal - p.neutral for p in self.parameters if p.neutral is not None))

    @property
    def neutral(self) -> dict[str, float]:
        """Values at which the model is unchanged; nominal for what is not part of the size."""
        return {p.name: p.nominal if p.neutral is None else p.neutral for p in self.parameters}

    @property
    def grid(self) -> dict[str, tuple[float, ...]]:
        """Values to try of every parameter of the campaign beside the size; the nominal one where it states none."""
        return {p.name: p.grid or (p.nominal,) for p in self._beside_size if p.per == PER_CAMPAIGN}

    @property
    def scoped_grid(self) -> dict[str, tuple[float, ...]]:
        """The same of parameters with a value per test or condition: values that span what any of them does."""
        return {p.name: p.grid or (p.nominal,) for p in self._beside_size if p.per != PER_CAMPAIGN}

    @property
    def _beside_size(self) -> list[Parameter]:
        return [p for p in self.parameters if p.neutral is None]

    @property
    def grid_points(self) -> list[dict[str, float]]:
        """Every combination of the grid; one that is empty where all parameters are size."""
        return _points(self.grid)

    @property
    def scoped_grid_points(self) -> list[dict[str, float]]:
        """Every combination of the scoped grid; one that is empty without scoped parameters beside the size."""
        return _points(self.scoped_grid)

    @property
    def scoped(self) -> bool:
        """Whether a parameter has a value per test or condition."""
        return any(p.per != PER_CAMPAIGN for p in self.parameters)

    def for_tests(self, stated: Collection[str]) -> Effect:
        """The effect for tests that all state these conditions; by default itself.

        A condition that is missing may leave a parameter per test in its place.
        """
        return self

    def issues(self) -> list[Issue]:
        """What the effect's author must correct."""
        where = f"effect '{getattr(self, 'name', '') or type(self).__name__}'"
        found = [
            Issue(where, f"has no '{attribute}'", f"Set the class attribute '{attribute}'")
            for attribute in ("name", "on")
            if not getattr(self, attribute, None)
        ]
        if isinstance(getattr(self, "on", ()), str):
            found.append(Issue(where, "'on' is one text", "Write a tuple of names: on = ('force',)"))
        if not self.size:
            found.append(Issue(where, "no parameter has a neutral value", "Give its size one: Parameter(…, neutral=0)"))
        return found + [
            Issue(f"{where}, {issue.where}", issue.message, issue.hint) for p in self.parameters for issue in p.issues()
        ]


def _points(grid: Mapping[str, tuple[float, ...]]) -> list[dict[str, float]]:
    return [dict(zip(grid, point, strict=True)) for point in product(*grid.values())]


class Scaling(Effect):
    """A quantity times one plus a relative change: the effect's first parameter, or what `change` makes of it."""

    def change(self, s: Symbols, value: ca.SX) -> ca.SX:
        """Relative change of the quantity."""
        return getattr(s, self.parameters[0].name)

    def apply(self, s: Symbols, value: ca.SX) -> Applied:
        """The quantity, scaled."""
        return Applied(value * (1 + self.change(s, value)))


class Addition(Effect):
    """A quantity plus a term in its unit: the effect's first parameter, or what `term` makes of it."""

    def term(self, s: Symbols) -> ca.SX:
        """What is added to the quantity."""
        return getattr(s, self.parameters[0].name)

    def apply(self, s: Symbols, value: ca.SX) -> Applied:
        """The quantity with the term."""
        return Applied(value + self.term(s))


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

    Raises
    ------
    InputError
        If the model has none of an effect's targets, or lacks something that it needs.
    """
    if not effects:
        return model
    base, present = base_and_effects(model)
    return ExtendedModel(base, [(effect, target_of(effect, base)) for effect in (*present, *effects)])


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
