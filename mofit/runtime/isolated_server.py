"""What the process of `mofit.runtime.isolated` does: it forks a child that calls, and replaces one that is lost."""

from __future__ import annotations

import ctypes
import os
import pickle
import resource
import signal
import sys
import tempfile
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from importlib import import_module
from multiprocessing import Pipe
from multiprocessing.connection import Connection, wait
from tempfile import TemporaryDirectory
from typing import Any, NoReturn, TypeAlias

from mofit.runtime.sending import received

#: Seconds that a child may take to load what it is to call: imports of big packages on a busy machine.
_LOADING = 120.0
#: ``prctl(PR_SET_PDEATHSIG, …)`` of Linux.
_DEATH_SIGNAL = 1


# whether this is a child
_child = False

#: keys of the objects that a call takes, and the pickled function and its other arguments
_Call: TypeAlias = tuple[tuple[str, ...], bytes]


class _LostError(Exception):
    """The child crashed, or did not answer in time."""


@dataclass
class _Child:
    """The child, and what it has."""

    pid: int
    connection: Connection[Any, Any]
    known: set[str] = field(default_factory=set)

    def end(self) -> int:
        """Kill the child and what it has started; its exit code, negative for a signal."""
        with suppress(ProcessLookupError):
            os.killpg(self.pid, signal.SIGKILL)
        self.connection.close()
        return os.waitstatus_to_exitcode(os.waitpid(self.pid, 0)[1])

    def exit_code(self) -> int:
        """Exit code of one that has closed its connection."""
        self.connection.close()
        code = os.waitstatus_to_exitcode(os.waitpid(self.pid, 0)[1])
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(self.pid, signal.SIGKILL)  # what it has started
        return code


def serve(handle: int, preload: Sequence[str]) -> None:
    """Pass calls from the connection on to a child until the other side has ended (`EOFError`) or asks for the end.

    A request is ``(forgotten keys, new contents by key, calls, timeout)`` with calls ``(keys, pickled call)``. There is
    an answer to each call, in their order: pickled ``(kind, value)``, "returned" a value, "raised" a text, or "lost"
    with the way in which the child was lost.
    """
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    signal.signal(signal.SIGTERM, lambda *_: sys.exit())
    for name in preload:
        with suppress(ImportError):  # a child that needs it tells
            import_module(name)
    with suppress(EOFError, OSError), TemporaryDirectory(prefix="mofit-") as folder:
        # what children unpack on disk is there for those that replace them, and goes with this process
        os.environ["TMPDIR"] = tempfile.tempdir = folder
        _serve(Connection(handle))


def _serve(parent: Connection[Any, Any]) -> None:
    contents: dict[str, bytes] = {}
    child: _Child | None = None
    try:
        while True:
            forgotten, new, calls, timeout = parent.recv()
            contents = {key: content for key, content in (contents | new).items() if key not in forgotten}
            while calls:
                child = child or _forked(parent)
                try:
                    _send(child, forgotten, contents, calls)
                    _pass_on(child, parent, calls, timeout)
                except _LostError as lost:
                    child, calls = None, calls[1:]
                    parent.send_bytes(pickle.dumps(("lost", str(lost))))
    finally:
        if child is not None:
            child.end()


def _send(child: _Child, forgotten: Sequence[str], contents: dict[str, bytes], calls: Sequence[_Call]) -> None:
    """Send calls with what the child lacks for them."""
    needed = {key for keys, _ in calls for key in keys}
    new = {key: contents[key] for key in needed - child.known}
    child.known = (child.known | needed).difference(forgotten)
    with suppress(OSError):  # it was lost since its last answer: the wait tells
        child.connection.send((forgotten, new, calls))


def _pass_on(child: _Child, parent: Connection[Any, Any], calls: list[_Call], timeout: float | None) -> None:
    """Pass the child's answers on; those calls that are answered leave the list."""
    _wait(child, parent, None if timeout is None else max(timeout, _LOADING))
    while calls:
        parent.send_bytes(_wait(child, parent, timeout))
        del calls[0]


def _wait(child: _Child, parent: Connection[Any, Any], timeout: float | None) -> bytes:
    """The next message of the child, which is ended where it takes longer."""
    ready = wait([parent, child.connection], timeout)
    if parent in ready:
        raise EOFError  # it sends nothing while it waits: it has ended
    if not ready:
        child.end()
        raise _LostError(f"no answer within {timeout:g} s")
    try:
        return child.connection.recv_bytes()
    except (EOFError, OSError):
        code = child.exit_code()
        raise _LostError(f"crashed (signal {-code})" if code < 0 else f"crashed (exit code {code})") from None


def _forked(parent: Connection[Any, Any]) -> _Child:
    mine, its = Pipe()
    supervisor = os.getpid()
    pid = os.fork()
    if pid == 0:
        try:
            mine.close()
            parent.close()
            _begin(supervisor)
            _answer_calls(its)
        finally:
            os._exit(1)
    its.close()
    with suppress(OSError):  # it has done so itself
        os.setpgid(pid, pid)
    return _Child(pid, mine)


def in_child() -> bool:
    """Whether this is a process that may crash."""
    return _child


def _begin(supervisor: int) -> None:
    global _child
    _child = True
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    os.setpgid(0, 0)
    if sys.platform == "linux":  # elsewhere a child ends with its next answer
        ctypes.CDLL(None).prctl(_DEATH_SIGNAL, signal.SIGKILL)
        if os.getppid() != supervisor:
            os._exit(1)


def _answer_calls(connection: Connection[Any, Any]) -> NoReturn:
    """Load what is new and say so; then answer call after call."""
    objects: dict[str, Any] = {}
    while True:
        try:
            forgotten, new, calls = connection.recv()
        except EOFError:
            os._exit(0)
        for key in forgotten:
            objects.pop(key, None)
        failures = {}
        for key, content in new.items():
            try:
                objects[key] = received(content)
            except (Exception, SystemExit) as error:  # noqa: BLE001  importing users' code raises anything
                failures[key] = f"it could not be loaded ({type(error).__name__}: {error})"
        connection.send_bytes(b"")
        for keys, call in calls:
            failure = next((failures[key] for key in keys if key in failures), None)
            answer = ("raised", failure) if failure else _answer([objects[key] for key in keys], call)
            connection.send_bytes(pickle.dumps(answer))


def _answer(shared: list[Any], call: bytes) -> tuple[str, Any]:
    try:
        function, arguments = pickle.loads(call)
        return "returned", function(*shared, *arguments)
    except (Exception, SystemExit) as error:  # noqa: BLE001  users' code raises anything
        return "raised", f"{type(error).__name__}: {error}"
