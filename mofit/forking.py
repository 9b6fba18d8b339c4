"""Forked processes: they begin with all that is in memory, and nothing to send or import."""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from typing import Any


def may_fork() -> bool:
    """Whether the system can, there is more than one core, and this process is nobody's child.

    The process of a batch has its cores to itself and others, and may not have children.
    """
    return sys.platform == "linux" and (os.cpu_count() or 1) > 1 and multiprocessing.parent_process() is None


@contextmanager
def forked(processes: int, begin: Callable[..., None], *arguments: Any) -> Iterator[ProcessPoolExecutor]:
    """A pool of processes that are there at once, each of which has called ``begin(*arguments)``."""
    context = multiprocessing.get_context("fork")
    with ProcessPoolExecutor(processes, context, initializer=_begin, initargs=(begin, *arguments)) as pool:
        with warnings.catch_warnings():
            # Python 3.12 warns of threads that hold locks at a fork; ours sleep, and a child starts its own
            warnings.filterwarnings("ignore", "This process .* is multi-threaded", DeprecationWarning)
            pool.submit(int)  # the first task starts them
        yield pool


def _begin(begin: Callable[..., None], *arguments: Any) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent ends its children
    begin(*arguments)
