"""A model extension with its own parameters and states."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import casadi as ca

from mofit.model.model import Channel
from mofit.parameters import Parameter

if TYPE_CHECKING:
    from mofit.model.symbols import Symbols


@dataclass(frozen=True)
class Applied:
    """What an effect makes of a quantity, and the rates and initial values of its own states."""

    value: ca.SX
    rates: Mapping[str, ca.SX] = field(default_factory=dict)
    initial: Mapping[str, ca.SX] = field(default_factory=dict)


class Effect(ABC):
    """Something a model leaves out; acts on one named quantity, input or output.

    At the neutral value of its parameters the model is unchanged.

    Attributes
    ----------
    on
        Names that the effect can act on, in order of preference; the first that the model has is
        taken.
    """

    name: str
    title: str = ""
    on: tuple[str, ...]
    parameters: tuple[Parameter, ...] = ()
    states: tuple[Channel, ...] = ()

    @abstractmethod
    def apply(self, s: Symbols, value: ca.SX) -> Applied:
        """The quantity with the effect, from its ``value`` without."""
