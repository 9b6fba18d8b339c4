"""The report of a run, drawn by a process beside the one that computes.

What draws is imported there, while the caller computes, and draws while the caller goes on.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import AbstractContextManager, contextmanager
from functools import partial
from pathlib import Path

import xarray as xr

from mofit.forking import forked, may_fork

#: ``with drawn(tree, folder): ...``: in the block the report is being drawn, after it it is there.
Drawn = Callable[[xr.DataTree, Path], AbstractContextManager[None]]


@contextmanager
def report_beside() -> Iterator[Drawn]:
    """Ready to draw a report; where no process can be forked, it is drawn by this one at the end of `Drawn`'s block."""
    if not may_fork():
        yield _drawn_here
        return
    with forked(1, _get_ready) as pool:
        yield partial(_drawn_there, pool)


@contextmanager
def _drawn_here(tree: xr.DataTree, folder: Path) -> Iterator[None]:
    yield
    _write(tree, folder, 1)


@contextmanager
def _drawn_there(pool: ProcessPoolExecutor, tree: xr.DataTree, folder: Path) -> Iterator[None]:
    report = _begun(pool, tree, folder)
    try:
        yield
    finally:  # also after an error: nothing else may write into the folder then
        try:
            report.result()
        except BrokenProcessPool:  # the process is lost, for want of memory perhaps
            _write(tree, folder, 1)


def _begun(pool: ProcessPoolExecutor, tree: xr.DataTree, folder: Path) -> Future[None]:
    try:
        return pool.submit(_write, tree, folder, 2)
    except BrokenProcessPool as lost:
        report: Future[None] = Future()
        report.set_exception(lost)
        return report


def _get_ready() -> None:
    """Import, and draw once what is slow the first time."""
    from mofit.report.style import warm_up

    warm_up()


def _write(tree: xr.DataTree, folder: Path, processes: int) -> None:
    from mofit.report import write_report

    write_report(tree, folder, processes)
