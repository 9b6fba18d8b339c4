"""What an identification may be told."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field

from mofit.errors import Fault, InputError, did_you_mean, raise_errors
from mofit.model import Model
from mofit.parameters import ParameterSpace
from mofit.sample import SampleSettings

SEARCHES = ("niching", "paper", "surrogate")


@dataclass(frozen=True)
class Settings:
    """What decides an identification's numbers, and ``jobs``, which does not.

    Parameters
    ----------
    search
        ``"niching"`` (exact gradients, no start twice in a basin), ``"paper"`` (the enhanced firefly algorithm exactly
        as published) or ``"surrogate"`` (few evaluations, for expensive models).
    weights
        Weight of a test's NRMSD in the search; 1 where not named.
    seed
        Seed of every random draw.
    joint
        Identify calibration and dynamic parameters at once, all tests together.
    bounds, fixed
        Other bounds, or a fixed value, for parameters by name.
    least_weight
        Modes of less posterior weight are listed, not sampled.
    most_modes
        Most modes that are sampled.
    jobs
        Threads; all cores by default.
    """

    search: str = "niching"
    weights: Mapping[str, float] = field(default_factory=dict)
    seed: int = 0
    joint: bool = False
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    fixed: Mapping[str, float] = field(default_factory=dict)
    least_weight: float = 1e-3
    most_modes: int = 6
    sampling: SampleSettings = field(default_factory=SampleSettings)
    jobs: int = field(default_factory=lambda: os.cpu_count() or 1)

    def deciding(self) -> dict[str, object]:
        """The settings that decide the numbers, as plain data."""
        return {key: value for key, value in asdict(self).items() if key != "jobs"}


def free_space(model: Model, settings: Settings) -> ParameterSpace:
    """Free parameters: the model's, without the fixed ones, in the bounds asked for."""
    space = ParameterSpace(model.parameters)
    raise_errors(
        Fault(f"option '{name}'", f"model '{model.name}' has no such parameter", did_you_mean(name, space.names))
        for name in (*settings.bounds, *settings.fixed)
        if name not in space.names
    )
    for name, (lower, upper) in settings.bounds.items():
        space = space.with_bounds(name, lower, upper)
    free = [name for name in space.names if name not in settings.fixed]
    if not free:
        raise InputError.of("--fix", "no parameter is left free", "Leave at least one free")
    return space.subset(free)
