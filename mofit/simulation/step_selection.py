"""The step level of each parameter set and test: by a rule that is calibrated within a box, or measured."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mofit._typing import FloatArray
from mofit.simulation.experiment import ExperimentData
from mofit.simulation.integrators import RK4, RODAS4
from mofit.simulation.step_probing import StepProbe, StepSettings, Stiffness
from mofit.simulation.time_grid import StepChoice, StepLevel

#: steps that parameter sets need on each test, and where kinks ask for them, both (N, T)
Needed = tuple[FloatArray, NDArray[np.bool_]]
#: lower and upper bounds of all parameters
Box = tuple[ArrayLike, ArrayLike]


@dataclass(frozen=True)
class StepRule:
    """For one test: ``levels[i]`` is taken up to the stiffness ``limits[i]``, 1/s, ascending; the last one beyond."""

    levels: tuple[StepLevel, ...]
    limits: tuple[float, ...] = ()

    def choose(self, stiffness: FloatArray) -> StepChoice:
        """The level of every parameter set."""
        return StepChoice(self.levels, np.searchsorted(self.limits, stiffness))


class StepSelection:
    """Chooses step levels; a choice depends on nothing but the parameter set and the test.

    Parameters
    ----------
    probe
        Integrates the tests with any number of steps; compiled when it is first asked for.
    box
        Bounds (lower, upper) of all parameters, within which a rule is calibrated at first use. Without it every
        parameter set is measured.
    tolerance
        Allowed error of the integration relative to the range of the outputs.
    """

    settings = StepSettings()

    def __init__(self, probe: Callable[[], StepProbe], box: Box | None, tolerance: float) -> None:
        self._probe, self._box, self._tolerance = probe, box, tolerance

    @cached_property
    def _measured(self) -> Callable[[bytes, int], dict[ExperimentData, StepChoice]]:
        """`_measure`, remembered; made where it is needed, because its circle keeps the tests in memory."""
        return lru_cache(maxsize=8)(self._measure)

    def rules(self, experiments: Sequence[ExperimentData]) -> list[StepRule]:
        """The rule of each test; none without a box."""
        if self._box is None:
            return []
        rules, _ = self._calibration
        return [rules[experiment.origin or experiment] for experiment in experiments]

    def choices(self, p: FloatArray, experiments: Sequence[ExperimentData]) -> list[StepChoice]:
        """How each test is integrated at parameter sets (N, np), or (N, T, np) if each test has its own."""
        if p.ndim == 3:
            return [self.choices(np.ascontiguousarray(p[:, t]), [e])[0] for t, e in enumerate(experiments)]
        if self._box is None:
            measured = self._measured(p.tobytes(), len(p))
            return [measured[experiment.origin or experiment] for experiment in experiments]
        _, stiffness = self._calibration
        rate = stiffness(p)
        return [rule.choose(rate) for rule in self.rules(experiments)]

    @cached_property
    def _calibration(self) -> tuple[dict[ExperimentData, StepRule], Stiffness]:
        """The rule of every test.

        All sets up to a stiffness take the cheapest level that is enough for those of a sample throughout the box.
        """
        assert self._box is not None
        lower, upper = (np.asarray(bound, dtype=float) for bound in self._box)
        probe, p = self._probe(), sample_box(lower, upper, self.settings)
        stiffness = probe.stiffness(p)
        rate = stiffness(p)
        found = self._needed(p, rate)
        explicit, implicit = (self._typical(*needed) for needed in found)
        otherwise = self._else(any(bool(kinks.any()) for _, kinks in found))
        rules = [_rule(rate, explicit[:, t], implicit[:, t], otherwise) for t in range(explicit.shape[1])]
        return dict(zip(probe.origins, rules, strict=True)), stiffness

    def _measure(self, sets: bytes, count: int) -> dict[ExperimentData, StepChoice]:
        """The cheapest sufficient level of every parameter set."""
        (explicit, kinked), (implicit, more) = self._needed(np.frombuffer(sets).reshape(count, -1))
        # a test hides by chance what the others show
        otherwise = [self._else(bool(np.any(kinks))) for kinks in kinked | more]
        levels = [
            [self.settings.cheapest(one, other, rest) for one, other, rest in zip(*columns, otherwise, strict=True)]
            for columns in zip(explicit.T, implicit.T, strict=True)
        ]
        return dict(zip(self._probe().origins, map(StepChoice.of, levels), strict=True))

    def _else(self, kinked: bool) -> int:
        """Implicit steps where no level is enough: at kinks every step more helps."""
        return self.settings.implicit[-1] if kinked else self.settings.unresolved

    def _typical(self, needed: FloatArray, kinked: NDArray[np.bool_]) -> FloatArray:
        """The steps that sets need on each test, (N, T), where kinks ask for them no more than usual."""
        result = needed.copy()
        for steps, chance in zip(result.T, kinked.T, strict=True):
            if chance.any():
                usual = np.quantile(steps[chance], self.settings.kinks, method="higher")
                steps[chance] = np.minimum(steps[chance], usual)
        return result

    def _needed(self, p: FloatArray, rate: FloatArray | None = None) -> tuple[Needed, Needed]:
        """Explicit and implicit steps that sets (N, np) need on each test, and where kinks ask for them.

        The number is doubled until the outputs change by less than the tolerance.
        """
        probe, settings = self._probe(), self.settings
        explicit = probe.needed(p, RK4, settings.explicit[-1], self._tolerance, rate)
        skip = explicit[0] <= settings.few
        return explicit, probe.needed(p, RODAS4, settings.implicit[-1], self._tolerance, skip=skip)


def sample_box(lower: FloatArray, upper: FloatArray, settings: StepSettings) -> FloatArray:
    """Parameter sets throughout a box: a Sobol sequence and corners; bounds that coincide are kept."""
    from scipy.stats import qmc  # late: its import takes half a second

    wide = (lower > 0) & (upper >= settings.wide * lower)
    low, high = lower.copy(), upper.copy()
    low[wide], high[wide] = np.log(lower[wide]), np.log(upper[wide])
    moved = np.flatnonzero(upper > lower)
    if not len(moved):
        return lower[None]
    if 2 ** len(moved) <= settings.corners:
        corners = np.array(np.meshgrid(*[[0.0, 1.0]] * len(moved))).reshape(len(moved), -1).T
    else:
        corners = np.random.default_rng(0).integers(0, 2, (settings.corners, len(moved))).astype(float)
    unit = np.zeros((settings.points + len(corners), len(lower)))
    unit[:, moved] = np.concatenate([qmc.Sobol(len(moved), scramble=False).random(settings.points), corners])
    values = low + unit * (high - low)
    values[:, wide] = np.exp(values[:, wide])
    return np.clip(values, lower, upper)


def _rule(rate: FloatArray, explicit: FloatArray, implicit: FloatArray, otherwise: int) -> StepRule:
    """The rule of a test from stiffness and needed steps of a sample, each (N,); ``otherwise`` if none is resolved."""
    settings = StepSelection.settings
    unresolved = ~np.isfinite(explicit) & ~np.isfinite(implicit)
    order = np.argsort(rate[~unresolved], kind="stable")
    rate, explicit, implicit = (values[~unresolved][order] for values in (rate, explicit, implicit))
    levels: list[StepLevel] = []
    limits: list[float] = []
    for i in range(len(rate)):
        # what is stiffer needs no less: the most that any set up to here, and a little on, needed
        end = max(i + settings.ahead, int(np.searchsorted(rate, settings.stiffer * rate[i])))
        tried = implicit[:end][~np.isnan(implicit[:end])]
        needed = float(np.max(explicit[:end])), float(np.max(tried)) if len(tried) else np.nan
        level = settings.cheapest(*needed, settings.implicit[-1])
        if levels and levels[-1] == level:
            limits[-1] = float(rate[i])
        else:
            levels.append(level)
            limits.append(float(rate[i]))
    # stiffer than all of the sample: the L-stable method with as many steps as any of it needed
    if not limits:
        return StepRule((StepLevel(RODAS4, otherwise),))
    most = float(np.max(implicit[np.isfinite(implicit)], initial=settings.unresolved))
    limits[-1] *= settings.beyond
    return StepRule((*levels, settings.cheapest(np.inf, most, settings.implicit[-1])), tuple(limits))
