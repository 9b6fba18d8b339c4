"""Where the simulations of a job run: in processes of this machine or on a cluster, kept on disk meanwhile."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from mofit.simulation.evaluation import Cached, DaskExecutor, Executor, IsolatedExecutor
from mofit.simulation.evaluation.evaluations import Evaluations

#: File in which simulations are kept while a job works.
KEPT = "evaluations.sqlite"
#: Seconds that one simulation may take.
TIMEOUT = 60.0


@contextmanager
def evaluated_in(
    evaluations: Evaluations | None,
    jobs: int,
    timeout: float = TIMEOUT,
    dask: str | None = None,
    folder: Path | None = None,
) -> Iterator[None]:
    """Within the block the simulations run in other processes; nothing changes for a model that has equations.

    A simulator that takes many parameter sets at once stays in this process, unless there is a cluster.

    Parameters
    ----------
    evaluations
        Those of the model.
    jobs, timeout
        Processes, and seconds that one simulation may take.
    dask
        Address of a Dask scheduler, whose workers then take the place of the processes.
    folder
        Keeps the simulations, so that a killed job resumes.

    Raises
    ------
    InputError
        If the cluster does not answer.
    """
    if evaluations is None or (evaluations.box.many and dask is None):
        yield
        return
    executor = IsolatedExecutor(jobs, timeout) if dask is None else DaskExecutor(dask, timeout)
    with executor:
        fingerprint = f"{evaluations.box.name} {evaluations.box.fingerprint}"
        own: Executor = executor if folder is None else Cached(executor, folder, fingerprint)
        former, evaluations.executor = evaluations.executor, own
        try:
            yield
        finally:
            evaluations.executor = former
