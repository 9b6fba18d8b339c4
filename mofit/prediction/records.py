"""Predicted records: what a run says of the outputs of a test, beside what was measured."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mofit._typing import FloatArray
from mofit.data import Campaign, Measurement
from mofit.errors import raise_errors
from mofit.models import Model
from mofit.prediction.band import Band, Score, band, score
from mofit.prediction.response import Identified
from mofit.prediction.scoped import ScopedValue
from mofit.prediction.transfer import Transferred, transferred
from mofit.runtime.progress import Progress, silent
from mofit.simulation import lacking, measured_outputs

#: Roles of a record.
PREDICTED, HELD_OUT, FITTED = "predicted", "held out", "fitted"


@dataclass(frozen=True)
class Prediction:
    """A predicted test; bands, scores and parts per output of the model, in SI units."""

    measurement: Measurement
    role: str
    draws: int
    bands: tuple[Band, ...]
    scores: tuple[Score, ...]
    measured: FloatArray
    """Shape (n, ny); nan where an output was not measured."""
    scored: NDArray[np.bool_]
    """Samples that count, (n, ny)."""
    noise_sd: tuple[float, ...]
    model_error: tuple[float, ...]
    scoped: tuple[ScopedValue, ...]


def predict_records(
    tree: xr.DataTree,
    model: Model,
    campaign: Campaign,
    *,
    fitted: Sequence[str] = (),
    role: str = PREDICTED,
    jobs: int = 1,
    progress: Progress = silent,
) -> list[Prediction]:
    """Predictions of all tests of a campaign, each for itself; those ``fitted`` have that role.

    Raises
    ------
    InputError
        With every channel and condition that a test lacks.
    """
    raise_errors(lacking(model, campaign, outputs_too=False))
    source, known = Identified(tree, model, jobs), transferred(tree, model.outputs)
    found = []
    for number, measurement in enumerate(campaign.measurements):
        progress("predict", number, len(campaign.measurements), measurement.name)
        own = FITTED if measurement.name in fitted else role
        found.append(_predicted(source, known, measurement, own))
    progress("predict", len(found), len(found), "")
    return found


def _predicted(source: Identified, known: Transferred, measurement: Measurement, role: str) -> Prediction:
    response = source.response(measurement)
    draws, names = response.outputs, [channel.name for channel in source.model.outputs]
    have = measured_outputs(source.model, measurement)
    measured = np.full(draws.shape[1:], np.nan)
    scored = response.experiment.weights > 0
    bands, scores, noise_sd, model_error = [], [], [], []
    for k, name in enumerate(names):
        extent = float(np.ptp(np.median(draws[..., k], axis=0)))
        noise_sd.append(known.noise[k].sd(extent))
        model_error.append(known.gap * extent)
        if name in have:
            measured[:, k] = measurement.channel(name)
        bands.append(band(draws[..., k], float(np.hypot(noise_sd[-1], model_error[-1]))))
        scores.append(score(bands[-1], measured[:, k], scored[:, k]))
    return Prediction(
        measurement=measurement,
        role=role,
        draws=len(draws),
        bands=tuple(bands),
        scores=tuple(scores),
        measured=measured,
        scored=scored,
        noise_sd=tuple(noise_sd),
        model_error=tuple(model_error),
        scoped=response.scoped,
    )
