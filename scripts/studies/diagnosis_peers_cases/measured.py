"""A measured damper in the files of the blind study: sine strokes to learn from, an earthquake to predict."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np

from mofit import Campaign, Measurement, write_campaign
from mofit.data import import_files
from report_page import ROOT

NAME, MODEL = "friction_damper", "kelvin_voigt_damper"
#: samples of every stroke: those of the strokes of 1 Hz; the one of 2 Hz has fewer and is left out
SAMPLES = 897
LABEL = {
    "rig": "friction damper", "excitation": "sine", "noise": "measured", "case": "dry friction with play",
    "kind": "measured", "family": "friction", "effect": "dry_friction", "akin": "", "visible": True,
}  # fmt: skip


def prepare(data: Path, work: Path) -> None:
    """Write campaign, record held out and label; the measured earthquake stands for the truth."""
    whole = import_files([data / NAME], ROOT / "data" / "maps" / "friction_damper.toml")
    earthquake = replace(whole["earthquake"], experiment=replace(whole["earthquake"].experiment, name="other_1"))
    strokes = [one for one in whole.measurements if one.experiment.kind == "sine"]
    cut = tuple(_cut(one) for one in strokes if len(one.experiment.time) >= SAMPLES)
    for part, tests in (("campaigns", cut), ("held_out", (earthquake,)), ("given", (earthquake,))):
        _write(replace(whole, measurements=tests), work / part / f"{NAME}.nc")
    (work / "labels").mkdir(parents=True, exist_ok=True)
    np.savez(work / "labels" / f"{NAME}.npz", label=json.dumps(LABEL), other_1=earthquake.outputs["force"])


def _cut(test: Measurement) -> Measurement:
    experiment = test.experiment
    inputs = {key: value[:SAMPLES] for key, value in experiment.inputs.items()}
    shorter = replace(experiment, time=experiment.time[:SAMPLES], inputs=inputs)
    return replace(test, experiment=shorter, outputs={key: value[:SAMPLES] for key, value in test.outputs.items()})


def _write(campaign: Campaign, path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    write_campaign(campaign, path)
