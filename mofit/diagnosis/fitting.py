"""Fits of a hypothesis, and the projector onto what its parameters cannot explain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mofit._typing import FloatArray
from mofit.data import Campaign
from mofit.diagnosis.hypothesis import Hypothesis, hypothesis
from mofit.diagnosis.input_prediction import with_noise_beside_prediction
from mofit.diagnosis.integration import SimulatorCache
from mofit.diagnosis.limited_refinement import best_minimum
from mofit.diagnosis.scoped_starts import with_scoped
from mofit.diagnosis.whitened_data import WhitenedData, whiten
from mofit.identification.calibration import calibrated_values
from mofit.identification.problem_setup import ProblemSetup, set_up_problem
from mofit.identification.settings import Settings
from mofit.identification.stages import search
from mofit.identification.steady_start import leads_said, led_in, steady_from_start
from mofit.identification.widening import MOST, WORTH, beyond_ends, widenings
from mofit.models import Model
from mofit.optimize import Minimum, RefineSettings
from mofit.parameters import ParameterSpace
from mofit.problem import explained

#: Starts of the baseline beside those given; and the most minima of the search among these.
_STARTS, _MINIMA = 7, 8
#: Rounds in which the baseline and the noise of records that do not repeat are estimated in turn.
_NOISE_ROUNDS = 2
#: Least share of the noise's power that a residual holds where that is noise: it is known better than to a factor of 2.
_FALSE = 0.5
#: A refit ends 0.02 standard deviations from the minimum: criteria differ by far more than the 1e-3 that it leaves.
#: Where steps a thousandth as long as Newton's fail, derivatives and values disagree: shorter steps gain nothing.
_REFINE = RefineSettings(max_iterations=40, gradient_tolerance=0.02, decrease_tolerance=1e-3, most_damping=1e3)
#: From so many steps per sample on integration takes most of the time: there four points are as fast as one.
_FINE_STEPS, _FINE_REFINE = 8, replace(_REFINE, lanes=4, max_iterations=20)


@dataclass(frozen=True)
class Fitted:
    """A hypothesis at its minimum, the value of which is half the sum of all whitened squares, prior included.

    ``residual`` (m + p,) and ``jacobian`` (m + p, d) are those there; see `mofit.diagnosis.hypothesis.Linear`.
    """

    hypothesis: Hypothesis
    minimum: Minimum
    residual: FloatArray
    jacobian: FloatArray

    @property
    def values(self) -> dict[str, float]:
        """Estimate per free parameter."""
        space = self.hypothesis.space
        return dict(zip(space.names, map(float, space.from_unit(self.minimum.point)), strict=True))

    @property
    def derivative(self) -> FloatArray:
        """Derivative of every parameter's value by its unit coordinate at the minimum, (d,)."""
        space = self.hypothesis.space
        return space.derivative(space.from_unit(self.minimum.point))

    @property
    def free(self) -> NDArray[np.bool_]:
        """Parameters that are not at an active bound, (d,)."""
        return np.asarray(self.minimum.at_bound == 0)

    def without_tables(self) -> Fitted:
        """The same with the memory given back that speeds up further fits."""
        return replace(self, hypothesis=replace(self.hypothesis, simulator=self.hypothesis.simulator.without_tables()))

    @property
    def design(self) -> FloatArray:
        """Derivatives of the simulated rows by the f free parameters, (m + p + f, f), a row of the box per parameter.

        Those rows, of unit weight in box widths, keep an unidentifiable direction finite.
        """
        return np.concatenate([-self.jacobian[:, self.free], np.eye(int(self.free.sum()))])

    @property
    def hessian(self) -> FloatArray:
        """Gauss–Newton Hessian of half the sum of squares by the free parameters, the box included, (f, f)."""
        jacobian = self.jacobian[:, self.free]
        return jacobian.T @ jacobian + np.eye(jacobian.shape[1])

    @property
    def covariance_root(self) -> FloatArray:
        """Lower triangular L (f, f), L L' being the covariance of the free parameters."""
        return covariance_root(self.design)

    def sd(self) -> FloatArray:
        """Standard deviation of every parameter in unit coordinates, (d,); 0 at a bound."""
        sd = np.zeros(len(self.free))
        sd[self.free] = np.linalg.norm(self.covariance_root, axis=1)
        return sd

    def sd_along(self, direction: FloatArray) -> float:
        """Standard deviation of the sum of unit coordinates times a direction (d,)."""
        return float(np.linalg.norm(direction[self.free] @ self.covariance_root))


def covariance_root(design: FloatArray) -> FloatArray:
    """Lower triangular root (f, f) of the covariance from derivatives (rows, f): not from the normal matrix.

    Its eigenvalues span more than double precision where derivatives of all sizes meet.
    """
    root = np.transpose(np.linalg.qr(np.linalg.inv(np.linalg.qr(design, mode="r")).T, mode="r"))
    return np.asarray(root * np.sign(np.diag(root)))


@dataclass(frozen=True)
class Projection:
    r"""The projector :math:`M = I - J J^+` onto what the free parameters cannot explain.

    Parameters at an active bound are dropped; below the rows of the tests stand those of the prior and of the box
    (`Fitted.design`).

    Parameters
    ----------
    basis, triangle
        Q (rows, f) and R (f, f) of the QR decomposition of J.
    residual
        M r, (rows,).
    free
        Which parameters are free, (d,).
    """

    basis: FloatArray
    residual: FloatArray
    triangle: FloatArray
    free: NDArray[np.bool_]

    def apply(self, columns: FloatArray) -> FloatArray:
        """M times columns (m, k) on the rows of the tests; shape (rows, k)."""
        padded = np.zeros((len(self.basis), columns.shape[1]))
        padded[: len(columns)] = columns
        return padded - self.basis @ (self.basis[: len(columns)].T @ columns)

    def absorbed(self, column: FloatArray) -> FloatArray:
        """Shift of all parameters (d,), in unit coordinates, that compensates best for rows (m,) added to the data."""
        shift = np.zeros(len(self.free))
        shift[self.free] = np.linalg.solve(self.triangle, self.basis[: len(column)].T @ column)
        return shift

    @property
    def leverage(self) -> FloatArray:
        """Share of every row's noise that the parameters absorb, (rows,)."""
        return np.asarray(np.sum(self.basis**2, axis=1))


def project(fitted: Fitted) -> Projection:
    """The projector of a fitted hypothesis, with its residual."""
    basis, triangle = np.linalg.qr(fitted.design)
    residual = np.zeros(len(basis))
    residual[: len(fitted.residual)] = fitted.residual
    return Projection(basis, residual - basis @ (basis.T @ residual), triangle, fitted.free)


def set_up(
    model: Model,
    campaign: Campaign,
    settings: Settings,
    tests: Sequence[str] = (),
    simulators: SimulatorCache | None = None,
    space: ParameterSpace | None = None,
) -> tuple[WhitenedData, FloatArray]:
    """The whitened tests, and starts (k, d): the nominal point, and the best minima that the search finds.

    Parameters with a calibration start at its values.
    """
    return _started(set_up_problem(model, campaign, settings, tests, space=space), simulators)


def _whitened(setup: ProblemSetup, simulators: SimulatorCache | None) -> WhitenedData:
    return whiten(setup.posterior.main, setup.calibrations, simulators or SimulatorCache(setup.settings.jobs))


def _started(setup: ProblemSetup, simulators: SimulatorCache | None) -> tuple[WhitenedData, FloatArray]:
    problem, known = setup.posterior.main, calibrated_values(setup.calibrations)
    values = [known.get(p.name, p.nominal) for p in problem.space.parameters]
    found, _ = search(setup.searched, setup.settings)
    minima = setup.searched.layout.values(found.archived_points[:_MINIMA], problem.space.names)
    # of a simulator the best alone: descents from elsewhere cost more than they may find
    starts = np.vstack([values, minima]) if problem.evaluations is None else minima[:1]
    return _whitened(setup, simulators), np.clip(problem.space.to_unit(starts), 0.0, 1.0)


def fit(model: Hypothesis, starts: FloatArray, limit: float = np.inf) -> Fitted:
    """Refine from starts (K, d).

    ``limit`` is the sum of squares that counts: far above it a fit ends early, where hardly anything changes.

    Raises
    ------
    InputError
        If no start can be simulated.
    """
    settings = _FINE_REFINE if model.steps >= _FINE_STEPS else _REFINE
    best = best_minimum(model.evaluate, starts, settings, 0.5 * limit)
    here = model.linear(best.point[None])
    return Fitted(model, best, here.residual[0], here.jacobian[0])


def baseline_in_wide_ranges(
    model: Model,
    campaign: Campaign,
    settings: Settings,
    tests: Sequence[str] = (),
    simulators: SimulatorCache | None = None,
) -> tuple[Fitted, tuple[str, ...]]:
    """The model without effects, fitted in ranges wide enough for it; and what was widened or led in, in sentences."""
    cache = simulators or SimulatorCache(settings.jobs)
    setup = set_up_problem(model, campaign, settings, tests)
    observed, starts = _started(setup, cache)
    found, notes = fit_baseline(observed, starts, settings.seed), list[str]()
    point = found.minimum.point[: len(observed.problem.space)]
    if steady_from_start(setup.posterior.main):  # else the noise at the point is not worth its cost
        led = led_in(setup, setup.posterior.with_noise_at(point), replace(found.minimum, point=point))
        if led is not None:
            notes += leads_said(setup, led[0])
            setup, point = led
            found = fit_baseline(_whitened(setup, cache), point, settings.seed)
    first = space = found.hypothesis.observed.problem.space
    for _ in range(MOST):
        sides, values = found.minimum.at_bound[: len(space)], space.from_unit(found.minimum.point[: len(space)])
        farther = space.farther(sides)
        if farther == space:
            break
        known = setup.calibrations
        wider = set_up_problem(model, campaign, settings, tests, space=farther, done=known, leads=setup.leads)
        # the noise of the records stays
        same = replace(found.hypothesis.observed, problem=wider.posterior.main, calibrations=wider.calibrations)
        again = fit_baseline(same, beyond_ends(space, farther, values, sides), settings.seed)
        if found.minimum.value - again.minimum.value <= WORTH:
            break
        found, space = again, farther
    found = with_own_noise(_without_false_noise(found, settings.seed), settings.seed)
    return found, (*notes, *map(str, widenings(first, space)))


def _without_false_noise(found: Fitted, seed: int) -> Fitted:
    """The baseline with records that ring up, say, taken as ones that do not repeat.

    What changes there from period to period is no noise: the model follows it.
    """
    observed = found.hypothesis.observed
    signals, false = list(observed.problem.signals), False
    for i, (test, _, w) in enumerate(observed.records):
        residual = w.signal(found.residual[: len(observed.measured)][observed.record == i])
        if w.periods and np.mean(residual**2) < _FALSE * w.noise_sd**2:
            signals[test], false = replace(signals[test], period=None, periods=0), True
    if not false:
        return found
    problem = replace(observed.problem, signals=tuple(signals))
    again = whiten(problem, observed.calibrations, observed.simulators)
    return fit_baseline(again, found.minimum.point[: len(problem.space)], seed)


def with_own_noise(found: Fitted, seed: int) -> Fitted:
    """The baseline fitted again with the noise that it leaves of records that do not repeat."""
    for _ in range(_NOISE_ROUNDS if found.hypothesis.observed.predicted_only.any() else 0):
        found = fit_baseline(with_noise_of(found), found.minimum.point, seed)
    return found


def with_noise_of(found: Fitted) -> WhitenedData:
    """The tests with the noise that a fit leaves of records that do not repeat."""
    simulated = [outputs[0] for outputs, _ in found.hypothesis.outputs(found.minimum.point[None])]
    return with_noise_beside_prediction(found.hypothesis.observed, simulated)


def fit_baseline(observed: WhitenedData, starts: FloatArray, seed: int) -> Fitted:
    """Fit the model as it is, from starts (k, d) or one, and from Sobol points over parameters without calibration.

    They are those of the campaign; from each the others start at what is best there.
    """
    from scipy.stats import qmc  # late: its import takes half a second

    model, starts = hypothesis(observed), np.atleast_2d(starts)[:, : len(observed.problem.space)]
    start, searched = starts[0], np.ones(starts.shape[1], dtype=bool)
    searched[[model.space.index(name) for name in observed.problem.prior.names]] = False
    scattered = qmc.Sobol(len(start), rng=seed).random(_STARTS + 1)[:_STARTS]  # a power of two is balanced
    if observed.problem.evaluations is None:  # a simulator was searched
        starts = np.concatenate([starts, np.where(searched, scattered, start)])
    starts = with_scoped(model, starts)
    model = model.at_steps_for(starts[:1])
    with explained(observed.problem):
        first = fit(model, starts)
    # the minimum may be stiffer than the start
    model = model.at_steps_for(first.minimum.point[None])
    return fit(model, first.minimum.point[None]).without_tables()
