"""Predictions as labelled groups: those of a prediction file, and those of tests held out in a result."""

from __future__ import annotations

import json
from collections.abc import Sequence
from datetime import UTC, datetime

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from mofit import __version__
from mofit._typing import FloatArray
from mofit.data import Campaign
from mofit.models import Model
from mofit.prediction.records import FITTED, Prediction
from mofit.prediction.transfer import transferred
from mofit.quantities import title_of
from mofit.results import OUTPUT_UNIT, axis, group_dataset, quantity
from mofit.simulation import first_input

SCHEMA = "mofit.prediction/1"
#: Place of the groups in a result; in a prediction file they stand at the root.
PLACE = "/held_out"
_SIGNALS = ("median", "parameter_low", "parameter_high", "low", "high")
_TABLE_UNITS = ("rms", "range", "parameter_sd", "noise_sd", "model_error")


def prediction_tree(
    tree: xr.DataTree, model: Model, campaign: Campaign, predictions: Sequence[Prediction]
) -> xr.DataTree:
    """The tree of a prediction file (``mofit.prediction/1``)."""
    groups = prediction_groups(tree, model, predictions)
    root = groups.pop(PLACE)
    root.attrs = {
        "schema": SCHEMA,
        "title": f"{tree.attrs['title']}: prediction of {campaign.title}",
        "mofit_version": __version__,
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        **{key: tree.attrs[key] for key in ("model", "model_title", "configuration_hash", "converged", "seed")},
        "run_title": tree.attrs["title"],
        "campaign_title": campaign.title,
        "campaign_source": campaign.source,
        "campaign_hash": campaign.hash(),
        **root.attrs,
    }
    return xr.DataTree.from_dict({"/": root, **{path.removeprefix(PLACE): own for path, own in groups.items()}})


def prediction_groups(tree: xr.DataTree, model: Model, predictions: Sequence[Prediction]) -> dict[str, xr.Dataset]:
    """The table ``/held_out`` of all predictions, and a group of signals for each that was not fitted."""
    several = len(model.outputs) > 1
    unit = OUTPUT_UNIT if several else model.outputs[0].unit
    outputs = _output_axis(model) if several else {}

    def over_outputs(values: Sequence[Sequence[float]]) -> FloatArray:
        found = np.array(values, dtype=float)
        return found if several else found[:, 0]

    table: dict[str, ArrayLike] = {
        "role": [one.role for one in predictions],
        "scored_from": [_scored_from(one) for one in predictions],
        **{
            name: over_outputs([[getattr(own, name) for own in one.scores] for one in predictions])
            for name in ("nrmsd", "rms", "coverage")
        },
        "range": over_outputs([[float(np.ptp(own.median)) for own in one.bands] for one in predictions]),
        "parameter_sd": over_outputs([[own.parameter_sd for own in one.bands] for one in predictions]),
        "noise_sd": over_outputs([one.noise_sd for one in predictions]),
        "model_error": over_outputs([one.model_error for one in predictions]),
    }
    axes = {"record": axis("record", [one.measurement.name for one in predictions]), **outputs}
    root = group_dataset(
        PLACE, table, axes, _attributes(tree, model, predictions), units=dict.fromkeys(_TABLE_UNITS, unit)
    )
    shown = [one for one in predictions if one.role != FITTED]
    return {
        PLACE: root,
        **{f"{PLACE}/tests/{one.measurement.name}": _signals(one, model, outputs, unit) for one in shown},
    }


def _attributes(tree: xr.DataTree, model: Model, predictions: Sequence[Prediction]) -> dict[str, object]:
    known = transferred(tree, model.outputs)
    noise = {
        channel.name: {"as": own.kind, "value": own.value, "unit": channel.unit if own.kind == "units" else "1"}
        for channel, own in zip(model.outputs, known.noise, strict=True)
    }
    scoped = {
        one.measurement.name: {own.parameter.name: own.source for own in one.scoped}
        for one in predictions
        if one.scoped
    }
    modes = tree["modes"].children.values()
    return {
        "draws": max((one.draws for one in predictions), default=0),
        "spread": "sampled" if all("posterior" in mode.children for mode in modes) else "Laplace",
        "gap": known.gap,
        "noise": json.dumps(noise),
        "scoped": json.dumps(scoped),
    }


def _signals(one: Prediction, model: Model, outputs: dict[str, xr.Variable], unit: str) -> xr.Dataset:
    def signal(values: FloatArray) -> FloatArray:
        return values if outputs else values[:, 0]

    found = {name: np.stack([getattr(own, name) for own in one.bands], axis=-1) for name in _SIGNALS}
    found |= {
        "measured": one.measured,
        "residual": one.measured - found["median"],
        "scored": one.scored.astype(np.int8),
    }
    values: dict[str, ArrayLike] = {name: signal(own) for name, own in found.items()}
    units = dict.fromkeys((*_SIGNALS, "measured", "residual"), unit)
    titles = {}
    source = first_input(model)
    if source in one.measurement.experiment.inputs:
        channel = next(c for c in model.inputs if source in (c.name, c.derivative_of))
        values["input"] = one.measurement.channel(source)
        units["input"] = channel.unit if channel.name == source else one.measurement.units.get(source, "1")
        titles["input"] = title_of(source, channel.description if channel.name == source else "")
    time = quantity("time", one.measurement.time, "s", f"time of {one.measurement.name}")
    return group_dataset(
        f"{PLACE}/tests/{one.measurement.name}", values, {"time": time, **outputs}, units=units, long_names=titles
    )


def _output_axis(model: Model) -> dict[str, xr.Variable]:
    return {
        "output": axis("output", [channel.name for channel in model.outputs]),
        "output_unit": quantity("output", [channel.unit for channel in model.outputs], "1", "SI unit of the output"),
    }


def _scored_from(one: Prediction) -> float:
    """Time of the first sample that counts; nan where nothing is scored."""
    used = one.scored.any(axis=1)
    time = one.measurement.time
    return float(time[np.argmax(used)] - time[0]) if used.any() else np.nan
