"""The command that predicts records from a run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from mofit.cli.app import DONE, FinishedRun, Free, Jobs, Json, MapFile, Tests, Timeout, app, cores, print_json, seconds


@app.command
def predict(
    run: FinishedRun,
    file: Annotated[Path, Parameter(help="Campaign file with the records to predict.")],
    /,
    *,
    test: Tests = (),
    model: str | None = None,
    map_file: MapFile = None,
    free: Free = (),
    effect: tuple[str, ...] = (),
    out: Path | None = None,
    timeout: Timeout = None,
    jobs: Jobs = None,
    as_json: Json = False,
) -> int:
    """Predict records from a run: a 90 % band of parameters, noise and model error, and how well it holds.

    The records need the model's inputs and conditions. An output that was measured is compared with the prediction.

    Example: mofit predict runs/my-campaign-maxwell_tyre new_record.nc

    Parameters
    ----------
    model
        The run's model, if it is your own: path/to/file.py:Name, or path/to/model.fmu.
    effect
        Effects of the run, all in their order, if one is your own; repeatable.
    out
        Folder for prediction.nc and prediction.html. By default the next free one under RUN/predictions/.
    """
    from mofit.cli.output import progress_bar, terminal_console
    from mofit.cli.predictions_shown import show_prediction
    from mofit.models.fmu import fmu_reference
    from mofit.simulation.evaluation.executors import TIMEOUT
    from mofit.workflows.predictions import PredictionJob, predict_file

    with progress_bar() as progress:
        named, allowed = fmu_reference(model, map_file, free), seconds("--timeout", timeout)
        job = PredictionJob(run, file, test, named, effect, out, cores(jobs), TIMEOUT if allowed is None else allowed)
        folder, summary = predict_file(job, progress)
    if as_json:
        print_json(summary)
    else:
        show_prediction(summary, folder, terminal_console())
    return DONE
