"""A model with effects added: again a model."""

from __future__ import annotations

from typing import TYPE_CHECKING

import casadi as ca

from mofit.errors import InputError, did_you_mean
from mofit.model.effect import Effect
from mofit.model.model import Equations, Model
from mofit.model.symbols import Symbols

if TYPE_CHECKING:
    from collections.abc import Sequence


class ExtendedModel(Model):
    """``base`` with ``hooks``: pairs of an effect and the name of the quantity it acts on."""

    def __init__(self, base: Model, hooks: Sequence[tuple[Effect, str]]) -> None:
        self.base = base
        self.hooks = tuple(hooks)
        effects = [effect for effect, _ in self.hooks]
        self.name = "+".join([base.name, *(effect.name for effect in effects)])
        self.title = " with ".join(
            [base.title or base.name, ", ".join(effect.title or effect.name for effect in effects)]
        )
        self.parameters = base.parameters + tuple(p for effect in effects for p in effect.parameters)
        self.states = base.states + tuple(state for effect in effects for state in effect.states)
        self.inputs, self.outputs, self.conditions = base.inputs, base.outputs, base.conditions
        self.procedures, self.baseline, self.stages = base.procedures, base.baseline, base.stages

    def equations(self, s: Symbols) -> Equations:
        """The base model's equations; the effects act through the symbols."""
        return self.base.equations(s)


def quantity_names(model: Model) -> tuple[str, ...]:
    """Names that effects can act on: inputs, announced quantities and outputs of the model."""
    base = {
        item.name: ca.SX.sym(item.name)
        for group in (model.states, model.inputs, model.parameters, model.conditions)
        for item in group
    }
    symbols = Symbols(base)
    model.equations(symbols)
    inputs = tuple(channel.name for channel in model.inputs)
    return (*inputs, *symbols.quantities, *(channel.name for channel in model.outputs))


def with_effects(model: Model, *effects: Effect) -> Model:
    """The model extended by effects, each on the first of its targets that the model has.

    Raises
    ------
    InputError
        If the model has none of an effect's targets.
    """
    if not effects:
        return model
    if isinstance(model, ExtendedModel):
        return with_effects(model.base, *(effect for effect, _ in model.hooks), *effects)
    names = quantity_names(model)
    hooks = []
    for effect in effects:
        target = next((name for name in effect.on if name in names), None)
        if target is None:
            raise InputError.of(
                f"effect '{effect.name}'",
                f"acts on {' or '.join(effect.on)}, which model '{model.name}' does not have",
                did_you_mean(effect.on[0], names),
            )
        hooks.append((effect, target))
    return ExtendedModel(model, hooks)
