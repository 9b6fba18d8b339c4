"""The closed list of what a model states about itself."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import casadi as ca

from mofit.parameters import Parameter

if TYPE_CHECKING:
    from mofit.model.symbols import Symbols


@dataclass(frozen=True)
class Channel:
    """A signal over time: an input, an output or a state, in its SI unit.

    ``derivative_of`` names the input whose time derivative this one is; it is then computed from
    that channel (smoothing spline), never taken as raw differences.
    """

    name: str
    unit: str
    description: str = ""
    derivative_of: str | None = None


@dataclass(frozen=True)
class Condition:
    """A constant of a test (load, speed …). Without a ``default`` the campaign must give it."""

    name: str
    unit: str
    default: float | None = None
    description: str = ""


@dataclass(frozen=True)
class Stage:
    """A calibration before the main identification: ``model`` is fitted to tests of these kinds.

    The parameters of the stage's model are parameters of the main model too; their posterior
    enters the main identification as a prior. ``settled`` limits the fit to samples after the
    transient of each test.
    """

    name: str
    model: str
    procedures: tuple[str, ...]
    settled: bool = False


@dataclass(frozen=True)
class Equations:
    """Right-hand side of a model.

    Parameters
    ----------
    outputs
        Expression per output channel.
    rates
        Time derivative per state.
    initial
        Initial value per state as an expression of inputs (their first sample), parameters and
        conditions; states not named start at 0.
    """

    outputs: Mapping[str, ca.SX]
    rates: Mapping[str, ca.SX] = field(default_factory=dict)
    initial: Mapping[str, ca.SX] = field(default_factory=dict)


class Model(ABC):
    """A dynamic model, written once in CasADi; everything else is derived from it.

    A subclass sets the class attributes and writes `equations`. Quantities which effects may act
    on are announced by ``s.quantity(name, expression)``; inputs and outputs always are.

    Examples
    --------
    >>> class Spring(Model):
    ...     name = "spring"
    ...     parameters = (Parameter("k", "N/m", 1.0, 1e6, 1e3, "log"),)
    ...     inputs = (Channel("displacement", "m"),)
    ...     outputs = (Channel("force", "N"),)
    ...
    ...     def equations(self, s):
    ...         return Equations(outputs={"force": s.quantity("spring_force", s.k * s.displacement)})
    """

    name: str
    title: str = ""
    parameters: tuple[Parameter, ...] = ()
    states: tuple[Channel, ...] = ()
    inputs: tuple[Channel, ...] = ()
    outputs: tuple[Channel, ...] = ()
    conditions: tuple[Condition, ...] = ()
    #: kinds of procedure that the main identification uses; empty: all
    procedures: tuple[str, ...] = ()
    #: name of the shipped model that every report compares with
    baseline: str | None = None
    stages: tuple[Stage, ...] = ()

    @abstractmethod
    def equations(self, s: Symbols) -> Equations:
        """Rates, outputs and initial values from the symbols ``s``."""
