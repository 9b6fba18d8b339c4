"""What a family of systems declares: the truth in numpy, the model as a user writes it, and what may go wrong with it.

The two are written apart: ``rates`` and ``response`` are numpy, ``text`` is the source of a model file.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

#: Value and time derivative of the input: numbers in ``rates``, arrays in ``response``.
Drive = tuple[Any, Any]
Values = Mapping[str, float]


@dataclass(frozen=True)
class Draw:
    """A system of a family, drawn at random, in SI units."""

    values: dict[str, float]
    """Truth of the model's parameters."""
    rate: float
    """Characteristic angular frequency, rad/s."""
    amplitude: float
    """Of the input."""
    bias: float = 0.0
    """Mean of the input."""
    scales: tuple[float, ...] = ()
    """Typical size of every state of the truth, for the integrator's tolerance."""
    constants: dict[str, float] = field(default_factory=dict)
    """Known numbers that the model file states."""
    extras: dict[str, float] = field(default_factory=dict)
    """First strength of every flaw; the truth takes 0 where the system does not have it."""
    boxes: dict[str, float] = field(default_factory=dict)
    """Half the width of the box of a parameter that may be negative."""


@dataclass(frozen=True)
class Split:
    """A ridge: a parameter becomes two that act only as their sum or product."""

    of: str
    how: str

    @property
    def label(self) -> str:
        """A few words for the table."""
        return f"{self.of} is a {self.how} of two"

    @property
    def tied(self) -> tuple[str, ...]:
        """Parameters that the data cannot tell."""
        return (f"{self.of}_a", f"{self.of}_b")

    @property
    def sign(self) -> str:
        """Operator in the model file."""
        return "+" if self.how == "sum" else "*"


@dataclass(frozen=True)
class Loose:
    """A ridge: known constants become parameters, the excitation leaves one untouched, or an output is missing."""

    label: str
    tied: tuple[str, ...]
    free: tuple[str, ...] = ()
    """Constants that become parameters."""
    constants: dict[str, float] = field(default_factory=dict)
    """Constants with another value."""
    change: Callable[[Draw], Draw] = lambda draw: draw
    """Another draw, of a smaller amplitude, say."""
    outputs: tuple[str, ...] = ()
    """Outputs that are left; all where empty."""


@dataclass(frozen=True)
class Family:
    """A kind of system."""

    name: str
    title: str
    units: Mapping[str, str]
    """Unit of every parameter and constant."""
    inputs: tuple[tuple[str, str], ...]
    """Name and unit; a second one is the time derivative of the first."""
    outputs: tuple[tuple[str, str], ...]
    states: tuple[tuple[str, str], ...]
    """States of the model; the truth may have more."""
    text: Mapping[str, str]
    """Source of the derivative of every state and of every output."""
    draw: Callable[[np.random.Generator], Draw]
    response: Callable[[Values, Any, Drive], Sequence[Any]]
    """Outputs of the truth from its values, states and drive."""
    rates: Callable[[Values, Any, Drive], Sequence[Any]] | None = None
    """Derivatives of the truth's states; None: it has none."""
    start: Mapping[str, str] = field(default_factory=dict)
    """Source of initial values; 0 where left out."""
    begin: Callable[[Values], Sequence[float]] | None = None
    """Initial states of the truth; 0 where left out."""
    flaws: Mapping[str, str] = field(default_factory=dict)
    """What a wrong model leaves out, in words, and the extra of the draw that brings it into the truth."""
    ridges: tuple[Split | Loose, ...] = ()
    stepped: bool = True
    """Whether a step makes sense; not where the model needs the rate of the input."""


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """A number whose logarithm is uniform."""
    return float(low * (high / low) ** rng.random())


def weaker(draw: Draw, factor: float) -> Draw:
    """The draw with a smaller input."""
    scales = tuple(factor * size for size in draw.scales)
    return replace(draw, amplitude=factor * draw.amplitude, scales=scales)
