"""A model extension with its own parameters and states."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import product
from typing import TYPE_CHECKING

import casadi as ca

from mofit.errors import Fault
from mofit.model.model import Channel, Condition
from mofit.parameters import Parameter

if TYPE_CHECKING:
    from mofit.model.symbols import Symbols

#: unit of a parameter that is measured in the unit of whatever channel the effect acts on
UNIT_OF_TARGET = "unit of the channel"


@dataclass(frozen=True)
class Applied:
    """What an effect makes of a quantity, and the rates and initial values of its own states.

    ``also`` holds inputs that change along with an input (its derivative, say), by name.
    """

    value: ca.SX
    rates: Mapping[str, ca.SX] = field(default_factory=dict)
    initial: Mapping[str, ca.SX] = field(default_factory=dict)
    also: Mapping[str, ca.SX] = field(default_factory=dict)


class Effect(ABC):
    """Something a model leaves out; acts on one named quantity, input, output, parameter or condition.

    At the neutral value of its parameters the model is unchanged. Those parameters are the effect's *size*; the
    others (time constants, exponents, yield lengths) mean nothing without it, and state a grid of values to try.

    Attributes
    ----------
    on
        Names that the effect can act on, in order of preference; the first that the model has is
        taken. ``"output"`` stands for the model's first output.
    needs
        Names of the model that `apply` reads beside it; ``"one or another"`` where either will do.
    parameters, states
        The effect's own.
    inputs, conditions
        What it needs of a test beside the model's. Every test has the input ``time`` (s, since its first sample) and
        the conditions ``start_time`` (s, since the campaign began; where the file states it) and ``sample_interval``.
    candidate
        False for an effect that is taken into account only when asked for by name.
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
        """The size to expect, in the unit of its parameters: their nominal values' distance from neutral."""
        return math.hypot(*(p.nominal - p.neutral for p in self.parameters if p.neutral is not None))

    @property
    def neutral(self) -> dict[str, float]:
        """Values at which the model is unchanged; nominal for what is not part of the size."""
        return {p.name: p.nominal if p.neutral is None else p.neutral for p in self.parameters}

    @property
    def grid(self) -> dict[str, tuple[float, ...]]:
        """Values to try of every parameter that is not part of the size; its nominal one where it states none."""
        return {p.name: p.grid or (p.nominal,) for p in self.parameters if p.neutral is None}

    @property
    def grid_points(self) -> list[dict[str, float]]:
        """Every combination of the grid; one empty one where all parameters are part of the size."""
        return [dict(zip(self.grid, point, strict=True)) for point in product(*self.grid.values())]

    def faults(self) -> list[Fault]:
        """What the effect's author should mend."""
        where = f"effect '{getattr(self, 'name', '') or type(self).__name__}'"
        found = [
            Fault(where, f"has no '{attribute}'", f"Set the class attribute '{attribute}'")
            for attribute in ("name", "on")
            if not getattr(self, attribute, None)
        ]
        if isinstance(getattr(self, "on", ()), str):
            found.append(Fault(where, "'on' is one text", "Write a tuple of names: on = ('lateral_force',)"))
        if not self.size:
            found.append(Fault(where, "no parameter has a neutral value", "Give its size one: Parameter(…, neutral=0)"))
        return found + [
            Fault(f"{where}, {fault.where}", fault.what, fault.cure) for p in self.parameters for fault in p.faults()
        ]
