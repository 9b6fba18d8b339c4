"""All that a model states about itself."""

from __future__ import annotations

from abc import ABC, abstractmethod

from mofit.models.declarations import Channel, Condition, Equations, MaxwellBranch, Stage
from mofit.models.symbols import Symbols
from mofit.parameters import Parameter


class Model(ABC):
    """A dynamic model, written once in CasADi; simulation and sensitivities follow from it.

    A subclass sets the class attributes and writes `equations`. It announces each quantity that effects may act on with
    ``s.quantity(name, expression)``; inputs, outputs, parameters and conditions need no announcement.

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
    #: excitation types of the tests that the main identification uses; empty: all
    excitations: tuple[str, ...] = ()
    #: name of the shipped model that reports compare this one with
    baseline: str | None = None
    #: calibrations before the main identification
    stages: tuple[Stage, ...] = ()
    #: Maxwell branches among the parameters; a comparison of experiments draws their moduli
    branches: tuple[MaxwellBranch, ...] = ()
    #: whether a campaign with its channels takes this model where none is named
    default: bool = False

    @abstractmethod
    def equations(self, s: Symbols) -> Equations:
        """State derivatives, outputs and initial values from the symbols ``s``."""
