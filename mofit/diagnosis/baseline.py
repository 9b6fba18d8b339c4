"""The model without effects, fitted: what everything else is compared with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mofit.calibration import calibrate, calibrated_values
from mofit.campaign import Campaign
from mofit.diagnosis.hypothesis import Hypothesis, hypothesis
from mofit.diagnosis.observed import Observed, observe
from mofit.diagnosis.workshop import Workshop
from mofit.errors import InputError
from mofit.model import Model
from mofit.posing import choose_tests, main_problem
from mofit.problem import Problem
from mofit.refine import Minimum, RefineSettings, merge, refine
from mofit.settings import Settings, free_space
from mofit.sobol import sobol

Array = NDArray[np.float64]

#: Starts of the baseline beside the nominal values; with them as many as lanes.
STARTS = 7
#: A refit ends 0.02 standard deviations from the minimum: criteria differ by far more than the 1e-3 that it leaves.
#: Where steps a thousandth as long as Newton's fail, the slopes do not fit the values: shorter ones gain nothing.
_SETTINGS = RefineSettings(max_iterations=40, gradient_tolerance=0.02, decrease_tolerance=1e-3, most_damping=1e3)
#: The same where integration takes most of the time, four points as fast as one; and steps from which on it does.
_FINE_SETTINGS, _FINE = replace(_SETTINGS, lanes=4, max_iterations=20), 8


@dataclass(frozen=True)
class Fitted:
    """A hypothesis at its minimum.

    Parameters
    ----------
    hypothesis
        What was fitted.
    minimum
        The best point; its value is half the sum of all white squares, prior included.
    residual, jacobian
        There, (m + p,) and (m + p, d); see `mofit.diagnosis.hypothesis.Linear`.
    """

    hypothesis: Hypothesis
    minimum: Minimum
    residual: Array
    jacobian: Array

    @property
    def values(self) -> dict[str, float]:
        """Estimate per free parameter."""
        space = self.hypothesis.space
        return dict(zip(space.names, map(float, space.from_unit(self.minimum.point)), strict=True))

    @property
    def free(self) -> NDArray[np.bool_]:
        """Parameters that are not pressed against a bound, (d,)."""
        return np.asarray(self.minimum.at_bound == 0)

    def put_away(self) -> Fitted:
        """The same with the memory given back that speeds up further fits."""
        return replace(self, hypothesis=replace(self.hypothesis, simulator=self.hypothesis.simulator.without_tables()))

    def slopes(self, free: NDArray[np.bool_]) -> Array:
        """Of the simulated rows by the free parameters, (m + p, f), and below them the box, (f, f).

        A row per parameter of unit weight in box widths keeps a flat direction finite.
        """
        return np.concatenate([-self.jacobian[:, free], np.eye(int(free.sum()))])

    def sd(self, free: NDArray[np.bool_] | None = None) -> Array:
        """Standard deviation of every parameter in unit coordinates, (d,); 0 at a bound."""
        free = self.free if free is None else free
        spread = np.zeros(len(free))
        # not from their squares: slopes of all sizes meet here
        root = np.linalg.inv(np.linalg.qr(self.slopes(free), mode="r"))
        spread[free] = np.linalg.norm(root, axis=1)
        return spread


def pose(
    model: Model,
    campaign: Campaign,
    settings: Settings,
    tests: Sequence[str] = (),
    workshop: Workshop | None = None,
) -> tuple[Observed, Array]:
    """The tests made white, and a point (d,) of the problem's space: nominal, calibrated values where there are any."""
    space = free_space(model, settings)
    calibrations, _ = calibrate(model, campaign, space, seed=settings.seed, jobs=settings.jobs)
    selected = campaign.select(choose_tests(model, campaign, tuple(tests)))
    problem = main_problem(model, selected, space, calibrations, settings)
    assert isinstance(problem, Problem)
    known = calibrated_values(calibrations)
    values = [known.get(p.name, p.nominal) for p in problem.space.parameters]
    return observe(problem, calibrations, workshop or Workshop(settings.jobs)), np.clip(
        problem.space.to_unit(values), 0.0, 1.0
    )


def fit(model: Hypothesis, starts: Array) -> Fitted:
    """Refine from starts (K, d).

    Raises
    ------
    InputError
        If no start can be simulated.
    """
    settings = _FINE_SETTINGS if (model.simulator.steps or 1) >= _FINE else _SETTINGS
    found = merge(refine(model.evaluate, np.clip(starts, 0.0, 1.0), settings))
    if not found:
        raise InputError.of("diagnosis", "every start failed", "Check the model, or narrow the bounds")
    here = model.linear(found[0].point[None])
    return Fitted(model, found[0], here.residual[0], here.jacobian[0])


def fit_baseline(observed: Observed, start: Array, seed: int) -> Fitted:
    """Fit the model as it is, from a start (d,) and from Sobol points over what the calibration does not know."""
    model = hypothesis(observed)
    dimension = len(start)
    searched = np.ones(dimension, dtype=bool)
    if observed.problem.prior is not None:
        searched[[model.space.index(name) for name in observed.problem.prior.names]] = False
    scattered = sobol(dimension, seed).random(STARTS)
    starts = np.concatenate([start[None], np.where(searched, scattered, start)])
    model = model.at_steps_for(start[None])
    first = fit(model, starts)
    # the minimum may be stiffer than the start
    model = model.at_steps_for(first.minimum.point[None])
    return fit(model, first.minimum.point[None]).put_away()
