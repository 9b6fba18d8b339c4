"""Where tasks are done: processes of this machine, or the workers of a Dask cluster. Rows come as they are finished."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context

from mofit.batch.tasks import Row, Task
from mofit.batch.work import work
from mofit.errors import InputError

DIED = "its process was ended from outside (too little memory?)"
#: Seconds until a scheduler must have answered.
_PATIENCE = 15


def locally(tasks: Sequence[Task], processes: int) -> Iterator[Row]:
    """In processes of their own.

    A process that dies takes the others of its pool with it. What is left is then done by one process per task, so
    that only the task fails that kills it.
    """
    left = list(tasks)
    with _pool(processes) as pool:
        futures = {pool.submit(work, task): task for task in tasks}
        for future in as_completed(futures):
            try:
                row = future.result()
            except BrokenProcessPool:
                continue
            left.remove(futures[future])
            yield row
    for task in left:
        with _pool(1) as pool:
            try:
                row = pool.submit(work, task).result()
            except BrokenProcessPool:
                row = _died(task)
        yield row


def on_cluster(tasks: Sequence[Task], scheduler: str) -> Iterator[Row]:
    """By the workers of a Dask cluster, which must see the same files; a task whose worker is lost is done by another.

    Raises
    ------
    InputError
        If the extra is not installed, or no scheduler answers.
    """
    try:
        from distributed import Client
        from distributed import as_completed as finished
    except ImportError:
        raise InputError.of("--scheduler", "needs Dask", "Install mofit's extra: pip install 'mofit[dask]'") from None
    try:
        client = Client(scheduler, timeout=_PATIENCE)
    except (OSError, ValueError, TimeoutError) as error:
        raise InputError.of(
            f"--scheduler {scheduler}", f"no scheduler answers ({error})", "Check the address"
        ) from None
    with client:
        futures = {client.submit(work, task, pure=False): task for task in tasks}
        for future in finished(futures):
            try:
                yield future.result()
            except Exception:  # noqa: BLE001 - its workers were lost again and again
                yield _died(futures[future])


def _pool(processes: int) -> ProcessPoolExecutor:
    return ProcessPoolExecutor(processes, mp_context=get_context("spawn"))


def _died(task: Task) -> Row:
    row = Row(task.name, str(task.file), "failed", DIED)
    row.write(task.row_file)
    return row
