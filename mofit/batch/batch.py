"""The whole batch: find the campaigns, do them, keep the rows, write table and page."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from mofit.batch.executors import locally, on_cluster
from mofit.batch.table import write_table
from mofit.batch.tasks import Row, Task, decided_by, find_campaigns, require_same
from mofit.errors import InputError, did_you_mean
from mofit.library import find_effect, find_model
from mofit.progress import Progress, silent
from mofit.result import atomic_path
from mofit.settings import Settings

WORK = ("identify", "diagnose")
RECORD, TABLE, PAGE = "batch.json", "table.csv", "batch.html"


@dataclass(frozen=True)
class BatchJob:
    """A batch as a user asks for it.

    Parameters
    ----------
    places
        Folders of campaigns, or campaigns.
    out
        Folder for runs, rows, table and page; a batch that is there already is gone on with.
    what
        ``"identify"`` or ``"diagnose"``.
    model, effects, settings
        As for these; every task runs in one thread.
    processes
        Processes of this machine.
    scheduler
        Address of a Dask scheduler whose workers do the work instead.
    """

    places: tuple[Path, ...]
    out: Path
    what: str = "identify"
    model: str | None = None
    effects: tuple[str, ...] = ()
    settings: Settings = field(default_factory=Settings)
    processes: int = 1
    scheduler: str | None = None


def run_batch(job: BatchJob, progress: Progress = silent) -> list[Row]:
    """Do the work on every campaign; what is done already is kept, what failed is tried again.

    Returns
    -------
    One row per campaign, in the order of their names. Table and page are in ``job.out``.

    Raises
    ------
    InputError
        If places or options cannot be used. A campaign that cannot be used is a row that says so.
    """
    if job.what not in WORK:
        raise InputError.of(f"--what {job.what}", "unknown", did_you_mean(job.what, WORK))
    campaigns = find_campaigns(job.places)
    if job.model:
        find_model(job.model)
    for effect in job.effects:
        find_effect(effect)
    out = job.out.resolve()
    settings = replace(job.settings, jobs=1)
    tasks = [
        Task(name, file.resolve(), out, job.what, job.model, job.effects, settings)
        for name, file in sorted(campaigns.items())
    ]
    decided = decided_by(tasks[0])
    require_same(job.out, out / RECORD, decided)
    (out / "rows").mkdir(parents=True, exist_ok=True)
    with atomic_path(out / RECORD) as temporary:
        temporary.write_text(json.dumps(decided, indent=1) + "\n", encoding="utf-8")
    rows: dict[str, Row] = {}
    progress(job.what, 0, len(tasks), "")
    for row in _finished(job, tasks):
        rows[row.name] = row
        progress(job.what, len(rows), len(tasks), f"{row.name}: {row.state}")
    ordered = [rows[task.name] for task in tasks]
    from mofit.batch.page import write_page  # draws

    write_table(ordered, job.what, out / TABLE)
    write_page(ordered, job.what, out / PAGE)
    return ordered


def _finished(job: BatchJob, tasks: Sequence[Task]) -> Iterator[Row]:
    if job.scheduler is not None:
        return on_cluster(tasks, job.scheduler)
    return locally(tasks, job.processes)
