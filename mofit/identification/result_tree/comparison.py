"""What the result is compared with: fits of each test alone, the baseline model, the calibration stages."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr

from mofit._typing import FloatArray
from mofit.identification.calibration import Calibration
from mofit.identification.result import IdentificationResult, LocalFit
from mofit.identification.result_tree.modes import laplace_sd, predictions
from mofit.parameters import ParameterSpace
from mofit.quantities import title_of
from mofit.results import axis, group_dataset, parameter_axis

#: Table 4 of the paper lists three minima per frequency.
MINIMA_PER_TEST = 3


def per_frequency(space: ParameterSpace, fits: Mapping[str, LocalFit]) -> xr.Dataset:
    """Minima of each test alone, in the layout of the paper's Table 4."""
    tests = list(fits)
    shape = (len(tests), MINIMA_PER_TEST, len(space))
    value, sd, nrmsd = np.full(shape, np.nan), np.full(shape, np.nan), np.full(shape[:2], np.nan)
    for row, test in enumerate(tests):
        fit = fits[test]
        for column, minimum in enumerate(fit.minima[:MINIMA_PER_TEST]):
            value[row, column] = space.from_unit(minimum.point)
            sd[row, column] = laplace_sd(space, minimum.point, minimum.hessian)
            nrmsd[row, column] = fit.problem.objectives(minimum.point[None])[0, 0]
    return group_dataset(
        "/per_frequency",
        {"value": value, "sd": sd, "nrmsd": nrmsd},
        {"test": axis("test", tests), **parameter_axis(space.names, space.units)},
    )


def baseline_groups(fit: LocalFit) -> dict[str, xr.Dataset]:
    """The baseline model's best minimum, its NRMSD and its simulated outputs."""
    problem, best = fit.problem, fit.minima[0]
    values = problem.layout.full(best.point[None])[0]
    model = problem.model
    group = group_dataset(
        "/baseline",
        {"value": values, "nrmsd": problem.objectives(best.point[None])[0]},
        {
            **parameter_axis(problem.system.parameters, (p.unit for p in model.parameters), "parameter_baseline"),
            "test": axis("test", list(problem.tests)),
        },
        {"model": model.name, "model_title": model.title or model.name},
    )
    return {"/baseline": group, "/baseline/prediction": predictions(problem, best.point)}


def calibration_groups(outcome: IdentificationResult) -> dict[str, xr.Dataset]:
    """One group per stage, with the fitted curve."""
    return {f"/calibration/{c.stage.name}": _stage(c) for c in outcome.calibrations}


def _stage(calibration: Calibration) -> xr.Dataset:
    problem, name = calibration.problem, calibration.stage.name
    source, output = problem.model.inputs[0], problem.model.outputs[0]
    used = [experiment.weights[:, 0] > 0 for experiment in problem.experiments]

    def joined(parts: list[FloatArray]) -> FloatArray:
        return np.concatenate([part[mask] for part, mask in zip(parts, used, strict=True)])

    title = title_of(output.name, output.description)
    return group_dataset(
        f"/calibration/{name}",
        {
            "value": list(calibration.values.values()),
            "sd": list(calibration.sd.values()),
            "x": joined([experiment.inputs[:, 0] for experiment in problem.experiments]),
            "measured": joined([experiment.measured[:, 0] for experiment in problem.experiments]),
            "fitted": joined([values[0, :, 0] for values in problem.simulate(calibration.minimum[None])]),
            "nrmsd": float(np.mean(problem.objectives(calibration.minimum[None]))),
        },
        parameter_axis(problem.space.names, problem.space.units, f"parameter_{name}"),
        {"model": problem.model.name, "tests": ", ".join(problem.tests)},
        units={"x": source.unit, "measured": output.unit, "fitted": output.unit},
        long_names={
            "x": title_of(source.name, source.description),
            "measured": title,
            "fitted": f"fitted {title}",
        },
    )
