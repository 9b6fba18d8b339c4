"""Fits of a hypothesis."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from mofit._typing import FloatArray
from mofit.diagnosis.few_periods import FewPeriods, at_steps_for, few_periods, in_whole_rows, with_residual
from mofit.diagnosis.hypothesis import Hypothesis
from mofit.diagnosis.limited_refinement import HOPELESS, best_minimum, minima
from mofit.diagnosis.remembered import Remembered
from mofit.diagnosis.whitened_data import WhitenedData
from mofit.errors import InputError
from mofit.identification.widening import MOST, WORTH, beyond_ends
from mofit.optimize import Minimum, RefineSettings

#: A refit ends 0.02 standard deviations from the minimum: criteria differ by far more than the 1e-3 that it leaves.
#: Where steps a thousandth as long as Newton's fail, derivatives and values disagree: shorter steps gain nothing.
#: So many iterations are for curved valleys: with a limit, a fit that leads nowhere ends by its pace (`best_minimum`).
_REFINE = RefineSettings(max_iterations=200, gradient_tolerance=0.02, decrease_tolerance=1e-3, most_damping=1e3)
#: Largest difference between the squares by a few periods and those by all of a model that repeats, relative to these.
_SAME = 0.05
#: Share of what the fit beside lacks of the limit: what by a few periods lacks more cannot reach it.
_FAR = 0.1


@dataclass(frozen=True, eq=False)
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


def fit(
    model: Hypothesis,
    starts: FloatArray,
    limit: float = np.inf,
    beside: Fitted | None = None,
    least: float = 0.0,
    known: float = np.inf,
    repeats: bool = False,
) -> Fitted:
    """Refine from starts (K, d).

    Parameters
    ----------
    limit
        Sum of squares that counts: far above it a fit ends early, where hardly anything changes.
    beside
        A fit of another model to the same tests.
    least
        Share of its value that a fit with a limit must gain over some iterations.
    known
        Value that a fit with a limit must fall below to be of use.
    repeats
        Whether what is simulated is known to repeat with the tests: then a few periods of each may show that the limit
        is far, and all are not simulated.

    Raises
    ------
    InputError
        If no start can be simulated.
    """
    settings, whole = _REFINE, Remembered(model)
    few, near = _few_periods(model, beside) if len(starts) > 1 else None, None
    brief = None if few is None else Remembered(few.hypothesis)
    if few and brief and (found := _briefly(brief, few.left_out, starts, settings, 0.5 * limit, least, known)):
        if repeats and beside is not None and _is_far(found[0].value + few.left_out, 0.5 * limit, beside):
            return _repeated(model, brief, found[0], beside)
        near = _near_minimum(whole, few, found if beside is None else found[:1])
    if near is None:
        best = best_minimum(whole.evaluate, starts, settings, 0.5 * limit, least, known)
    else:
        if near.value > 0.5 * limit and not near.converged:  # it was given up
            settings = replace(settings, max_iterations=0)
        best = best_minimum(whole.evaluate, near.point[None], settings, 0.5 * limit, least, known)
        best = replace(best, members=near.members)
    return Fitted(model, best, *whole.linear(best.point))


def _briefly(
    brief: Remembered,
    left_out: float,
    starts: FloatArray,
    settings: RefineSettings,
    limit: float,
    least: float,
    known: float,
) -> Sequence[Minimum]:
    """Minima where a few periods of every test count, the best first; none if no start can be simulated."""
    try:
        found = minima(brief.evaluate, starts, settings, limit - left_out, least, known - left_out)
    except InputError:
        return []
    return sorted(found, key=lambda one: one.value)


def _near_minimum(model: Remembered, few: FewPeriods, found: Sequence[Minimum]) -> Minimum | None:
    """The best minimum of a few periods of every test, with its value where all count.

    It is near that of all, at a fraction of the cost. None where what is simulated does not repeat. Without a fit
    beside, few periods may tell otherwise of some minima alone: all periods tell which is best.
    """
    values = model.evaluate(np.array([one.point for one in found]))[0]
    best = int(np.argmin(np.where(np.isfinite(values), values, np.inf)))
    whole, expected = float(values[best]), found[best].value + few.left_out
    return replace(found[best], value=whole) if abs(whole - expected) <= _SAME * whole else None


def _is_far(value: float, limit: float, beside: Fitted) -> bool:
    """Whether a value by a few periods is so far above the limit that all periods would not change that.

    They tell it where they tell the same of the fit beside.
    """
    known = of_few_periods(beside) is not beside
    return known and value - limit > max(_FAR * (beside.minimum.value - limit), 0.0)


def _repeated(model: Hypothesis, brief: Remembered, found: Minimum, beside: Fitted) -> Fitted:
    """What a few periods tell of a minimum, for all periods: nothing more is simulated."""
    short, (left, columns) = brief.hypothesis.observed, brief.linear(found.point)
    rows, kept = len(model.observed.measured), len(short.measured)
    known = of_few_periods(beside).residual[:kept]
    moved = np.column_stack([left[:kept] - known, columns[:kept]]).T
    change, *slopes = in_whole_rows(short, model.observed, moved)
    residual = np.concatenate([beside.residual[:rows] + change, left[kept:]])
    jacobian = np.concatenate([np.transpose(slopes), columns[kept:]])
    return Fitted(model, replace(found, value=0.5 * float(residual @ residual)), residual, jacobian)


def _few_periods(model: Hypothesis, beside: Fitted | None) -> FewPeriods | None:
    """The model where a few periods of every test count; what they leave out is taken from a fit beside, if any."""
    few = few_periods(model)
    if few is None or beside is None:
        return few
    brief = of_few_periods(beside)
    if brief is beside:
        return few
    moved = replace(few.hypothesis, observed=brief.hypothesis.observed)
    return FewPeriods(moved, beside.minimum.value - brief.minimum.value)


def of_few_periods(fitted: Fitted) -> Fitted:
    """The fit where a few periods of every test count; itself where that saves little, or where they tell otherwise."""
    if fitted not in _of_few:
        _of_few[fitted] = _in_few_periods(fitted)
    return _of_few[fitted] or fitted


#: Of a fit: many models are fitted beside it.
_of_few: WeakKeyDictionary[Fitted, Fitted | None] = WeakKeyDictionary()


def _in_few_periods(fitted: Fitted) -> Fitted | None:
    model, point, whole = fitted.hypothesis, fitted.minimum.point[None], fitted.minimum.value
    few = few_periods(model)
    if few is None:
        return None
    residual = few.hypothesis.linear(point).residual[0]
    if not abs(0.5 * float(np.sum(residual**2)) + few.left_out - whole) <= _SAME * whole:
        return None
    return _with_same_residual(few.hypothesis, residual, fitted)


def averaged_over_periods(fitted: Fitted) -> Fitted:
    """The fit where a few periods of every test count, also where it changes from period to period.

    What it leaves of them is the average of what it leaves of all; itself where that saves little.
    """
    few = few_periods(fitted.hypothesis, changing=True)
    if few is None:
        return fitted
    return _with_same_residual(few.hypothesis, few.hypothesis.linear(fitted.minimum.point[None]).residual[0], fitted)


def _with_same_residual(few: Hypothesis, present: FloatArray, fitted: Fitted) -> Fitted:
    """A fit in few periods, of tests moved so that the residual, ``present`` now, is the average of all periods'."""
    rows, kept, point = len(fitted.hypothesis.observed.measured), len(few.observed.measured), fitted.minimum.point[None]
    own, whole = few.observed, fitted.hypothesis.observed
    brief = replace(few, observed=with_residual(own, whole, fitted.residual[:rows], present[:kept]))
    here = brief.linear(point)
    value = 0.5 * float(np.sum(here.residual**2))
    return Fitted(brief, replace(fitted.minimum, value=value), here.residual[0], here.jacobian[0])


def fit_to(observed: WhitenedData, fitted: Fitted, limit: float = np.inf) -> Fitted:
    """The same model fitted to the tests with another noise, from where it is; the stages stay as they are.

    ``limit`` is that of `fit`.
    """
    here, old = fitted.minimum.point[None], fitted.hypothesis
    model = replace(old, observed=observed)
    if np.any(observed.variance < old.observed.variance):  # what was fine enough for less noise is for more
        model = at_steps_for(model, here, old.steps)
    return fit(model, here, limit)


def in_wider_ranges(found: Fitted, limit: float) -> Fitted:
    """The fit in ranges of the effects' parameters wide enough for it; as it is where they are.

    ``limit`` is that of `fit`.
    """
    for _ in range(MOST):
        here, sides = found.hypothesis, found.minimum.at_bound
        wider = here.wider(sides)
        if wider is None:
            break
        starts = beyond_ends(here.space, wider.space, here.space.from_unit(found.minimum.point), sides)
        value = found.minimum.value
        known = value - max(WORTH, HOPELESS * (value - 0.5 * limit))
        again = fit(wider, starts, limit, found, known=known)
        if again.minimum.value >= known:
            break
        found = again
    return found
