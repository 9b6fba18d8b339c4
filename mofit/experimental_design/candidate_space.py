"""The design space: candidate tests as grids, from a TOML file or within what known tests demonstrate of the rig."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BeforeValidator, Field, ValidationError, field_validator, model_validator

from mofit.data import Experiment
from mofit.errors import InputError, did_you_mean
from mofit.experimental_design.candidates import Limits, demonstrated_limits, required_limits, shown_unit
from mofit.models import Channel
from mofit.runtime.toml import Strict, read_toml
from mofit.simulation.virtual_rig.plan import NEEDED, TestPlan, with_defaults
from mofit.units import Quantity

#: More candidates than this take minutes, and finer grids do not change the design.
MOST_CANDIDATES = 5000


@dataclass(frozen=True)
class DefaultSpaceSettings:
    """Grids of the space."""

    beyond: float = 2.5
    """Frequencies reach so far beyond the known ones, each way: a model is rarely trusted further."""
    frequencies: int = 15
    """Sine frequencies: neighbours differ by less than a parameter's optimum is wide."""
    amplitudes: tuple[float, ...] = (0.25, 0.5, 1.0)
    durations: tuple[float, ...] = (0.25, 0.5, 1.0)
    """Shares of the largest amplitude, and of the time there is."""
    periods: int = 3
    """Periods that a sine or multisine must have room for: one is transient, two are used."""
    samples_per_period: int = 20
    """At the highest frequency, so that the interpolated input is still a sine."""
    unknown: tuple[float, float] = (0.1, 10.0)
    """Frequencies where the known tests have none [Hz]."""


SETTINGS = DefaultSpaceSettings()


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
        TestPlan.model_validate({"name": "first", **next(self.entries())})
        return self

    def _choices(self) -> dict[str, list[Any]]:
        """Choices by key, without those of the conditions."""
        own = {key: getattr(self, key) for key in type(self).model_fields if key not in ("kind", "conditions")}
        return {key: values for key, values in own.items() if values is not None}

    @property
    def size(self) -> int:
        """Number of combinations."""
        return math.prod(len(values) for values in (*self._choices().values(), *self.conditions.values()))

    def entries(self) -> Iterator[dict[str, Any]]:
        """All combinations, as entries of a plan without names."""
        own = self._choices()
        for values in product(*own.values(), *self.conditions.values()):
            conditions = dict(zip(self.conditions, values[len(own) :], strict=True))
            yield {"kind": self.kind, **dict(zip(own, values[: len(own)], strict=True)), "conditions": conditions}


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


def _name(entry: Mapping[str, Any]) -> str:
    """``sine_0_4Hz_2deg_60s``: kind and settings, fit for a file."""
    parts = [entry["kind"]]
    for key in ("frequency", "last_frequency", "lines", "amplitude", "ramp_rate", "periods", "duration"):
        if key not in entry:
            continue
        if key == "lines":
            parts.append("l" + "-".join(map(str, entry[key])))
        else:
            parts.append(f"{entry[key]:g}periods" if key == "periods" else str(entry[key]))
    parts += map(str, entry["conditions"].values())
    return "_".join(re.sub(r"[^\w-]", "", part.replace(".", "_")) for part in parts)


def default_space(
    experiments: Sequence[Experiment],
    driven: Channel,
    kinds: Collection[str],
    budget: float,
    overhead: float,
    *,
    measured: bool = False,
    conditions: Mapping[str, Sequence[float]] | None = None,
) -> Space:
    """Tests of some kinds (sine, multisine, chirp, step) within what known tests demonstrate of the rig.

    Parameters
    ----------
    experiments, driven
        The known tests that excite the driven input, and that input.
    kinds
        Kinds of tests to offer.
    budget, overhead
        Time there is, and time per test beside its duration [s].
    measured
        Whether the inputs are measured, hence noisy.
    conditions
        Values of conditions, in SI units, to choose from in all combinations.
    """
    limits = demonstrated_limits([required_limits(experiment, driven.name, measured) for experiment in experiments])
    frequencies = [experiment.frequency for experiment in experiments if experiment.frequency] or SETTINGS.unknown
    time = max(budget - overhead, 1e-3)
    low = max(min(frequencies) / SETTINGS.beyond, SETTINGS.periods / time)
    high = min(max(frequencies) * SETTINGS.beyond, limits.sample_rate / SETTINGS.samples_per_period)
    high = max(high, 2 * low)
    unit, factor = shown_unit(driven.unit)
    largest, rate = f"{_short(limits.amplitude * factor)} {unit}", f"{_short(limits.rate * factor)} {unit}/s"
    acceleration = f"{_short(limits.acceleration * factor)} {unit}/s^2" if math.isfinite(limits.acceleration) else None
    amplitudes = [f"{_short(share * limits.amplitude * factor)} {unit}" for share in SETTINGS.amplitudes]
    durations = [f"{_short(share * time)} s" for share in SETTINGS.durations]
    grids: list[dict[str, Any]] = [
        {"kind": "sine", "frequency": _hertz(np.geomspace(low, high, SETTINGS.frequencies))},
        {
            "kind": "multisine",
            "frequency": _hertz(np.geomspace(low, max(high / 9, low), 4)),
            "lines": [[1, 2, 3, 4, 5], [1, 3, 9]],
        },
        {"kind": "chirp", "frequency": _hertz([low, math.sqrt(low * high)]), "last_frequency": _hertz([high])},
        {"kind": "step", "ramp_rate": rate},
    ]
    common: dict[str, Any] = {"sample_rate": f"{_short(limits.sample_rate)} Hz"}
    common |= {"amplitude": amplitudes, "duration": durations, "conditions": dict(conditions or {})}
    return Space(
        overhead=f"{_short(overhead)} s",
        limits=Limits(amplitude=largest, rate=rate, acceleration=acceleration),
        tests=tuple(CandidateGrid.model_validate({**common, **grid}) for grid in grids if grid["kind"] in kinds),
    )


def _short(value: float) -> str:
    return f"{float(f'{value:.4g}'):g}"


def _hertz(values: Sequence[float] | np.ndarray) -> list[str]:
    return [f"{_short(float(value))} Hz" for value in dict.fromkeys(map(float, values))]
