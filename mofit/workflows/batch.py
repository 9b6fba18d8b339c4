"""Many campaigns: find them, run them in processes or on a Dask cluster, write table and page."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from mofit.errors import InputError, Issue, did_you_mean, raise_errors, repeated
from mofit.identification.settings import Settings
from mofit.models import find_effect, find_model
from mofit.runtime.claims import LOCK, TakenError, claim
from mofit.runtime.cluster import PATIENCE, on_workers
from mofit.runtime.files import unwritable, write_text, writing
from mofit.runtime.names import named_path, shortened
from mofit.runtime.progress import Progress, silent
from mofit.runtime.run_directory import differing_settings
from mofit.workflows.batch_tasks import WORK, Row, Task, decided_by, work

RECORD, TABLE, PAGE = "batch.json", "table.csv", "batch.html"
#: Suffixes of campaign files in a folder.
SUFFIXES = (".nc", ".h5", ".hdf5")
DIED = "its process was ended from outside (too little memory?)"


@dataclass(frozen=True)
class BatchJob:
    """A batch in a user's words."""

    places: tuple[Path, ...]
    """Folders of campaigns, or campaigns."""
    out: Path
    """Folder for runs, rows, table and page; a batch in it is resumed."""
    what: str = "identify"
    """``"identify"`` or ``"diagnose"``."""
    model: str | None = None
    effects: tuple[str, ...] = ()
    settings: Settings = field(default_factory=Settings)
    """As for the single command; every task runs in one thread."""
    processes: int = 1
    """Processes of this machine."""
    scheduler: str | None = None
    """Address of a Dask scheduler; its workers replace the processes."""
    patience: float = PATIENCE
    """Seconds to wait for the scheduler's answer."""


def run_batch(job: BatchJob, progress: Progress = silent) -> list[Row]:
    """Run every campaign; finished ones are kept, failed ones are repeated.

    Returns
    -------
    One row per campaign, in the order of their names. Table and page are in ``job.out``.

    Raises
    ------
    InputError
        If places or options cannot be used. A campaign that cannot be used becomes a row with the reason.
    """
    if job.what not in WORK:
        raise InputError.of(f"--what {job.what}", "unknown", did_you_mean(job.what, WORK))
    campaigns = find_campaigns(job.places)
    if job.model:
        find_model(job.model)
    for effect in job.effects:
        find_effect(effect)
    if job.processes < 1:
        raise InputError.of(f"--jobs {job.processes}", "cannot be used", "Give at least 1")
    out = named_path(job.out).resolve()
    settings = replace(job.settings, jobs=1)
    tasks = [
        Task(name, file.resolve(), out, job.what, job.model, job.effects, settings)
        for name, file in sorted(campaigns.items())
    ]
    decided = decided_by(tasks[0])
    require_same(job.out, out / RECORD, decided)
    with _claimed(out), writing(out, "Make room, then run the same command again"):
        require_same(job.out, out / RECORD, decided)  # another process may have begun meanwhile
        (out / "rows").mkdir(exist_ok=True)
        write_text(out / RECORD, json.dumps(decided, indent=1) + "\n")
        rows: dict[str, Row] = {}
        progress(job.what, 0, len(tasks), "")
        finished = on_cluster(tasks, job.scheduler, job.patience) if job.scheduler else locally(tasks, job.processes)
        for row in finished:
            rows[row.name] = row
            progress(job.what, len(rows), len(tasks), f"{row.name}: {row.state}")
        ordered = [rows[task.name] for task in tasks]
        from mofit.workflows.batch_page import write_page, write_table  # draws

        write_table(ordered, job.what, out / TABLE)
        write_page(ordered, job.what, out / PAGE)
        return ordered


@contextmanager
def _claimed(out: Path) -> Iterator[None]:
    """The folder, made if need be, for one batch at a time."""
    where = f"--out {shortened(out)}"
    try:
        out.mkdir(parents=True, exist_ok=True)
        held = claim(out / LOCK)
    except TakenError as error:
        raise InputError.of(where, str(error), "Wait for it, or choose another folder") from None
    except OSError as error:
        raise unwritable(where, error) from None
    try:
        yield
    finally:
        held.release()


def find_campaigns(places: Sequence[Path]) -> dict[str, Path]:
    """Files by name: those named, and those with a campaign's suffix directly in the folders named.

    Raises
    ------
    InputError
        If a place does not exist or holds nothing, or two files have one name.
    """
    files: list[Path] = []
    issues = []
    for place in places:
        found = [place] if place.is_file() else []
        if place.is_dir():
            found = sorted(path for path in place.iterdir() if path.suffix.lower() in SUFFIXES)
        if not found:
            message = f"no file that ends in {', '.join(SUFFIXES)}" if place.is_dir() else "no such file or folder"
            issues.append(Issue(str(place), message, "Name folders of campaigns, or campaigns"))
        files += found
    names = [path.stem for path in files]
    issues += [
        Issue(f"campaign '{name}'", "two files have this name", "Rename one of them") for name in repeated(names)
    ]
    if not places:
        issues.append(Issue("PLACES", "none is given", "Name folders of campaigns, or campaigns"))
    raise_errors(issues)
    return dict(zip(names, files, strict=True))


def require_same(out: Path, record: Path, now: Mapping[str, Any]) -> None:
    """Refuse a folder that holds something else, or a batch with other settings; names those that differ."""
    if out.exists() and not out.is_dir():
        raise InputError.of(f"--out {out}", "is no folder", "Choose another name")
    if not record.exists() and out.exists() and any(path.name != LOCK for path in out.iterdir()):
        raise InputError.of(f"--out {out}", "exists already and holds no batch", "Choose another folder")
    if differing := differing_settings(record, now):
        message = f"a batch with other settings is there ({', '.join(differing)})"
        raise InputError.of(f"--out {out}", message, "Give the same options to resume it, or another folder")


def locally(tasks: Sequence[Task], processes: int) -> Iterator[Row]:
    """Run tasks in processes of this machine.

    A process that dies ends the others of its pool. Each task that is left then gets a process of its own, so that only
    the task that kills it fails.
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


def on_cluster(tasks: Sequence[Task], scheduler: str, patience: float) -> Iterator[Row]:
    """Run tasks on the workers of a Dask cluster, which must see the same files; a lost worker's task goes to another.

    Raises
    ------
    InputError
        If the extra is not installed, or no scheduler answers.
    """
    for k, answer in on_workers("--scheduler", scheduler, work, tasks, patience):
        yield _died(tasks[k]) if answer.error else answer.result


def _pool(processes: int) -> ProcessPoolExecutor:
    return ProcessPoolExecutor(processes, mp_context=get_context("spawn"))


def _died(task: Task) -> Row:
    row = Row(task.name, str(task.file), "failed", DIED)
    row.write(task.row_file)
    return row
