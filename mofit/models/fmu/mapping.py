"""Which variables of an FMU are which channels, conditions and parameters: the map file, and what it means."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from pydantic import Field

from mofit.errors import InputError
from mofit.runtime.toml import Strict, read_toml

#: Relative rounding of a sampling interval.
_ROUNDING = 1e-6


class ChannelEntry(Strict):
    """A variable of the FMU behind a channel or a condition; its unit where the FMU declares none."""

    variable: str
    unit: str | None = None
    derivative_of: str | None = None


class ParameterEntry(Strict):
    """A variable of the FMU behind a parameter; ``lower`` and ``upper`` bound its search, in SI units."""

    variable: str
    unit: str | None = None
    lower: float | None = None
    upper: float | None = None
    scale: Literal["linear", "log"] | None = None


class FmuMap(Strict):
    """A whole map. What a table lists is all that is used of its kind; without the table, names are the FMU's."""

    inputs: dict[str, str | ChannelEntry] | None = None
    outputs: dict[str, str | ChannelEntry] | None = None
    conditions: dict[str, str | ChannelEntry] = Field(default_factory=dict)
    parameters: dict[str, str | ParameterEntry] = Field(default_factory=dict)
    values: dict[str, float] = Field(default_factory=dict)
    """Values of other parameters of the FMU, in its units."""
    interface: Literal["model exchange", "co-simulation"] | None = None
    steps: int | None = Field(default=None, ge=1, le=10_000)
    """Communication steps per sample of a co-simulation."""
    tolerance: float = Field(default=1e-8, gt=0, lt=1)
    """Relative tolerance of the integration."""


def read_map(path: Path) -> FmuMap:
    """Read and check a map file.

    Raises
    ------
    InputError
        With every issue: no TOML, unknown keys, values of the wrong kind.
    """
    return read_toml(path, "map", FmuMap, "docs/fmu.md", lambda defaults, test: test)


@dataclass(frozen=True)
class Port:
    """A variable of the FMU under mofit's name; ``value in SI = factor * value + offset``."""

    name: str
    variable: str
    reference: int
    factor: float = 1.0
    offset: float = 0.0

    def to_si(self, values: Any) -> Any:
        """Values of the FMU in SI units."""
        return self.factor * values + self.offset

    def from_si(self, values: Any) -> Any:
        """Values in SI units as the FMU takes them."""
        return (values - self.offset) / self.factor


@dataclass(frozen=True)
class FmuMapping:
    """All that decides how an FMU is simulated, beside the FMU."""

    interface: str
    inputs: tuple[Port, ...] = ()
    outputs: tuple[Port, ...] = ()
    conditions: tuple[Port, ...] = ()
    parameters: tuple[Port, ...] = ()
    values: tuple[tuple[str, int, float], ...] = field(default=())
    """Name, reference and value of parameters that are set once, in the FMU's units."""
    steps: int = 1
    """Communication steps per sample."""
    fixed_step: float | None = None
    """The only communication step that the FMU takes, s; then ``steps`` follow from it."""
    tolerance: float = 1e-8

    def steps_in(self, interval: float) -> int:
        """Communication steps in a sampling interval, s.

        Raises
        ------
        InputError
            If the interval is no multiple of the only step that the FMU takes.
        """
        if self.fixed_step is None:
            return self.steps
        ratio = interval / self.fixed_step
        steps = max(1, round(ratio))
        if abs(ratio - steps) > _ROUNDING * steps:
            message = (
                f"the sampling interval {interval:g} s is no multiple of the FMU's fixed step {self.fixed_step:g} s"
            )
            raise InputError.of("FMU", message, "Resample the records, or export the FMU with another step")
        return steps
