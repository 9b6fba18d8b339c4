"""From a run and a campaign to predictions of all its tests."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import xarray as xr

from mofit.data import Campaign, read_campaign
from mofit.errors import InputError
from mofit.models import Model
from mofit.prediction.records import predict_records
from mofit.prediction.result import prediction_tree
from mofit.results import open_result
from mofit.results.export import model_of_run
from mofit.runtime.progress import Progress, silent
from mofit.simulation.evaluation.evaluations import evaluations_of
from mofit.simulation.evaluation.executors import TIMEOUT, evaluated_in


def predict(
    run: xr.DataTree | str | Path,
    campaign: Campaign | str | Path,
    *,
    model: Model | str | None = None,
    effects: Sequence[str] = (),
    tests: Sequence[str] = (),
    jobs: int = 1,
    timeout: float = TIMEOUT,
    progress: Progress = silent,
) -> xr.DataTree:
    """Predict the tests of a campaign from a run: a 90 % band of parameters, noise and model error.

    Parameters
    ----------
    run
        Folder of a finished run, its ``result.nc``, or the result from `mofit.open`.
    campaign
        The records to predict, or the path of their file. They need the model's inputs and conditions; an output that
        was measured is compared with the prediction.
    model, effects
        The run's model, if it is your own: as it was given to `mofit.identify`, or ``path/to/file.py:Name``.
    tests
        Names of the tests to predict; by default all.
    jobs
        Threads; results do not depend on it.
    timeout
        Seconds that one simulation of a simulator of your own may take.
    progress
        Called as ``progress(stage, done, total, note)``.

    Returns
    -------
    xarray.DataTree
        Of schema ``mofit.prediction/1``. Its root has a table over ``record``: NRMSD, root mean square error, coverage
        of the band, and the parts of the band as standard deviations. Each group of ``tests`` has signals over ``time``
        (and ``output``, of several): ``median``, ``low`` and ``high`` (5 and 95 % quantile of a new measurement),
        ``parameter_low`` and ``parameter_high`` (by the parameters alone), ``measured``, ``residual``, ``scored``.

    Raises
    ------
    InputError
        If the model is not the one that was identified, the time-out is not above 0 s, or with every channel and
        condition that a test lacks.
    """
    if not timeout > 0:
        raise InputError.of("timeout", f"{timeout:g} s cannot be used", "Give more than 0 s")
    tree = run if isinstance(run, xr.DataTree) else open_result(run)
    records = campaign if isinstance(campaign, Campaign) else read_campaign(campaign)
    found = model_of_run(tree, model, effects)
    records = records.select(tests) if tests else records
    with evaluated_in(evaluations_of(found), jobs, timeout):
        predictions = predict_records(tree, found, records, jobs=jobs, progress=progress)
    return prediction_tree(tree, found, records, predictions)
