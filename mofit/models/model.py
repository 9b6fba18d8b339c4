"""A model: what it declares, the symbols that its equations are written in, and what they return."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TypeAlias

import casadi as ca

from mofit.errors import InputError, did_you_mean
from mofit.parameters import Parameter

#: unit of an effect's parameter or state that has the unit of what the effect acts on
TARGET_UNIT = "unit of the target"


@dataclass(frozen=True)
class Channel:
    """A signal over time: an input, an output or a state, in its SI unit.

    ``derivative_of`` names the input whose time derivative this one is; that may be a derivative itself. A smoothing
    spline of the measured channel gives both, never raw differences.
    """

    name: str
    unit: str
    description: str = ""
    derivative_of: str | None = None


def derivations(channels: Iterable[Channel]) -> dict[str, tuple[str, int]]:
    """Of every channel the measured one that it follows from, and how often that is differentiated: itself and 0."""
    parents = {channel.name: channel.derivative_of for channel in channels}
    found = {}
    for name in parents:
        chain = [name]
        # one that is said to be its own derivative ends the chain
        while (parent := parents.get(chain[-1])) is not None and parent not in chain:
            chain.append(parent)
        found[name] = chain[-1], len(chain) - 1
    return found


@dataclass(frozen=True)
class Condition:
    """A constant of a test (load, speed …). Without a ``default`` the campaign must give it."""

    name: str
    unit: str
    default: float | None = None
    description: str = ""


#: what every test has by its time axis
TIME = Channel("time", "s", "time since the first sample")
SAMPLE_INTERVAL = Condition("sample_interval", "s", 0.01, "sampling interval")
RECORD_LENGTH = Condition("record_length", "s", 10.0, "time from the first to the last sample")


@dataclass(frozen=True)
class Stage:
    """A calibration before the main identification: ``model`` is fitted to tests with these excitation types.

    The parameters of the stage's model are parameters of the main model, too. Their posterior is the prior of the main
    identification. ``settled`` limits the fit to the steady state of each test.
    """

    name: str
    title: str
    model: str
    excitations: tuple[str, ...]
    settled: bool = False


@dataclass(frozen=True)
class MaxwellBranch:
    """A spring and a damper in series, named by their parameters."""

    stiffness: str
    damping: str
    """Names of the branch's parameters."""
    parallel: tuple[str, str]
    """Names of the stiffness and the damping in parallel with the branch."""
    part: str
    """What spring, damper and branch form together."""


@dataclass(frozen=True)
class Equations:
    """Right-hand side of a model."""

    outputs: Mapping[str, ca.SX]
    """Expression per output channel."""
    derivatives: Mapping[str, ca.SX] = field(default_factory=dict)
    """Time derivative per state."""
    initial: Mapping[str, ca.SX] = field(default_factory=dict)
    """Initial value per state as an expression of inputs (their first sample), parameters and conditions; states not
    named start at 0."""


@dataclass(frozen=True)
class Applied:
    """A quantity with an effect."""

    value: ca.SX
    derivatives: Mapping[str, ca.SX] = field(default_factory=dict)
    initial: Mapping[str, ca.SX] = field(default_factory=dict)
    """Time derivatives and initial values of the effect's own states."""
    inputs: Mapping[str, ca.SX] = field(default_factory=dict)
    """Inputs that change along with an input (its derivative, say)."""


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
    rates
        Of an input the one that is its time derivative.
    """

    def __init__(
        self,
        base: Mapping[str, ca.SX],
        inputs: Sequence[str] = (),
        effects: Sequence[tuple[Apply, str]] = (),
        rates: Mapping[str, str] = MappingProxyType({}),
    ) -> None:
        self._values = dict(base)
        self._pending = {*inputs, *(target for _, target in effects if target in base)}
        self._effects, self._rates = tuple(effects), dict(rates)
        #: the input that is the time derivative of the quantity that an effect acts on now; None if there is none
        self.target_rate: str | None = None
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
            # first the input that it is the rate of: an effect on that changes both
            for source in (source for source, rate in self._rates.items() if rate == name and source in values):
                getattr(self, source)
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
                self.target_rate = self._rates.get(name)
                applied = apply(self, value)
                value = applied.value
                self.derivatives.update(applied.derivatives)
                self.initial.update(applied.initial)
                self._values.update(applied.inputs)
        self.quantities[name] = value
        return value

    def define(self, name: str, value: ca.SX) -> None:
        """Announce a quantity that equations read as ``s.NAME``: a parameter at the conditions of the test, say."""
        self._values[name] = self.quantity(name, value)

    @property
    def unannounced(self) -> list[str]:
        """Quantities that an effect acts on and that no equation announced, sorted."""
        return sorted({target for _, target in self._effects} - set(self.quantities))


#: ``Effect.apply``: symbols and a quantity in, the quantity with the effect out
Apply: TypeAlias = Callable[[Symbols, ca.SX], Applied]


class Model(ABC):
    """A dynamic model, written once in CasADi; simulation and sensitivities follow from it.

    A subclass sets the class attributes and writes `equations`. It announces each quantity that effects may act on with
    ``s.quantity(name, expression)``; inputs, outputs, parameters and conditions need no announcement. A model without
    inputs is one of free decays.

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
    #: peak-to-peak range of channels, and the sampling interval (``sample_interval``), for which the parameters'
    #: ranges are written; they are scaled to those of a campaign as `Parameter.scales` says. The scale of ``time``
    #: (`mofit.simulation.ranges.data_scales`) every model has
    typical: Mapping[str, float] = MappingProxyType({})

    def __init_subclass__(cls) -> None:
        """Of a model that nothing drives, time is the input."""
        super().__init_subclass__()
        cls.inputs = cls.inputs or (TIME,)

    @property
    def dynamic(self) -> bool:
        """Whether outputs depend on the past of the inputs."""
        return bool(self.states)

    @abstractmethod
    def equations(self, s: Symbols) -> Equations:
        """State derivatives, outputs and initial values from the symbols ``s``."""
