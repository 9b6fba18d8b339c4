"""A model extension with its own parameters and states."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from itertools import product

import casadi as ca

from mofit.errors import Issue
from mofit.models.declarations import Applied, Channel, Condition
from mofit.models.symbols import Symbols
from mofit.parameters import Parameter


class Effect(ABC):
    """A model extension: it acts on one named quantity, input, output, parameter or condition.

    Parameters with a neutral value are the effect's *size*; at neutral the model is unchanged. All others (time
    constants, exponents, yield lengths) have no meaning without it, and state a grid of values to try.

    Attributes
    ----------
    on
        Names of possible targets; the effect acts on the first that the model has. ``"output"`` means the model's
        first output.
    needs
        Names of the model that `apply` reads beside the target; ``"one or another"`` where either will do.
    parameters, states
        The effect's own. The unit `TARGET_UNIT` means that of the target.
    inputs, conditions
        What it reads of a test beside the model's. Every test has the input ``time`` (s, since its first sample) and
        the condition ``sample_interval`` (s); with ``start_time`` (s, since the campaign began) where the file states
        it.
    candidate
        False for an effect that a diagnosis tries only when it is named.
    """

    name: str
    title: str = ""
    on: tuple[str, ...]
    needs: tuple[str, ...] = ()
    parameters: tuple[Parameter, ...] = ()
    states: tuple[Channel, ...] = ()
    inputs: tuple[Channel, ...] = ()
    conditions: tuple[Condition, ...] = ()
    candidate: bool = True

    @abstractmethod
    def apply(self, s: Symbols, value: ca.SX) -> Applied:
        """The quantity with the effect, from its ``value`` without."""

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
        """Values to try of every parameter beside the size; the nominal one where it states none."""
        return {p.name: p.grid or (p.nominal,) for p in self.parameters if p.neutral is None}

    @property
    def grid_points(self) -> list[dict[str, float]]:
        """Every combination of the grid; one that is empty where all parameters are size."""
        return [dict(zip(self.grid, point, strict=True)) for point in product(*self.grid.values())]

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
