"""A mode of a costly simulator, emulated: trained around its minimum, checked and refined where its posterior lies."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cholesky

from mofit._typing import FloatArray
from mofit.identification.findings import Finding
from mofit.problem import AdjustedPosterior, Problem
from mofit.sampling import SampleSettings, sample_mode
from mofit.simulation.evaluation.differences import FINE
from mofit.simulation.evaluation.emulated import EmulatedSimulator
from mofit.simulation.evaluation.emulator import Coordinates, Emulator
from mofit.simulation.evaluation.surface import PER_COEFFICIENT, coefficients

LogPosterior = Callable[[FloatArray], FloatArray]

#: Error of the log posterior, in nats, at which refining ends: it moves no mean by more than 2 % of a standard
#: deviation, and that only if it were to grow along one parameter alone.
WANTED = 0.02
#: Error beyond which the sampled posterior is not to be trusted: densities are wrong by a third.
ACCEPTED = 0.3
#: The first points spread that much wider than the posterior by the Laplace approximation, which may be too narrow.
SPREAD = 1.4
#: First points per coefficient of a quadratic.
FIRST = 1.6
#: Points that check, per parameter and at least.
CHECKS_PER_PARAMETER, FEWEST_CHECKS = 2, 10
#: Rounds of checking and refining at most.
ROUNDS = 12
#: Half of them are draws of the posterior to this power, which is wider: a tail that the emulator lacks is among these.
WIDER = 0.5
#: Short chains suffice to draw points that check.
_QUICK = SampleSettings(max_steps=60, min_rounds=3, max_rounds=6)


@dataclass(frozen=True)
class EmulatorCheck:
    """How well an emulator stands for the simulator."""

    error: float
    """Root mean square error of the log posterior over it, from fresh draws, nats; infinite: never checked."""
    trained: int
    """Parameter sets that it was trained at."""
    simulations: int
    """True simulations that it took."""
    rounds: int
    """Times that it was checked."""

    def finding(self, mode: str) -> Finding | None:
        """What is wrong with it, if anything is."""
        if self.error <= ACCEPTED:
            return None
        size = "could not be checked" if np.isinf(self.error) else f"errs by {self.error:.2g} nats"
        text = (
            f"{mode}: the emulator that was sampled {size}, and the simulations that are allowed did not suffice to "
            f"bring that below {ACCEPTED}. Do not use the standard deviations; allow more (--simulations)."
        )
        return Finding("emulator", "untrusted", text)


def emulated(
    adjusted: AdjustedPosterior,
    point: FloatArray,
    covariance: FloatArray,
    seed: int,
    *,
    share: float = 1.0,
    within: Callable[[LogPosterior], LogPosterior] = lambda own: own,
    progress: Callable[[int, int, str], None] = lambda done, total, note: None,
) -> tuple[AdjustedPosterior, EmulatorCheck]:
    """The posterior around a minimum with an emulator in place of the simulator, and how good that is.

    Parameters
    ----------
    adjusted, point, covariance
        The posterior, its minimum (d,) and the covariance there by the Laplace approximation.
    seed
        Of the identification.
    share
        Part of the simulations left that it may take.
    within
        Cuts a posterior down to the region of the mode.
    progress
        Called after every round.
    """
    training = _Training.around(adjusted, point, covariance, seed, share)
    if training is None:
        return adjusted, EmulatorCheck(np.inf, 0, 0, 0)
    error, rounds = np.inf, 0
    while True:
        quick = training.posterior(adjusted)
        checks = training.affordable(max(FEWEST_CHECKS, CHECKS_PER_PARAMETER * len(point)))
        if rounds == ROUNDS or checks < min(FEWEST_CHECKS, len(point) + 1):
            break
        fresh = _Fresh.drawn(within(quick.log_posterior), point, covariance, (seed, 7, rounds), checks)
        error, rounds = training.error(adjusted, quick, fresh), rounds + 1
        progress(training.simulations, 0, f"emulator: error {error:.2g} nats (log posterior) at {checks} fresh draws")
        if error <= WANTED:
            quick = training.posterior(adjusted)
            break
    return quick, EmulatorCheck(error, training.count, training.simulations, rounds)


@dataclass(frozen=True)
class _Fresh:
    r"""Draws that check an emulated posterior p: half of its own, half of the wider :math:`q \propto p^{1/2}`.

    An error :math:`e` counts by the density of the true posterior or of the emulated one, where that is more, over that
    of the draws (balance heuristic, Veach and Guibas 1995):

    .. math:: \overline{e^2} = \frac1K \sum_k \frac{2 p_k}{p_k + q_k} \max(1, e^{-e_k}) \, e_k^2
    """

    points: FloatArray
    """Shape (K, d)."""
    weights: FloatArray
    """:math:`2 p / (p + q)`, (K,)."""

    @classmethod
    def drawn(
        cls, target: LogPosterior, point: FloatArray, covariance: FloatArray, seed: tuple[int, ...], count: int
    ) -> _Fresh:
        """Draws of a posterior around its minimum."""
        chains = sample_mode(lambda u: WIDER * target(u), point, covariance / WIDER, seed, _QUICK)
        late = chains.chain[:, chains.chain.shape[1] // 2 :].reshape(-1, len(point))
        narrower = (1 - WIDER) * target(late)
        ratio = np.exp(narrower - narrower.max())
        ratio /= ratio.mean()
        rng = np.random.default_rng((*seed, 8))
        own = rng.choice(len(late), size=count - count // 2, p=ratio / ratio.sum())
        rows = np.concatenate([own, rng.integers(len(late), size=count // 2)])
        return cls(late[rows], 2 * ratio[rows] / (1 + ratio[rows]))

    def error(self, wrong: FloatArray) -> float:
        """Root mean square of errors (K,), emulated less true log posterior."""
        return float(np.sqrt(np.mean(self.weights * np.maximum(1.0, np.exp(np.minimum(-wrong, 50.0))) * wrong**2)))


@dataclass
class _Training:
    """The parameter sets that an emulator is trained at, and the responses there."""

    problem: Problem
    coordinates: Coordinates
    most: float
    """Simulations that it may take."""
    seed: int
    sets: FloatArray
    responses: list[FloatArray]
    volumes: FloatArray
    first: float
    """Simulations of the problem before the training."""

    @classmethod
    def around(
        cls, adjusted: AdjustedPosterior, point: FloatArray, covariance: FloatArray, seed: int, share: float
    ) -> _Training | None:
        """The first sets, around a minimum; None if too few simulations are left for a plane."""
        from scipy.stats import norm, qmc  # late: its import takes half a second

        problem, mapping = adjusted.problem.main, adjusted.adjustment.map
        evaluations = problem.evaluations
        assert evaluations is not None
        free = problem.simulator.free
        root = np.asarray(cholesky((mapping @ covariance @ mapping.T)[: len(free), : len(free)], lower=True))
        columns = tuple(problem.layout.names.index(name) for name in free)
        centre = adjusted.adjustment.mapped(point[None])[0, : len(free)]
        coordinates = Coordinates(problem.space.subset(free), columns, centre, root)
        none = np.zeros((0, len(problem.layout.names)))
        found = cls(problem, coordinates, share * evaluations.left, seed, none, [], np.zeros(0), evaluations.count)
        wanted = int(np.ceil(FIRST * coefficients(len(free), 2)))
        count = found.affordable(wanted + FEWEST_CHECKS) - FEWEST_CHECKS
        if count < PER_COEFFICIENT * coefficients(len(free), 1) + 1:
            return None
        sequence = qmc.Sobol(len(free), rng=np.random.default_rng((seed, 6)))
        z = SPREAD * norm.ppf(sequence.random(1 << (count - 1).bit_length())[:count] * (1 - 2e-6) + 1e-6)
        whole = np.tile(adjusted.adjustment.mapped(point[None]), (count + 1, 1))
        whole[1:, : len(free)] = np.clip(centre + z @ root.T, 0.0, 1.0)
        found.add(problem.layout.full(whole))
        return found if found.count >= PER_COEFFICIENT * coefficients(len(free), 1) else None

    @property
    def count(self) -> int:
        """Number of sets."""
        return len(self.sets)

    @property
    def simulations(self) -> int:
        """True simulations so far."""
        assert self.problem.evaluations is not None
        return int(self.problem.evaluations.count - self.first)

    def affordable(self, wanted: int) -> int:
        """So many further sets, or as many as may still be simulated."""
        per_set = max(len(self.problem.tests), self.simulations / self.count if self.count else 0)
        return int(min(wanted, max((self.most - self.simulations) / per_set, 0)))

    def add(self, p: FloatArray) -> None:
        """Simulate at sets (K, np), and learn from those that succeed."""
        simulator = self.problem.simulator
        responses = simulator.simulate(p)
        good = np.all([np.isfinite(values).all(axis=(1, 2)) for values in responses], axis=0)
        volumes = simulator.log_volume(p)
        good &= np.isfinite(volumes)
        self.sets = np.concatenate([self.sets, p[good]])
        self.volumes = np.concatenate([self.volumes, volumes[good]])
        self.responses = [
            values[good] if not self.responses else np.concatenate([self.responses[test], values[good]])
            for test, values in enumerate(responses)
        ]

    def posterior(self, adjusted: AdjustedPosterior) -> AdjustedPosterior:
        """The posterior with the emulator as it is trained now."""
        problem, weights = self.problem, self.problem.noise.weights
        places = [test for test, experiment in enumerate(problem.experiments) for _ in experiment.fitted]
        importance = np.array([weights[np.array(places) == test].mean() for test in range(len(problem.experiments))])
        emulator = Emulator(
            self.coordinates, problem.experiments, self.sets, self.responses, importance, self.volumes, self.seed
        )
        simulator = EmulatedSimulator(
            problem.system, problem.experiments, problem.simulator.free, emulator, problem.simulator.absorbed
        )
        quick = replace(problem, simulator=simulator)
        return adjusted.with_slopes_of(quick) if self.slopes_are_better else replace(adjusted, problem=quick)

    @property
    def slopes_are_better(self) -> bool:
        r"""Whether noise of the simulator spoils differences more than the emulator's slopes.

        Noise :math:`\varepsilon` of the outputs errs a central difference with step h by
        :math:`\varepsilon / (\sqrt 2 h)`, and a slope through K points that spread by s by
        :math:`\varepsilon / (s \sqrt K)`. Both are compared in whitened coordinates, where the sum over the parameters
        counts.
        """
        evaluations = self.problem.evaluations
        assert evaluations is not None
        steps = [evaluations.steps[name] for name in self.coordinates.space.names if name in evaluations.steps]
        if not any(step.error > FINE for step in steps):
            return False
        sizes, root = np.array([step.size for step in steps]), self.coordinates.root
        by_differences = 0.5 * np.sum(np.sum(root**2, axis=1) / sizes**2)
        return bool(by_differences > len(root) / (SPREAD**2 * self.count))

    def error(self, adjusted: AdjustedPosterior, quick: AdjustedPosterior, fresh: _Fresh) -> float:
        """Error of the emulated log posterior at draws, which are learned from then.

        Where the simulator fails the emulator is wrong by as much as it matters: such points count as wrong by a nat.
        """
        self.add(self.problem.layout.full(quick.adjustment.mapped(fresh.points)))
        true = replace(quick, problem=adjusted.problem)
        wrong = quick.log_posterior(fresh.points) - true.log_posterior(fresh.points)
        return fresh.error(np.where(np.isfinite(wrong), wrong, 1.0))
