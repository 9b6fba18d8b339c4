"""What models and effects declare, and what they return."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import casadi as ca

#: unit of an effect's parameter or state that has the unit of what the effect acts on
TARGET_UNIT = "unit of the target"


@dataclass(frozen=True)
class Channel:
    """A signal over time: an input, an output or a state, in its SI unit.

    ``derivative_of`` names the input whose time derivative this one is. A smoothing spline of that channel gives it,
    never raw differences.
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


#: what every test has by its time axis
TIME = Channel("time", "s", "time since the first sample")
SAMPLE_INTERVAL = Condition("sample_interval", "s", 0.01, "sampling interval")


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
    """A spring and a damper in series, named by their parameters.

    Parameters
    ----------
    stiffness, damping
        Names of the branch's parameters.
    parallel
        Names of the stiffness and the damping in parallel with the branch.
    part
        What spring, damper and branch form together.
    """

    stiffness: str
    damping: str
    parallel: tuple[str, str]
    part: str


@dataclass(frozen=True)
class Equations:
    """Right-hand side of a model.

    Parameters
    ----------
    outputs
        Expression per output channel.
    derivatives
        Time derivative per state.
    initial
        Initial value per state as an expression of inputs (their first sample), parameters and
        conditions; states not named start at 0.
    """

    outputs: Mapping[str, ca.SX]
    derivatives: Mapping[str, ca.SX] = field(default_factory=dict)
    initial: Mapping[str, ca.SX] = field(default_factory=dict)


@dataclass(frozen=True)
class Applied:
    """A quantity with an effect.

    Parameters
    ----------
    value
        The quantity.
    derivatives, initial
        Time derivatives and initial values of the effect's own states.
    inputs
        Inputs that change along with an input (its derivative, say).
    """

    value: ca.SX
    derivatives: Mapping[str, ca.SX] = field(default_factory=dict)
    initial: Mapping[str, ca.SX] = field(default_factory=dict)
    inputs: Mapping[str, ca.SX] = field(default_factory=dict)
