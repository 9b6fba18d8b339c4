"""The design space: candidate tests as grids, and the limits of the rig, from a TOML file."""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import product
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BeforeValidator, Field, ValidationError, field_validator, model_validator

from mofit.errors import InputError, did_you_mean
from mofit.runtime.toml import Strict, read_toml
from mofit.simulation.virtual_rig.plan import NEEDED, TestPlan, with_defaults
from mofit.units import Quantity

#: More candidates than this take minutes, and finer grids do not change the design.
MOST_CANDIDATES = 5000


class Grid(Strict):
    """Values from one to another: ``{ from = "0.25 Hz", to = "4 Hz", count = 9, spacing = "log" }``."""

    start: Quantity = Field(alias="from")
    stop: Quantity = Field(alias="to")
    count: int = Field(ge=1, le=200)
    spacing: str = Field("log", pattern="^(log|linear)$")

    @model_validator(mode="after")
    def _same_unit(self) -> Grid:
        (low, one), (high, other) = _split(self.start), _split(self.stop)
        if one != other:
            raise ValueError(f"'from' is in '{one or 'SI'}', 'to' in '{other or 'SI'}'")
        if self.spacing == "log" and not (low > 0 and high > 0):
            raise ValueError("a log grid needs 'from' and 'to' above 0")
        return self

    def values(self) -> list[Quantity]:
        """The values, to four digits."""
        (low, unit), (high, _) = _split(self.start), _split(self.stop)
        spaced = np.geomspace if self.spacing == "log" else np.linspace
        numbers = [float(f"{value:.4g}") for value in spaced(low, high, self.count)]
        return [f"{number:g} {unit}" if unit else number for number in numbers]


def _listed(value: Any) -> Any:
    """A value, a list or a grid as a list."""
    if not isinstance(value, dict):
        return value if isinstance(value, list) else [value]
    try:
        return Grid.model_validate(value).values()
    except ValidationError as error:
        issues = "; ".join(f"{'.'.join(map(str, e['loc']))}: {e['msg']}".lstrip(": ") for e in error.errors())
        raise ValueError(f"no grid {{ from, to, count, spacing }}: {issues}") from None


Choices = Annotated[list[Quantity], BeforeValidator(_listed), Field(min_length=1)]


class CandidateGrid(Strict):
    """Tests of one kind; every key but ``kind`` holds a value, a list or a grid, in all combinations.

    ``lines`` is a list of harmonics, or a list of such lists.
    """

    kind: str
    sample_rate: Choices
    amplitude: Choices
    frequency: Choices | None = None
    last_frequency: Choices | None = None
    lines: Annotated[list[list[int]], BeforeValidator(lambda v: v if v and isinstance(v[0], list) else [v])] | None = (
        None
    )
    periods: Annotated[list[float], BeforeValidator(_listed)] | None = None
    duration: Choices | None = None
    ramp_rate: Choices | None = None
    delay: Choices | None = None
    conditions: dict[str, Choices] = Field(default_factory=dict)

    @field_validator("kind")
    @classmethod
    def _known(cls, kind: str) -> str:
        if kind not in NEEDED:
            raise ValueError(f"unknown kind '{kind}'. {did_you_mean(kind, NEEDED)}")
        return kind

    @model_validator(mode="after")
    def _keys_of_the_kind(self) -> CandidateGrid:
        if self.size > MOST_CANDIDATES:
            raise ValueError(f"{self.size} combinations; at most {MOST_CANDIDATES}. Make the grids coarser")
        TestPlan.model_validate({"name": "first", **next(iter(self.entries()))})
        return self

    def _axes(self) -> dict[tuple[str, str], list[Any]]:
        """Choices by key and name of a condition."""
        own = {(key, ""): getattr(self, key) for key in type(self).model_fields if key not in ("kind", "conditions")}
        conditions = {("conditions", name): values for name, values in self.conditions.items()}
        return {key: values for key, values in {**own, **conditions}.items() if values is not None}

    @property
    def size(self) -> int:
        """Number of combinations."""
        return math.prod(len(values) for values in self._axes().values())

    def entries(self) -> list[dict[str, Any]]:
        """All combinations, as entries of a plan without names."""
        found = []
        for values in product(*self._axes().values()):
            chosen = dict(zip(self._axes(), values, strict=True))
            conditions = {name: value for (key, name), value in chosen.items() if key == "conditions"}
            own = {key: value for (key, _), value in chosen.items() if key != "conditions"}
            found.append({"kind": self.kind, **own, "conditions": conditions})
        return found


class Limits(Strict):
    """What the rig can do at most; what is left out is not limited.

    ``amplitude``, ``rate`` and ``acceleration`` are those of the driven input and its time derivatives (ramps are
    limited by their rate alone), ``outputs`` the largest magnitudes of outputs as the model predicts them.
    """

    amplitude: Quantity | None = None
    rate: Quantity | None = None
    acceleration: Quantity | None = None
    sample_rate: Quantity | None = None
    duration: Quantity | None = None
    outputs: dict[str, Quantity] = Field(default_factory=dict)


class Space(Strict):
    """A design space. ``overhead`` is the rig's time per test beside its duration (mounting, pause) [s]."""

    overhead: Quantity = 0.0
    limits: Limits = Field(default_factory=Limits)
    tests: tuple[CandidateGrid, ...] = Field(min_length=1)

    def plans(self) -> tuple[TestPlan, ...]:
        """Every candidate once, named after what it does.

        Raises
        ------
        InputError
            If there are more than `MOST_CANDIDATES`.
        """
        size = sum(grid.size for grid in self.tests)
        if size > MOST_CANDIDATES:
            raise InputError.of("space", f"{size} candidates; at most {MOST_CANDIDATES}", "Make the grids coarser")
        named: dict[str, dict[str, Any]] = {}
        for entry in (entry for grid in self.tests for entry in grid.entries()):
            name = _name(entry)
            if name in named and named[name] != entry:
                name = f"{name}_{len(named)}"  # they differ in what names leave out: sampling, delay
            named[name] = entry
        return tuple(TestPlan.model_validate({"name": name, **entry}) for name, entry in named.items())


def read_space(path: Path) -> Space:
    """Read a space file and check its keys.

    Raises
    ------
    InputError
        With every issue: no file, no TOML, unknown or missing keys, values of the wrong kind.
    """
    return read_toml(path, "space", Space, "docs/design.md", with_defaults)


def _split(value: Quantity) -> tuple[float, str]:
    """Number and unit of a quantity."""
    if not isinstance(value, str):
        return float(value), ""
    number, _, unit = value.strip().partition(" ")
    try:
        return float(number), unit.strip()
    except ValueError:
        raise ValueError(f"'{value}' is no number with a unit, like '2 deg'") from None


_NAMED = ("frequency", "last_frequency", "lines", "amplitude", "ramp_rate", "periods", "duration")


def _name(entry: Mapping[str, Any]) -> str:
    """``sine_0_4Hz_2deg_60s``: kind and settings, fit for a file."""
    parts = [entry["kind"]]
    for key in _NAMED:
        if key in entry:
            value = entry[key]
            shown = {"lines": lambda v: "l" + "-".join(map(str, v)), "periods": lambda v: f"{v:g}periods"}
            parts.append(shown.get(key, str)(value))
    parts += map(str, entry["conditions"].values())
    return "_".join("".join(_plain(c) for c in part) for part in parts)


def _plain(c: str) -> str:
    return c if c.isalnum() or c in "-_" else {".": "_"}.get(c, "")
