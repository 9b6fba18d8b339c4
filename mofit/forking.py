"""Forked processes: they begin with all that is in memory, and nothing to send or import."""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from typing import Any, TypeVar

T = TypeVar("T")

#: By so much a process beside gives way to the one that it works for, whose threads wait for one another.
_NICE = 10


def may_fork() -> bool:
    """Whether the system can, there is more than one core, and this process is nobody's child.

    The process of a batch has its cores to itself and others, and may not have children.
    """
    return sys.platform == "linux" and (os.cpu_count() or 1) > 1 and multiprocessing.parent_process() is None


@contextmanager
def forked(processes: int, begin: Callable[..., None], *arguments: Any) -> Iterator[ProcessPoolExecutor]:
    """A pool of processes that are there at once, each of which has called ``begin(*arguments)``.

    They end with the block, with an error in it, and with this process, however it ends.
    """
    others = set(multiprocessing.active_children())
    context = multiprocessing.get_context("fork")
    with ProcessPoolExecutor(processes, context, initializer=_begin, initargs=(begin, *arguments)) as pool:
        with warnings.catch_warnings():
            # Python 3.12 and JAX warn of threads that hold locks at a fork; ours sleep, and a child starts its own
            warnings.filterwarnings("ignore", "This process .* is multi-threaded", DeprecationWarning)
            warnings.filterwarnings("ignore", r"os\.fork\(\) was called", RuntimeWarning)
            pool.submit(int)  # the first task starts them
        own = set(multiprocessing.active_children()) - others
        try:
            yield pool
        except BaseException:
            for process in own:  # nobody waits for what they do any more
                process.terminate()
            raise


@contextmanager
def beside(function: Callable[[], T], fork: bool = True) -> Iterator[Callable[[], T]]:
    """``with beside(f) as result: ...; result()``: f() is computed by a forked process while the block goes on.

    Without `fork`, where that is not possible, and if the process is lost, ``result()`` computes it here.
    """
    if not (fork and may_fork()):
        yield function
        return
    with forked(1, _remember, function) as pool:
        future = pool.submit(_compute)

        def result() -> T:
            try:
                return future.result()
            except BrokenProcessPool:
                return function()

        yield result


# what a forked process computes: it has it from its parent, as it is
_function: Callable[[], Any] | None = None


def _remember(function: Callable[[], Any]) -> None:
    global _function
    _function = function
    os.nice(_NICE)


def _compute() -> Any:
    assert _function is not None
    return _function()


def _begin(begin: Callable[..., None], *arguments: Any) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent ends its children
    threading.Thread(target=_end_with_parent, daemon=True).start()
    begin(*arguments)


def _end_with_parent() -> None:
    """A parent that is killed cannot end its children."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)
