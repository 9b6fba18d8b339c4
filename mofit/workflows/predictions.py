"""From a run and a campaign file to a folder with the prediction: the work of ``mofit predict``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mofit.data import read_campaign
from mofit.prediction import predict
from mofit.prediction.page import free_folder, write_prediction
from mofit.results import open_result, prediction_summary
from mofit.runtime.names import slug
from mofit.runtime.progress import Progress, silent
from mofit.runtime.run_directory import run_folder
from mofit.simulation.evaluation.executors import TIMEOUT


@dataclass(frozen=True)
class PredictionJob:
    """A prediction in a user's words."""

    run: Path
    """Folder of a finished run, or its ``result.nc``."""
    file: Path
    """Campaign file with the records."""
    tests: tuple[str, ...] = ()
    """Tests to predict; all if empty."""
    model: str | None = None
    effects: tuple[str, ...] = ()
    """The run's model and effects, where they are the user's own."""
    out: Path | None = None
    """Folder to write; None means the next free one in that of the run."""
    jobs: int = 1
    """Threads."""
    timeout: float = TIMEOUT
    """Seconds that one simulation of a user's simulator may take."""


def predict_file(job: PredictionJob, progress: Progress = silent) -> tuple[Path, dict[str, Any]]:
    """Read, predict, write folder and page; returns the folder and what ``--json`` prints."""
    tree, campaign = open_result(job.run), read_campaign(job.file)
    out = free_folder(job.run, slug(campaign.title) or "prediction") if job.out is None else job.out
    configuration = {"run": tree.attrs["configuration_hash"], "campaign": campaign.hash(), "tests": list(job.tests)}
    with run_folder(out, "prediction", configuration, resumable=False) as folder:
        found = predict(
            tree, campaign, model=job.model, effects=job.effects, tests=job.tests, jobs=job.jobs, timeout=job.timeout,
            progress=progress,
        )  # fmt: skip
        progress("write", 0, 1, "page")
        write_prediction(found, folder.partial)
    return folder.target, {**prediction_summary(found), "run": str(job.run), "folder": str(folder.target)}
