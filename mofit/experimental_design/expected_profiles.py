"""Expected profile likelihoods: of the data that tests will give if the model is right, without noise in them.

The likelihood is as wide as the noise makes it, so that the profiles are those of an identification on average.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mofit._typing import FloatArray
from mofit.experimental_design.identifiability import BOX_SD, Identifiability, identifiability
from mofit.experimental_design.information import SourceInformation
from mofit.experimental_design.sensitivity import Sensitivity
from mofit.experimental_design.simulations_needed import refused
from mofit.identification.descents import COSTLY
from mofit.models import build_system
from mofit.optimize import profile
from mofit.parameters import ParameterLayout, ParameterSpace
from mofit.problem import TOLERANCE, AdjustedPosterior, GaussianPrior, Noise, Problem, Score, adjust
from mofit.simulation import ExperimentData, Simulator


@dataclass(frozen=True)
class ProfileSettings:
    """Numbers of the profiles."""

    rise: float = 1.92
    """Rise of the negative log likelihood (nats) beyond which a value is excluded: 95 %, half of chi-square's 3.84."""
    grid: int = 17
    """Values per parameter."""
    reach: float = 4.0
    """Standard deviations on each side over which a well-known parameter is profiled."""
    calibrated: float = 6.0
    """Standard deviations of the calibrated parameters that the simulations cover."""
    costly_grid: int = 9
    """Values per parameter of a user's simulator."""


SETTINGS = ProfileSettings()
#: Minimisations of a user's simulator: 1e-3 nats are invisible beside the rise, and its noise hides less.
_COSTLY = replace(COSTLY, gradient_tolerance=np.inf, decrease_tolerance=1e-3)
#: Width of a Gaussian's profile interval in its standard deviations.
INTERVAL_WIDTH = 2 * float(np.sqrt(2 * SETTINGS.rise))


@dataclass(frozen=True)
class ProfileInterval:
    """What a profile excludes."""

    low: float
    high: float
    """Ends of the 95 % interval, SI units; nan where a bound is reached first."""
    width: float
    """From one to the other in the unit cube; nan unless both are there."""
    grid: FloatArray
    rise: FloatArray
    """The profile: fixed values and the rise there in nats, (P,)."""

    @property
    def closed(self) -> int:
        """How many of the two ends there are."""
        return int(np.isfinite(self.low)) + int(np.isfinite(self.high))


@dataclass(frozen=True, eq=False)
class ExpectedData:
    """The data that the main tests of a source will give at its reference values, as a simulator holds them."""

    information: SourceInformation
    simulator: Simulator

    def posterior(self, tests: Sequence[str]) -> AdjustedPosterior:
        """The posterior of some of the tests."""
        known, source = self.information, self.information.source
        index = [i for i, test in enumerate(source.main) if test.name in tests]
        own = [known.tests.main[i] for i in index]
        noise = Noise(
            count=np.concatenate([test.count for test in own]),
            floor=np.concatenate([np.sqrt(test.noise_variance[:, 0]) for test in own]),
            independent=np.concatenate([test.independent[:, 0] for test in own]),
            gap=0.0,
        )
        simulator = self.simulator.select(index)
        centre, names = known.unit[0], source.space.names
        problem = Problem(
            model=source.model, system=simulator.system, measurements=(), signals=(),
            layout=ParameterLayout.of_model(source.model.parameters, source.space),
            simulator=simulator, experiments=simulator.experiments, noise=noise,
            prior=GaussianPrior(names, centre, known.precision(())[0]),
        )  # fmt: skip
        score = _expected_score(own, known.derivative[0])
        return AdjustedPosterior(problem, adjust(score, centre, with_gap=False), 0.0, 0.0, score, 0.0)


def _expected_score(tests: Sequence[Sensitivity], derivative: FloatArray) -> Score:
    """What `mofit.problem.score_covariance.score_covariance` finds on average over the noise of a right model."""
    square = np.outer(derivative, derivative)
    covariance = np.stack([test.score_covariance[0] for test in tests]) * square
    freedom = min(part.degrees_of_freedom.min() for test in tests for own in test.noise for part in own[0])
    return Score(
        slope=np.zeros((len(tests), len(derivative))),
        normal=np.stack([test.hessian[0] for test in tests]) * square,
        noise=covariance,
        gap=np.zeros_like(covariance),
        freedom=np.full(len(tests), freedom),
        gap_freedom=1.0,
    )


def expected_data(known: SourceInformation, jobs: int = 1) -> ExpectedData:
    """Simulate what the tests of the main identification will measure."""
    source = known.source
    prior = identifiability(known.precision(())[:1], known.samples[:1], source.space)
    free = np.array([name not in source.calibrated for name in source.space.names])
    reach = np.where(free, 1.0, SETTINGS.calibrated * prior.sd[0])
    box = source.space.from_unit(np.clip([known.unit[0] - reach, known.unit[0] + reach], 0.0, 1.0))
    exact = [_exact(test.data, own.outputs) for test, own in zip(source.main, known.tests.main, strict=True)]
    system = build_system(source.model)
    return ExpectedData(
        known, Simulator(system, exact, source.space.names, jobs=jobs, tolerance=TOLERANCE, box=(box[0], box[1]))
    )


def _exact(experiment: ExperimentData, outputs: Sequence[FloatArray]) -> ExperimentData:
    """A test with its simulated outputs at the samples used in the fit as measured ones."""
    measured = np.zeros_like(experiment.measured)
    for i, own in zip(experiment.fitted, outputs, strict=True):
        measured[experiment.weights[:, i] > 0, i] = own[0]
    return replace(experiment, measured=measured)


def expected_profiles(data: ExpectedData, tests: Sequence[str], found: Identifiability) -> list[ProfileInterval] | None:
    """Profiles of all parameters (those of calibration stages narrowly) from some of the tests.

    The tests are named, of the main identification; their local identifiability was found beforehand. None where the
    simulations that a user's simulator is allowed did not suffice.
    """
    centre, source = data.information.unit[0], data.information.source
    space, width = source.space, np.where(found.sd[0] < BOX_SD / 4, found.sd[0], 1.0)
    posterior, before = data.posterior(tests), refused(source.model)
    if posterior.problem.main.evaluations is None:
        traced = profile(posterior, centre, width, SETTINGS.grid, reach=SETTINGS.reach)
    else:
        traced = profile(posterior, centre, width, SETTINGS.costly_grid, SETTINGS.reach, _COSTLY)
    if refused(source.model) > before:  # a simulation that was not made excludes nothing
        return None
    return [
        profile_interval(space.subset([name]), traced.grid[k], traced.neg_log_posterior[k], centre[k])
        for k, name in enumerate(space.names)
    ]


def profile_interval(space: ParameterSpace, grid: FloatArray, rise: FloatArray, centre: float) -> ProfileInterval:
    """The interval of a profile (P,) of one parameter around its minimum; grid and centre in the unit cube."""
    low = _crossing(grid[grid <= centre][::-1], rise[grid <= centre][::-1])
    high = _crossing(grid[grid >= centre], rise[grid >= centre])
    first, last, *values = space.from_unit(np.array([low, high, *grid])[:, None])[:, 0]
    return ProfileInterval(float(first), float(last), high - low, np.array(values), rise)


def _crossing(grid: FloatArray, rise: FloatArray) -> float:
    """Where the profile first passes the limit going outwards, nan if it does not."""
    above = np.flatnonzero(np.nan_to_num(rise, nan=np.inf) > SETTINGS.rise)
    if not above.size:
        return np.nan
    k = int(above[0])
    if k == 0:
        return float(grid[0])
    if not np.isfinite(rise[k]):
        return float(grid[k])
    # a parabola's root is linear in the distance from the minimum
    roots = np.sqrt(np.maximum([rise[k - 1], SETTINGS.rise, rise[k]], 0.0))
    share = (roots[1] - roots[0]) / (roots[2] - roots[0])
    return float(grid[k - 1] + share * (grid[k] - grid[k - 1]))
