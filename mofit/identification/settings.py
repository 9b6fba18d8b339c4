"""Settings of an identification."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field

from mofit.errors import InputError, Issue, did_you_mean, raise_errors
from mofit.identification.search_registry import DEFAULT_SEARCH
from mofit.models import Model
from mofit.parameters import ParameterSpace
from mofit.sampling import SampleSettings


@dataclass(frozen=True)
class Settings:
    """What decides an identification's numbers, and ``jobs``, which does not.

    Parameters
    ----------
    search
        Name of the global search (`mofit.identification.search_registry`).
    weights
        Weight of a test's NRMSD in the search; 1 where not named.
    seed
        Seed of every random draw.
    joint
        Identify calibration and dynamic parameters at once, all tests together.
    bounds, fixed
        Other bounds, or a fixed value, for parameters by name.
    least_probability
        Modes of less posterior probability (Laplace approximation) are listed, not sampled.
    most_modes
        Most modes that are sampled.
    jobs
        Threads; all cores by default.
    sample
        Whether modes are sampled; else their standard deviations are those of the Laplace approximation.
    time_limit
        Seconds after which an identification ends with what there is; None: no limit.
    """

    search: str = DEFAULT_SEARCH
    weights: Mapping[str, float] = field(default_factory=dict)
    seed: int = 0
    joint: bool = False
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    fixed: Mapping[str, float] = field(default_factory=dict)
    least_probability: float = 1e-3
    most_modes: int = 6
    sampling: SampleSettings = field(default_factory=SampleSettings)
    jobs: int = field(default_factory=lambda: os.cpu_count() or 1)
    sample: bool = True
    time_limit: float | None = None

    def __post_init__(self) -> None:
        if self.time_limit is not None and not self.time_limit > 0:
            raise InputError.of("--time-limit", f"{self.time_limit:g} s is no time", "Give more than 0 s, as in 60s")

    def deciding(self) -> dict[str, object]:
        """The settings that decide the numbers, as plain data."""
        return {key: value for key, value in asdict(self).items() if key not in ("jobs", "time_limit")}


def free_space(model: Model, settings: Settings) -> ParameterSpace:
    """Free parameters: the model's, without the fixed ones, in the bounds asked for."""
    space = ParameterSpace(model.parameters)
    raise_errors(
        Issue(f"option '{name}'", f"model '{model.name}' has no such parameter", did_you_mean(name, space.names))
        for name in (*settings.bounds, *settings.fixed)
        if name not in space.names
    )
    for name, (lower, upper) in settings.bounds.items():
        space = space.with_bounds(name, lower, upper)
    free = [name for name in space.names if name not in settings.fixed]
    if not free:
        raise InputError.of("--fix", "no parameter is left free", "Leave at least one free")
    return space.subset(free)
