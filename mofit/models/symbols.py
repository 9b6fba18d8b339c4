"""The symbols that equations are written in."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TypeAlias

import casadi as ca

from mofit.errors import InputError, did_you_mean
from mofit.models.declarations import Applied


class Symbols:
    """Parameters, states, inputs and conditions by name: ``s.c_y`` is a CasADi SX scalar.

    Parameters
    ----------
    base
        Plain symbol of every name.
    inputs
        Names of the inputs. Effects act on inputs, parameters and conditions at first use.
    effects
        Functions of the symbols and a quantity (`Effect.apply`), each with the name of the quantity that it acts on.
        They act in this order.
    """

    def __init__(
        self,
        base: Mapping[str, ca.SX],
        inputs: Sequence[str] = (),
        effects: Sequence[tuple[Apply, str]] = (),
    ) -> None:
        self._values = dict(base)
        self._pending = {*inputs, *(target for _, target in effects if target in base)}
        self._effects = tuple(effects)
        #: derivatives and initial values of the effects' states, filled as quantities are announced
        self.derivatives: dict[str, ca.SX] = {}
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
        """Announce a named quantity; returns it with every effect that acts on it."""
        for apply, target in self._effects:
            if target == name:
                applied = apply(self, value)
                value = applied.value
                self.derivatives.update(applied.derivatives)
                self.initial.update(applied.initial)
                self._values.update(applied.inputs)
        self.quantities[name] = value
        return value

    @property
    def unannounced(self) -> list[str]:
        """Quantities that an effect acts on and that no equation announced, sorted."""
        return sorted({target for _, target in self._effects} - set(self.quantities))


#: ``Effect.apply``: symbols and a quantity in, the quantity with the effect out
Apply: TypeAlias = Callable[[Symbols, ca.SX], Applied]
