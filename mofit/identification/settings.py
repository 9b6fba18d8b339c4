"""Settings of an identification."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from numbers import Integral

from mofit.errors import InputError, Issue, check_settings, did_you_mean, raise_errors
from mofit.identification.search_registry import COSTLY_SEARCH, DEFAULT_SEARCH
from mofit.models import Model
from mofit.parameters import PER_CAMPAIGN, ParameterSpace
from mofit.sampling import SampleSettings
from mofit.simulation.evaluation.evaluations import simulator_of
from mofit.simulation.evaluation.executors import TIMEOUT

#: Times the largest value in its range at which a fixed parameter is a mistake: powers of it overflow.
FAR = 1e6
#: Simulations of a user's simulator: at 0.2 s each, seven minutes.
SIMULATIONS = 2000
#: Settings that decide no number.
WITHOUT_EFFECT = ("jobs", "time_limit", "timeout", "dask")


@dataclass(frozen=True)
class Settings:
    """What decides an identification's numbers, and where and how long it works.

    Parameters
    ----------
    search
        Name of the global search (`mofit.identification.search_registry`); by default effa, and of a user's simulator
        surrogate.
    weights
        Weight of a test's NRMSD in the search; 1 where not named. Of several outputs ``test / output`` names one.
    evaluations
        Budget of the global search; the search's own where it is None.
    seed
        Seed of every random draw.
    joint
        Identify calibration and dynamic parameters at once, all tests together.
    bounds, fixed
        Other bounds, or a fixed value, for parameters by name.
    scopes
        ``"test"`` or the name of a condition, for parameters that have one value of each.
    pooled
        Scoped parameters whose values are drawn from a normal, whose mean and spread are estimated.
    over
        Conditions over which the parameters of the campaign follow laws.
    laws
        Law of a parameter (``name``) or of it over one condition (``name@condition``), or several by commas, of which
        the evidence chooses; where none is said it chooses of constant, linear, quadratic and free.
    set_points
        Largest difference of neighbouring values of a condition that count as one set point, in SI units; where none is
        said, see `mofit.data.set_points`.
    least_probability
        Modes of less posterior probability (Laplace approximation) are listed, not sampled.
    most_modes
        Most modes that are sampled.
    jobs
        Threads; all cores by default.
    sample
        Whether modes are sampled; else their standard deviations are those of the Laplace approximation.
    simulations
        Most simulations of a user's simulator, one record each; by default `SIMULATIONS`.
    timeout, dask
        Seconds that one of them may take, and the address of a Dask scheduler whose workers make them.
    time_limit
        Seconds after which an identification ends with what there is; None: no limit.
    """

    search: str | None = None
    evaluations: int | None = None
    weights: Mapping[str, float] = field(default_factory=dict)
    seed: int = 0
    joint: bool = False
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    fixed: Mapping[str, float] = field(default_factory=dict)
    scopes: Mapping[str, str] = field(default_factory=dict)
    pooled: tuple[str, ...] = ()
    over: tuple[str, ...] = ()
    laws: Mapping[str, str] = field(default_factory=dict)
    set_points: Mapping[str, float] = field(default_factory=dict)
    least_probability: float = 1e-3
    most_modes: int = 6
    sampling: SampleSettings = field(default_factory=SampleSettings)
    jobs: int = field(default_factory=lambda: os.cpu_count() or 1)
    sample: bool = True
    time_limit: float | None = None
    simulations: int | None = None
    timeout: float = TIMEOUT
    dask: str | None = None

    def for_model(self, model: Model) -> Settings:
        """The settings with what depends on whether a model has equations."""
        if simulator_of(model) is None:
            return replace(self, search=self.search or DEFAULT_SEARCH, simulations=None)
        return replace(self, search=self.search or COSTLY_SEARCH, simulations=self.simulations or SIMULATIONS)

    def deciding(self) -> dict[str, object]:
        """The settings that decide the numbers, as plain data."""
        found = {key: value for key, value in asdict(self).items() if key not in WITHOUT_EFFECT}
        left_out: dict[str, object] = {"simulations": None, "over": (), "laws": {}, "set_points": {}}
        return {key: value for key, value in found.items() if key not in left_out or value != left_out[key]}

    def __post_init__(self) -> None:
        checks = [
            ("seed", is_seed(self.seed), "Give a whole number, 0 or more"),
            ("jobs", self.jobs >= 1, "Give at least 1"),
            ("timeout", self.timeout > 0, "Give more than 0 s"),
            ("time_limit", self.time_limit is None or self.time_limit > 0, "Give more than 0 s"),
            ("simulations", self.simulations is None or self.simulations >= 1, "Give at least 1"),
            ("evaluations", self.evaluations is None or self.evaluations >= 50, "Give at least 50"),
        ]
        check_settings("identification", self, checks)
        if self.laws and not self.over:
            raise InputError.of("--law", "given without --over", "Name the conditions that parameters follow: --over …")
        raise_errors(
            Issue(f"{option} {name}={value:g}", "is not a finite number", "Give a number")
            for option, given in (("--fix", self.fixed), ("--weights", self.weights))
            for name, value in given.items()
            if not math.isfinite(value)
        )


def is_seed(seed: object) -> bool:
    """Whether a random generator takes it."""
    return isinstance(seed, Integral) and int(seed) >= 0


def free_space(model: Model, settings: Settings) -> ParameterSpace:
    """Free parameters: the model's, without the fixed ones, in the bounds and with the scopes asked for.

    Raises
    ------
    InputError
        With every name that the model does not have, or if none is left free.
    """
    space = ParameterSpace(model.parameters)
    raise_errors(
        Issue(f"option '{name}'", f"model '{model.name}' has no such parameter", did_you_mean(name, space.names))
        for name in dict.fromkeys((*settings.bounds, *settings.fixed, *settings.scopes, *settings.pooled))
        if name not in space.names
    )
    raise_errors(
        Issue(f"--fix {name}={value:g}", f"is far outside of the range of the model, {own.lower:g} to {own.upper:g}",
              f"Give it in {own.unit}")
        for name, value, own in ((name, value, space[name]) for name, value in settings.fixed.items())
        if abs(value) > FAR * max(abs(own.lower), abs(own.upper))
    )  # fmt: skip
    for name, (lower, upper) in settings.bounds.items():
        space = space.with_bounds(name, lower, upper)
    space = ParameterSpace(
        tuple(one.scoped(settings.scopes.get(one.name), one.name in settings.pooled) for one in space.parameters)
    )
    free = [name for name in space.names if name not in settings.fixed]
    if not free:
        raise InputError.of("--fix", "no parameter is left free", "Leave at least one free")
    return _with_one_shared(space.subset(free))


def _with_one_shared(space: ParameterSpace) -> ParameterSpace:
    if all(p.per != PER_CAMPAIGN and not p.pooled for p in space.parameters):
        raise InputError.of("--per-test", "no parameter is left that the tests share", "Leave one to the campaign")
    return space
