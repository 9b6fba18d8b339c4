"""What the result is compared with: fits of each test alone, the baseline model, the calibration stages."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr

from mofit._typing import FloatArray
from mofit.identification.calibration import Calibration
from mofit.identification.result import IdentificationResult, LocalFit
from mofit.identification.result_tree.modes import laplace_sd
from mofit.identification.result_tree.outputs import over_tests, simulated_signals, test_axes
from mofit.problem import Problem
from mofit.quantities import title_of
from mofit.results import group_dataset, parameter_axis

#: Table 4 of the paper lists three minima per frequency.
MINIMA_PER_TEST = 3


def per_frequency(problem: Problem, fits: Mapping[str, LocalFit]) -> xr.Dataset:
    """Minima of each test of a problem alone, in the layout of the paper's Table 4."""
    space, whole = problem.space, over_tests(problem, problem.noise.count)
    shape = (len(fits), MINIMA_PER_TEST, len(space))
    value, sd = np.full(shape, np.nan), np.full(shape, np.nan)
    nrmsd = np.full((*shape[:2], *whole.shape[1:]), np.nan)
    for row, test in enumerate(problem.tests):
        fit = fits[test]
        for column, minimum in enumerate(fit.minima[:MINIMA_PER_TEST]):
            value[row, column] = space.from_unit(minimum.point)
            sd[row, column] = laplace_sd(space, minimum.point, minimum.hessian)
            nrmsd[row, column] = over_tests(fit.problem, fit.problem.objectives(minimum.point[None]))[0, 0]
    return group_dataset(
        "/per_frequency",
        {"value": value, "sd": sd, "nrmsd": nrmsd},
        {**test_axes(problem), **parameter_axis(space.names, space.units)},
    )


def baseline_groups(fit: LocalFit, main: Problem) -> dict[str, xr.Dataset]:
    """The baseline model's best minimum, its NRMSD and its simulated outputs, on the axes of the main one."""
    problem, best, outputs = fit.problem, fit.minima[0], main.model.outputs
    found = over_tests(problem, problem.objectives(best.point[None])[0], outputs)
    nrmsd = np.full((len(main.tests), *found.shape[1:]), np.nan)
    nrmsd[[main.tests.index(test) for test in problem.tests]] = found
    values = problem.layout.full(best.point[None])[0]
    model = problem.model
    group = group_dataset(
        "/baseline",
        {"value": values, "nrmsd": nrmsd},
        {
            **parameter_axis(problem.system.parameters, (p.unit for p in model.parameters), "parameter_baseline"),
            **test_axes(main),
        },
        {"model": model.name, "model_title": model.title or model.name},
    )
    # computed now: what is needed for it is not kept
    return {"/baseline": group, "/baseline/prediction": simulated_signals(problem, best.point, outputs).load()}


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
            "x": joined([experiment.inputs[experiment.lead :, 0] for experiment in problem.experiments]),
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
