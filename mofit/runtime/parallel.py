"""Forked processes: they begin with all that is in memory, and nothing to send or import."""

from __future__ import annotations

import gc
import multiprocessing
import os
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from functools import partial
from typing import Any, TypeVar

from mofit.runtime.team import MOST_ITEMS, current, in_team

T = TypeVar("T")
S = TypeVar("S")

#: ``result = start(function, *arguments); ...; result()``: what a process beside has computed meanwhile.
Start = Callable[..., Callable[[], Any]]

#: By so much a process beside gives way to the one that it works for, whose threads wait for one another.
_NICE = 10


def may_fork() -> bool:
    """Whether the system can, there is more than one core, and this process is nobody's child.

    The process of a batch has its cores to itself and others, and may not have children; one that `ready_beside` keeps
    ready may.
    """
    free = (_ready or multiprocessing.parent_process() is None) and not in_team()
    return sys.platform == "linux" and (os.cpu_count() or 1) > 1 and free


@contextmanager
def beside(function: Callable[[], T], fork: bool = True) -> Iterator[Callable[[], T]]:
    """``with beside(f) as result: ...; result()``: f() is computed by a forked process while the block goes on.

    Without `fork`, where that is not possible, and if the process is lost, ``result()`` computes it here.
    """
    if not (fork and may_fork()):
        yield function
        return
    with _forked(1, _remember, function, _NICE) as pool:
        yield _answer(pool, function, _compute)


@contextmanager
def ready_beside(prepare: Callable[[], None]) -> Iterator[Start]:
    """``with ready_beside(prepare) as start: ...``: a process calls prepare() at once, later what `start` sends it.

    What is sent must pickle. Where no process can be forked, and if it is lost, ``result()`` computes here.
    """
    if not may_fork():
        yield partial
        return
    with _forked(1, _get_ready, prepare) as pool:

        def start(function: Callable[..., T], *arguments: Any) -> Callable[[], T]:
            return _answer(pool, partial(function, *arguments), function, *arguments)

        yield start


def forked_map(
    function: Callable[[S], T],
    items: Sequence[S],
    processes: int,
    first: Sequence[S] = (),
    tell: Callable[[int], None] = lambda number: None,
    name: Callable[[S], str] = lambda item: type(item).__name__,
) -> list[T]:
    """``[function(item) for item in items]``, computed by forked processes where that is possible, or by a `team`.

    What is returned must pickle; function and items need not. The items ``first`` take longest: they are begun first,
    in their order, so that the processes end together. ``tell`` hears the number of every item whose result is awaited.
    The ``name`` of an item tells the processes of a team that they speak of the same.
    """

    def awaited(number: int, answer: Callable[[], T]) -> T:
        tell(number)
        return answer()

    processes, several = min(processes, len(items)), current()
    longest = {id(item): place for place, item in enumerate(first)}
    order = sorted(range(len(items)), key=lambda number: longest.get(id(items[number]), len(longest)))
    if processes > 1 and several is not None and len(items) <= MOST_ITEMS:
        return several.map(function, items, order, name, tell)
    if processes < 2 or not may_fork():
        return [awaited(number, partial(function, item)) for number, item in enumerate(items)]
    with _forked(processes, _remember_as_one_of, lambda number: function(items[number])) as pool:
        answers = {number: _answer(pool, partial(function, items[number]), _compute, number) for number in order}
        return [awaited(number, answers[number]) for number in range(len(items))]


def shared_map(function: Callable[[S], T], items: Sequence[S], name: Callable[[S], str]) -> list[T]:
    """``[function(item) for item in items]``, shared by a team if there is one: no process is forked for it."""
    several = current()
    if several is None or not 1 < len(items) <= MOST_ITEMS:
        return [function(item) for item in items]
    return several.map(function, items, range(len(items)), name, lambda number: None)


def threads(jobs: int) -> int:
    """So many, but one in a process of `forked_map` or of a team: the others have the other cores."""
    return 1 if _one_of_several or in_team() else jobs


def processor_time() -> float:
    """Seconds of the processor that this process has taken, and those that it waited for."""
    return sum(os.times()[:4])


def _answer(
    pool: ProcessPoolExecutor, here: Callable[[], T], function: Callable[..., T], *arguments: Any
) -> Callable[[], T]:
    """Begin ``function(*arguments)`` in the pool; its result comes from `here` if the pool loses its processes."""
    try:
        future = pool.submit(function, *arguments)
    except BrokenProcessPool:
        return here

    def result() -> T:
        try:
            return future.result()
        except BrokenProcessPool:  # for want of memory perhaps
            return here()

    return result


@contextmanager
def _forked(processes: int, begin: Callable[..., None], *arguments: Any) -> Iterator[ProcessPoolExecutor]:
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


# what a forked process computes: it has it from its parent, as it is
_function: Callable[..., Any] | None = None
# whether this is the process that `ready_beside` keeps
_ready = False
# whether this is a process of `forked_map`
_one_of_several = False


def _remember(function: Callable[..., Any], nice: int = 0) -> None:
    global _function
    _function = function
    os.nice(nice)


def _remember_as_one_of(function: Callable[..., Any]) -> None:
    global _one_of_several
    _one_of_several = True
    _remember(function)


def _compute(*arguments: Any) -> Any:
    assert _function is not None
    return _function(*arguments)


def _get_ready(prepare: Callable[[], None]) -> None:
    global _ready
    _ready = True
    prepare()


def _begin(begin: Callable[..., None], *arguments: Any) -> None:
    global _ready
    _ready = False
    gc.freeze()  # what the parent has made stays: looking for garbage there copies its memory
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent ends its children
    end_with_parent()
    begin(*arguments)


def end_with_parent() -> None:
    """In a process of a pool, its initializer: it ends with its parent, which cannot end its children once killed."""
    threading.Thread(target=_wait_for_parent, daemon=True).start()


def _wait_for_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)
