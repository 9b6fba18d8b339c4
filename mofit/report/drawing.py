"""Drawing the sections of a page on two cores, where the system can fork."""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import warnings
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor

from mofit.report.page import Section
from mofit.report.run import Run

Maker = Callable[[Run], Section | None]

#: Figures are drawn in Python, a core at a time; a second process halves the wait, more would mostly start up.
PROCESSES = 2

# what a forked process draws: it has both from its parent, and nothing to send or import
_task: tuple[Run, Sequence[Maker]] | None = None


def draw_sections(run: Run, makers: Sequence[Maker]) -> list[Section]:
    """The sections that find something to show, in order; the same for one process or two."""
    # the process of a batch has its cores to itself and others, and may not have children
    alone = multiprocessing.parent_process() is None
    if alone and sys.platform == "linux" and (os.cpu_count() or 1) > 1:
        drawn = _forked(run, makers)
    else:
        drawn = [make(run) for make in makers]
    return [section for section in drawn if section is not None]


def _forked(run: Run, makers: Sequence[Maker]) -> list[Section | None]:
    with warnings.catch_warnings():
        # Python 3.12 warns of threads that hold locks at a fork; ours sleep, and a child only draws
        warnings.filterwarnings("ignore", "This process .* is multi-threaded", DeprecationWarning)
        context = multiprocessing.get_context("fork")
        with ProcessPoolExecutor(PROCESSES, context, initializer=_begin, initargs=(run, makers)) as pool:
            return list(pool.map(_draw, range(len(makers))))


def _begin(run: Run, makers: Sequence[Maker]) -> None:
    global _task
    _task = run, makers
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent ends its children


def _draw(number: int) -> Section | None:
    assert _task is not None
    run, makers = _task
    return makers[number](run)
