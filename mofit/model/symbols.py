"""The symbols that equations are written in, with the effects hooked onto their quantities."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import casadi as ca

from mofit.errors import InputError, did_you_mean

if TYPE_CHECKING:
    from mofit.model.effect import Effect


class Symbols:
    """Parameters, states, inputs and conditions by name: ``s.c_y`` is a CasADi SX scalar.

    Parameters
    ----------
    base
        Plain symbol of every name.
    effects
        ``(effect, target)`` pairs: each acts on the quantity of that name, in order.
    inputs
        Names of the inputs; effects act on them at first use, as they do on parameters and conditions.
    """

    def __init__(
        self,
        base: dict[str, ca.SX],
        inputs: Sequence[str] = (),
        effects: Sequence[tuple[Effect, str]] = (),
    ) -> None:
        self._values = dict(base)
        self._pending = {*inputs, *(target for _, target in effects if target in base)}
        self._effects = tuple(effects)
        #: rates and initial values of the effects' states, filled as quantities are announced
        self.rates: dict[str, ca.SX] = {}
        self.initial: dict[str, ca.SX] = {}
        #: every announced quantity, effects included
        self.quantities: dict[str, ca.SX] = {}

    def __getattr__(self, name: str) -> ca.SX:
        values = self.__dict__.get("_values", {})
        if name not in values:
            raise InputError.of(f"equations: s.{name}", "the model declares no such name", did_you_mean(name, values))
        if name in self._pending:
            self._pending.remove(name)
            values[name] = self.quantity(name, values[name])
        return values[name]

    def __contains__(self, name: str) -> bool:
        return name in self._values

    def quantity(self, name: str, value: ca.SX) -> ca.SX:
        """Announce a named quantity; returns it with every effect that acts on it applied."""
        for effect, target in self._effects:
            if target == name:
                applied = effect.apply(self, value)
                value = applied.value
                self.rates.update(applied.rates)
                self.initial.update(applied.initial)
                self._values.update(applied.also)
        self.quantities[name] = value
        return value
