"""A case: what is identified, from which tests, and what it predicts."""

from __future__ import annotations

import json
import shutil
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import xarray as xr

from mofit._typing import FloatArray
from mofit.data import Campaign, import_files
from mofit.identification.identify import identify
from mofit.identification.settings import Settings
from mofit.models import Model
from mofit.problem import build_problem
from mofit.results import open_result, summary
from report_page import ROOT

#: of the band of a prediction, and its half-width in standard deviations
BAND, HALF_WIDTH = 0.90, 1.645
#: draws that a prediction is made from
DRAWS = 100


@dataclass(frozen=True)
class Case:
    """One identification, the records that it predicts, and the figures wanted."""

    name: str
    title: str
    model: type[Model]
    campaign: Callable[[Path], Campaign]
    fitted: Callable[[str], bool]
    """Whether a test is identified from, by its name."""
    predicted: tuple[str, ...] = ()
    unit: tuple[str, float] = ("", 1.0)
    """Unit of the errors, and its number per SI unit."""
    wanted: str = ""
    evaluations: int | None = None
    scopes: dict[str, str] = field(default_factory=dict)
    remark: str = ""
    """What is to be said of the figures wanted."""

    def settings(self, seed: int) -> Settings:
        """Those of the identification; all else is as shipped."""
        return Settings(seed=seed, evaluations=self.evaluations, scopes=self.scopes)


def imported(data: Path, name: str) -> Campaign:
    """The records of a folder by the shipped map of the same name."""
    return import_files([data / name], ROOT / "data" / "maps" / f"{name}.toml")


def with_inputs(interpolation: str, campaign: Campaign) -> Campaign:
    """Inputs straight (``linear``) or held (``hold``) between samples: splines overshoot at the steps of a motor."""
    changed = (
        replace(one, experiment=replace(one.experiment, interpolation=interpolation)) for one in campaign.measurements
    )
    return replace(campaign, measurements=tuple(changed))


def run(case: Case, data: Path, work: Path, seed: int) -> dict:
    """The row of a case: made now, or found in the work folder."""
    row = work / f"{case.name}-{seed}.json"
    if row.exists():
        return json.loads(row.read_text(encoding="utf-8"))
    folder = work / f"{case.name}-{seed}"
    for rest in (folder, folder.with_name(f"{folder.name}.partial")):  # a resumed run has no time of its own
        shutil.rmtree(rest, ignore_errors=True)
    campaign = case.campaign(data)
    tests = tuple(filter(case.fitted, campaign.tests))
    began = time.process_time()
    _, tree = identify(campaign, case.model(), case.settings(seed), tests=tests, out=folder)
    seconds = time.process_time() - began
    found = {"cpu": seconds, **summary(open_result(folder), folder)}
    found["fit"] = _fit(tree, case, tests)
    found["predictions"] = {
        test: prediction(case.model(), campaign.select([test]), tree, case.unit[1]) for test in case.predicted
    }
    row.write_text(json.dumps(found), encoding="utf-8")
    return found


def _fit(tree: xr.DataTree, case: Case, tests: Sequence[str]) -> dict[str, float]:
    """Root mean squares over all samples of all tests: of the error, and of its share of each test's range."""
    errors, shares = [], []
    for test in tests:
        measured, judged = tree["observed_data"][test].values, tree["constant_data"][f"{test}_weight"].values > 0
        error = (tree["modes/m1/prediction"][test].values - measured)[judged]
        errors.append(error * case.unit[1])
        shares.append(100 * error / np.ptp(measured))
    return {"rms": _rms(np.concatenate(errors)), "nrmsd": _rms(np.concatenate(shares))}


def prediction(model: Model, campaign: Campaign, tree: xr.DataTree, scale: float) -> dict[str, float]:
    """Errors on a record that was not identified from: at the best point, of the mean of draws, and its band.

    The band is that of the draws together with the residual of the identified tests, as a share of the range.
    """
    problem = build_problem(model, campaign)
    best, draws = tree["modes/m1"].dataset["value"], tree["modes/m1/posterior"].dataset
    names = problem.space.names
    values = np.stack([draws[name].values.ravel() for name in names], axis=1)
    chosen = values[np.linspace(0, len(values) - 1, min(DRAWS, len(values))).astype(int)]
    points = [[best.sel(parameter=name).item() for name in names], *chosen]
    response = problem.simulator.simulate(problem.layout.full(problem.space.to_unit(np.array(points))))[0][..., 0]
    (test,), channel = campaign.measurements, model.outputs[0].name
    measured = test.channel(channel)
    judged = problem.experiments[0].weights[:, 0] > 0
    return {key: float(value) for key, value in _judged(response, measured, judged, tree, scale).items()}


def _judged(
    response: FloatArray, measured: FloatArray, judged: FloatArray, tree: xr.DataTree, scale: float
) -> dict[str, float]:
    error, span = (response - measured)[:, judged], np.ptp(measured)
    mean, sd = np.nanmean(error[1:], axis=0), np.nanstd(error[1:], axis=0)
    noise = span * float(np.sqrt(np.mean(np.square(tree["modes/m1"].dataset["nrmsd"].values))))
    return {
        "rms": scale * _rms(error[0]),
        "nrmsd": 100 * _rms(error[0]) / span,
        "rms_of_mean": scale * _rms(mean),
        "nrmsd_of_mean": 100 * _rms(mean) / span,
        "covered": 100 * np.mean(np.abs(mean) <= HALF_WIDTH * np.hypot(sd, noise)),
    }


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
