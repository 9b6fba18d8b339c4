"""Effects: what a model may leave out."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping
from itertools import product

import casadi as ca

from mofit.errors import Issue
from mofit.models.model import Applied, Channel, Condition, Symbols
from mofit.parameters import PER_CAMPAIGN, Parameter

#: Family of effects by which only what the calibration stages told is wrong.
CALIBRATION_ERROR = "calibration error"


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
    refines
        Name of a plainer law with as many parameters: where the data hardly tell the two apart, that one is meant.
    abrupt
        True where outputs change out of proportion to a small size, so that their slope at neutral says little.
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
    refines: str = ""
    abrupt: bool = False
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
