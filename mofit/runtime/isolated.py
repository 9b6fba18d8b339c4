"""Calls in a process beside this one: a call that crashes or hangs costs itself alone."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from mofit.errors import MofitError
from mofit.runtime import isolated_server
from mofit.runtime.sending import Sendable

#: Objects that a process keeps for later calls; of more, those not used for longest go.
_KEPT = 64
#: Seconds that a process gets to end its child.
_GRACE = 5.0
#: Threads inside of a library would take the cores from the other processes.
_ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")


class ProcessLostError(MofitError):
    """The process itself was ended from outside, by a lack of memory perhaps; what it was to call may be repeated."""


@dataclass(frozen=True)
class Call:
    """``function(*shared, *arguments)``."""

    function: Callable[..., Any]
    """Of a module."""
    shared: Sequence[Sendable]
    """Objects that later calls may take, too: sent once."""
    arguments: Sequence[Any] = ()

    def sent(self) -> tuple[tuple[str, ...], bytes]:
        """The call as it goes to the other process."""
        return tuple(one.key for one in self.shared), pickle.dumps((self.function, tuple(self.arguments)))


@dataclass(frozen=True)
class Answer:
    """What became of a call."""

    value: Any = None
    failure: str | None = None
    """The text of what was raised, or how the process was lost."""
    lost: bool = False
    """Whether the process crashed or hung."""


class IsolatedProcess:
    """A process that calls functions, one after the other.

    It is a fresh interpreter that forks a child for the calls. A child that crashes or takes too long is replaced in
    milliseconds. Both end with this process, however it ends. What they print goes to the log.

    Parameters
    ----------
    preload
        Modules that are imported once, before any child is forked.
    log
        File for what they print; by default it is dropped.
    """

    def __init__(self, preload: Sequence[str] = (), log: Path | None = None) -> None:
        self.preload = tuple(preload)
        self.log = log
        self._process: subprocess.Popen[bytes] | None = None
        self._connection: Connection[Any, Any] | None = None
        self._kept: dict[str, None] = {}  # in the order of their last use

    def answers(self, calls: Sequence[Call], timeout: float | None = None) -> Iterator[Answer]:
        """Answers of the other process to calls, in their order, each as soon as it is there.

        The ``timeout`` (s) of each call does not count the time in which shared objects are loaded.

        Raises
        ------
        ProcessLostError
            If the process was ended from outside; the calls without an answer may be made again.
        """
        shared = {one.key: one.content for call in calls for one in call.shared}
        new = {key: content for key, content in shared.items() if key not in self._kept}
        self._kept = {key: None for key in self._kept if key not in shared} | dict.fromkeys(shared)
        forgotten = list(self._kept)[: -max(_KEPT, len(shared))]
        for key in forgotten:
            del self._kept[key]
        complete = False
        try:
            connection = self._started()
            connection.send((forgotten, new, [call.sent() for call in calls], timeout))
            for _ in calls:
                kind, value = pickle.loads(connection.recv_bytes())
                yield Answer(value) if kind == "returned" else Answer(failure=value, lost=kind == "lost")
            complete = True
        except (EOFError, OSError) as error:
            raise ProcessLostError("its process was ended from outside (too little memory?)") from error
        finally:
            if not complete:
                self.close()  # the answers that are still under way belong to no later call

    def end(self) -> None:
        """End the process from another thread than that which calls: its call raises `ProcessLostError`."""
        process = self._process
        if process is not None and process.poll() is None:
            process.terminate()

    def close(self) -> None:
        """End the process; the next call starts another one."""
        self._kept.clear()
        if self._connection is not None:
            self._connection.close()
            self._connection = None
        if self._process is not None:
            self._process.terminate()
            try:
                self._process.wait(_GRACE)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()
            self._process = None

    def _started(self) -> Connection[Any, Any]:
        if self._connection is not None:
            return self._connection
        root = str(Path(__file__).resolve().parents[2])
        search = os.pathsep.join([root, *(os.path.abspath(entry) for entry in sys.path)])  # noqa: PTH100  "" is here
        mine, its = Pipe()
        printed = open(self.log, "ab") if self.log is not None else None  # noqa: PTH123, SIM115  closed below
        try:
            name = isolated_server.__name__
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-W", "ignore", "-c",
                 f"from {name} import serve; serve({its.fileno()}, {self.preload!r})"],
                stdin=subprocess.DEVNULL,
                stdout=printed or subprocess.DEVNULL,
                stderr=printed or subprocess.DEVNULL,
                pass_fds=[its.fileno()],
                start_new_session=True,  # an interrupt from the keyboard is for this process
                env={**_ONE_THREAD, **os.environ, "PYTHONPATH": search},
            )  # fmt: skip
        finally:
            its.close()
            if printed is not None:
                printed.close()
        self._connection = mine
        return mine
