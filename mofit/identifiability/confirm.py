"""Verdicts confirmed: profile likelihoods of data as they are expected, without noise in them but with its width."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mofit.identifiability.estimator import expected_adjustment
from mofit.identifiability.noise import independent_share, power, together
from mofit.identifiability.telling import Told
from mofit.identifiability.verdicts import BOX_SD, Spread, spread
from mofit.kernel import Drive, Simulator
from mofit.model import build_system
from mofit.objectives import GaussianPrior, Noise
from mofit.problem import TOLERANCE, Problem
from mofit.profiles import Profile, profile
from mofit.spread import SpreadProblem

Array = NDArray[np.float64]

#: Rise of the profile (nats) beyond which a value is ruled out: 95 %.
RISE = 1.92
#: Grid points over the whole box.
POINTS = 17
#: Standard deviations of the calibrated parameters that the profiles may use.
_REACH = 6.0


@dataclass(frozen=True)
class Limits:
    """What a profile rules out.

    Parameters
    ----------
    low, high
        Ends of the 95 % interval in the unit cube; nan where a bound is reached first.
    grid, rise
        The profile: held values in the unit cube and the rise there in nats, (P,).
    """

    low: float
    high: float
    grid: Array
    rise: Array

    @property
    def closed(self) -> int:
        """How many of the two ends there are."""
        return int(np.isfinite(self.low)) + int(np.isfinite(self.high))


@dataclass(frozen=True, eq=False)
class Expectation:
    """The data that tests of a source will give if the model is right, at the first parameter set of ``told``."""

    told: Told
    simulator: Simulator

    def problem(self, tests: Sequence[str]) -> SpreadProblem:
        """What an identification from some tests will see."""
        told, source = self.told, self.told.source
        index = [i for i, test in enumerate(source.main) if test.name in tests]
        shown = [told.shown[i] for i in index]
        count = np.array([sum(own.shape[1] for own in test.outputs) for test in shown], dtype=float)
        noise = [[together(own[0]) for own in test.noise] for test in shown]
        floor = [
            np.sqrt(np.mean([power(own) / width**2 for own, width in zip(parts, test.ranges, strict=True)]))
            for parts, test in zip(noise, shown, strict=True)
        ]
        independent = [sum(independent_share(own) * own.count for own in parts) for parts in noise]
        simulator = self.simulator.select(index)
        centre, names = told.unit[0], source.space.names
        problem = Problem(
            model=source.model, system=simulator.system, measurements=(), records=(), space=source.space, fixed={},
            simulator=simulator, drives=simulator.drives,
            noise=Noise(count, np.array(floor), np.array(independent), gap=0.0),
            prior=GaussianPrior(names, centre, told.stages()[0]),
        )  # fmt: skip
        return SpreadProblem(problem, expected_adjustment(shown, 0, told.stretch[0], centre), 0.0, 0.0, (0.0, 0.0))


def expect(told: Told, jobs: int = 1) -> Expectation:
    """Simulate what the tests of the main identification will measure."""
    source = told.source
    known = spread(told.stages()[:1], told.values[:1], source.space)
    free = np.array([name not in source.calibrated for name in source.space.names])
    reach = np.where(free, 1.0, _REACH * known.sd[0])
    box = source.space.from_unit(np.clip([told.unit[0] - reach, told.unit[0] + reach], 0.0, 1.0))
    exact = [_exact(test.drive, shown.outputs) for test, shown in zip(source.main, told.shown, strict=True)]
    system = build_system(source.model)
    simulator = Simulator(system, exact, source.space.names, jobs=jobs, tolerance=TOLERANCE, box=(box[0], box[1]))
    return Expectation(told, simulator)


def _exact(drive: Drive, outputs: Sequence[Array]) -> Drive:
    """A test with the simulated outputs (of the judged samples, at the first parameter set) as its measured ones."""
    measured = np.zeros_like(drive.measured)
    for i, own in enumerate(outputs):
        measured[drive.weights[:, i] > 0, i] = own[0]
    return replace(drive, measured=measured)


def profiles(expectation: Expectation, tests: Sequence[str], found: Spread) -> list[Limits]:
    """Profiles of all parameters (those of calibration stages narrowly), of what some tests will tell.

    Parameters
    ----------
    expectation
        The data.
    tests
        Names of tests of the main identification.
    found
        The local spread from these tests.
    """
    centre = expectation.told.unit[0]
    width = np.where(found.sd[0] < BOX_SD / 4, found.sd[0], 1.0)
    traced = profile(expectation.problem(tests), centre, width, POINTS, reach=4.0)
    return [_limits(traced, k, centre[k]) for k in range(len(centre))]


def _limits(traced: Profile, k: int, centre: float) -> Limits:
    grid, rise = traced.grid[k], traced.nll[k]
    low = _crossing(grid[grid <= centre][::-1], rise[grid <= centre][::-1])
    high = _crossing(grid[grid >= centre], rise[grid >= centre])
    return Limits(low, high, grid, rise)


def _crossing(grid: Array, rise: Array) -> float:
    """Where the profile first passes `RISE` going outwards, nan if it does not."""
    above = np.flatnonzero(np.nan_to_num(rise, nan=np.inf) > RISE)
    if not above.size:
        return np.nan
    k = int(above[0])
    if k == 0:
        return float(grid[0])
    if not np.isfinite(rise[k]):
        return float(grid[k])
    # a parabola's root is linear in the distance from the minimum
    roots = np.sqrt(np.maximum([rise[k - 1], RISE, rise[k]], 0.0))
    share = (roots[1] - roots[0]) / (roots[2] - roots[0])
    return float(grid[k - 1] + share * (grid[k] - grid[k - 1]))
