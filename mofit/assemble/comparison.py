"""What the result is held against: each test alone, the baseline model, the calibration stages."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mofit.assemble.signals import predictions
from mofit.calibration import Calibration
from mofit.labels import title_of
from mofit.outcome import Fit, Outcome
from mofit.parameters import ParameterSpace
from mofit.problem import Problem
from mofit.refine import Minimum
from mofit.result import OWN_UNIT, axis, parameter_axis, quantity
from mofit.sample import laplace_covariance

Array = NDArray[np.float64]

#: Table 4 of the paper lists three minima per frequency.
MINIMA_PER_TEST = 3


def laplace_sd(problem: Problem, minimum: Minimum) -> Array:
    """Standard deviation per parameter at a minimum; no wider than the box allows (variance 1/12)."""
    spread = np.sqrt(np.diag(laplace_covariance(minimum.hessian)))
    return np.asarray(spread * problem.space.slope(problem.space.from_unit(minimum.point)))


def per_frequency(space: ParameterSpace, fits: Mapping[str, Fit]) -> xr.Dataset:
    """Minima of each test alone, in the layout of the paper's Table 4."""
    tests = list(fits)
    shape = (len(tests), MINIMA_PER_TEST, len(space))
    value, sd, nrmsd = np.full(shape, np.nan), np.full(shape, np.nan), np.full(shape[:2], np.nan)
    for row, test in enumerate(tests):
        fit = fits[test]
        for column, minimum in enumerate(fit.minima[:MINIMA_PER_TEST]):
            value[row, column] = space.from_unit(minimum.point)
            sd[row, column] = laplace_sd(fit.problem, minimum)
            nrmsd[row, column] = fit.problem.objectives(minimum.point[None])[0, 0]
    return xr.Dataset(
        {
            "value": quantity(("test", "minimum", "parameter"), value, OWN_UNIT, "minimum of this test alone"),
            "sd": quantity(("test", "minimum", "parameter"), sd, OWN_UNIT, "standard deviation (Laplace)"),
            "nrmsd": quantity(("test", "minimum"), nrmsd, "1", "NRMSD of this test"),
        },
        {"test": axis("test", tests), **parameter_axis(space.names, space.units)},
    )


def baseline_groups(fit: Fit) -> dict[str, xr.Dataset]:
    """The baseline model's best minimum, its NRMSD and its simulated outputs."""
    problem, best = fit.problem, fit.minima[0]
    values = problem.full(best.point[None])[0]
    model = problem.model
    group = xr.Dataset(
        {
            "value": quantity("parameter_baseline", values, OWN_UNIT, "refined minimum"),
            "nrmsd": quantity("test", problem.objectives(best.point[None])[0], "1", "NRMSD per test"),
        },
        {
            **parameter_axis(problem.system.parameters, (p.unit for p in model.parameters), "parameter_baseline"),
            "test": axis("test", list(problem.tests)),
        },
        {"model": model.name, "model_title": model.title or model.name},
    )
    return {"/baseline": group, "/baseline/prediction": predictions(problem, best.point)}


def calibration_groups(outcome: Outcome) -> dict[str, xr.Dataset]:
    """One group per stage, with the fitted curve."""
    return {f"/calibration/{c.stage.name}": _stage(c) for c in outcome.calibrations}


def _stage(calibration: Calibration) -> xr.Dataset:
    problem, name = calibration.problem, calibration.stage.name
    dimension = f"parameter_{name}"
    source, output = problem.model.inputs[0], problem.model.outputs[0]
    used = [drive.weights[:, 0] > 0 for drive in problem.drives]
    simulated = problem.simulate(calibration.minimum[None])

    def joined(parts: list[Array]) -> Array:
        return np.concatenate([part[mask] for part, mask in zip(parts, used, strict=True)])

    return xr.Dataset(
        {
            "value": quantity(dimension, list(calibration.values.values()), OWN_UNIT, "estimate"),
            "sd": quantity(dimension, list(calibration.sd.values()), OWN_UNIT, "standard deviation"),
            "x": quantity(
                "sample",
                joined([d.inputs[:, 0] for d in problem.drives]),
                source.unit,
                title_of(source.name, source.description),
            ),
            "measured": quantity(
                "sample",
                joined([d.measured[:, 0] for d in problem.drives]),
                output.unit,
                title_of(output.name, output.description),
            ),
            "fitted": quantity(
                "sample",
                joined([s[0, :, 0] for s in simulated]),
                output.unit,
                f"fitted {title_of(output.name, output.description)}",
            ),
            "nrmsd": quantity(
                (),
                float(np.mean(problem.objectives(calibration.minimum[None]))),
                "1",
                "mean NRMSD of the stage",
            ),
        },
        parameter_axis(problem.space.names, problem.space.units, dimension),
        {"model": problem.model.name, "tests": ", ".join(problem.tests)},
    )
