"""``--time-limit``: a command that computes ends when its time is up."""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from mofit.cli.app import seconds
from mofit.runtime.interruption import interruption

#: What `identify`, which ends by itself in time, may take longer before it is ended, as a share of the limit.
LATE = 0.5
#: Seconds from ring to ring once the time is up: one is missed in what must be done whole, or what it raised is lost.
AGAIN = 0.02
#: What must be done whole: an import (a module imported by half stays so) and logging (a lock kept stops every thread).
WHOLE = ("importlib._bootstrap", "logging")


class TimeIsUp(KeyboardInterrupt):  # nothing that catches errors may keep it
    """Raised in the main thread when the time of a command is up."""


@contextmanager
def time_limit(text: str | None, late: float = 0.0) -> Iterator[float | None]:
    """The limit in s; `TimeIsUp` is raised in the block after it, and a share ``late`` of it more.

    Nothing is raised where the system has no alarm, nor outside of the main thread.
    """
    limit = seconds("--time-limit", text)
    if limit is None or limit <= 0 or not hasattr(signal, "setitimer"):
        yield limit
        return
    if threading.current_thread() is not threading.main_thread():
        yield limit
        return
    before = signal.signal(signal.SIGALRM, _raise)
    signal.setitimer(signal.ITIMER_REAL, (1 + late) * limit, AGAIN)
    try:
        with _quiet_where_lost():
            yield limit
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def _raise(_: int, frame: FrameType | None) -> None:
    # what cleans up behind an interruption must not be torn apart by another
    if interruption(sys.exc_info()[1]) is None and not _in_what_must_be_whole(frame):
        raise TimeIsUp


@contextmanager
def _quiet_where_lost() -> Iterator[None]:
    """What a destructor or the callback of a weak reference raises reaches nobody: the next ring will."""
    before = sys.unraisablehook

    def lost(raised: sys.UnraisableHookArgs) -> None:
        if not isinstance(raised.exc_value, TimeIsUp):
            before(raised)

    sys.unraisablehook = lost
    try:
        yield
    finally:
        sys.unraisablehook = before


def _in_what_must_be_whole(frame: FrameType | None) -> bool:
    while frame is not None:
        # locks are taken before a fork and given back after it, where nothing that is raised arrives
        forks = frame.f_code.co_name == "_launch" and frame.f_globals.get("__name__") == "multiprocessing.popen_fork"
        if forks or frame.f_globals.get("__name__") in WHOLE:
            return True
        frame = frame.f_back
    return False
