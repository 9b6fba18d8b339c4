"""An effect by other names of its parameters and states, where a model has some of these names."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace
from typing import Any

import casadi as ca

from mofit.models.effect import Effect
from mofit.models.model import Applied, Symbols


def with_own_names(effect: Effect, taken: Collection[str]) -> Effect:
    """The effect, those of its parameters and states that bear a name that is taken being called EFFECT_NAME."""
    own = [item.name for group in (effect.parameters, effect.states) for item in group]
    names = {name: f"{effect.name}_{name}" for name in own if name in taken}
    return _ByOtherNames(effect, names) if names else effect


def as_written(effect: Effect) -> Effect:
    """The effect by the names of its author."""
    return effect.written if isinstance(effect, _ByOtherNames) else effect


class _ByOtherNames(Effect):
    """``written`` with some of its parameters and states named anew."""

    def __init__(self, written: Effect, names: Mapping[str, str]) -> None:
        self.written, self._names = written, dict(names)
        for attribute in ("name", "title", "family", "on", "needs", "unless", "inputs", "conditions"):
            setattr(self, attribute, getattr(written, attribute))
        for flag in ("candidate", "abrupt", "of_rig", "part_of_name"):
            setattr(self, flag, getattr(written, flag))
        self.parameters = tuple(replace(one, name=names.get(one.name, one.name)) for one in written.parameters)
        self.states = tuple(replace(one, name=names.get(one.name, one.name)) for one in written.states)

    def apply(self, s: Symbols, value: ca.SX) -> Applied:
        """What the effect as written does."""
        done = self.written.apply(_Renaming(s, self._names), value)
        rates, initial = self._renamed(done.derivatives), self._renamed(done.initial)
        return replace(done, derivatives=rates, initial=initial)

    def _renamed(self, found: Mapping[str, ca.SX]) -> dict[str, ca.SX]:
        return {self._names.get(name, name): value for name, value in found.items()}


class _Renaming(Symbols):
    """Symbols that an effect reads by the names of its author."""

    def __init__(self, symbols: Symbols, names: Mapping[str, str]) -> None:
        self._symbols, self._names = symbols, names

    def __getattribute__(self, name: str) -> Any:
        if name in ("_symbols", "_names", "__dict__", "__class__"):
            return object.__getattribute__(self, name)
        return getattr(self._symbols, self._names.get(name, name))

    def __contains__(self, name: str) -> bool:
        return self._names.get(name, name) in self._symbols
