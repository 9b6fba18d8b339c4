"""A team: processes that go through the same steps side by side, and share the items of every map.

Each of them knows all, so nothing has to be sent but the results of a map, and what a process has compiled or kept
serves it again. It must take the same steps as the others: what it does may depend on nothing but its data.
"""

from __future__ import annotations

import ctypes
import gc
import os
import pickle
import select
import signal
import struct
import sys
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from hashlib import sha256
from multiprocessing.connection import Connection, Pipe
from pathlib import Path
from typing import Any, TypeVar

T = TypeVar("T")
S = TypeVar("S")

#: A token: number of a map, and an item of it, or none for who reads it and finds nothing left.
_TOKEN = struct.Struct("qq")
_NONE = -1
#: Most items that a team shares: their tokens fit into a pipe.
MOST_ITEMS = 4000
#: Linux: the signal that a process gets when its parent ends.
_PR_SET_PDEATHSIG = 1

_team: Team | None = None


@dataclass
class Team:
    """The place of a process in the team.

    Parameters
    ----------
    number
        0 for the process that all began with, which alone goes on afterwards.
    tokens, given
        Ends of the pipe that items of a map are taken from, the other one of the first process alone.
    links
        Of the first process to all others by their number and process; of another one to the first.
    """

    number: int
    tokens: int
    given: int | None
    links: dict[tuple[int, int], Connection] = field(default_factory=dict)
    maps: int = 0
    busy: bool = False

    def map(
        self,
        function: Callable[[S], T],
        items: Sequence[S],
        order: Sequence[int],
        name: Callable[[S], str],
        tell: Callable[[int], None],
    ) -> list[T]:
        """``[function(item) for item in items]``; ``order`` is that in which they are begun.

        ``tell`` hears every number in turn, as items are begun. Their ``name`` is compared: a process that took another
        way is dismissed.
        """
        self.maps += 1
        if self.given is not None:
            sentinels = [_NONE] * (1 + len(self.links))
            os.write(self.given, b"".join(_TOKEN.pack(self.maps, number) for number in (*order, *sentinels)))
        own, place = dict[int, _Outcome](), {number: begun for begun, number in enumerate(order)}
        told = 0
        while (number := self._taken()) != _NONE:
            told = self._tell(tell, told, place[number] + 1)
            own[number] = self._outcome(function, items[number])
        self._tell(tell, told, len(items))
        what = sha256(repr((self.maps, [name(item) for item in items])).encode()).digest()
        every = self._gathered(what, own, function, items) if self.number == 0 else self._sent(what, own)
        return [every[number].value() for number in range(len(items))]

    def _tell(self, tell: Callable[[int], None], told: int, begun: int) -> int:
        """Tell of all items that have begun by now; how many these are."""
        if self.number == 0:
            for number in range(told, begun):
                tell(number)
        return max(told, begun)

    def _taken(self) -> int:
        """The next item, or none; what is left of maps of old is passed over."""
        while True:
            if self.given is not None and not select.select([self.tokens], [], [], 0)[0]:
                return _NONE  # a lost process has taken more than its part
            content = os.read(self.tokens, _TOKEN.size)
            if len(content) < _TOKEN.size:
                os._exit(1)  # the first process has ended
            of, number = _TOKEN.unpack(content)
            if of > self.maps:
                os._exit(1)  # this one has lost its way
            if of == self.maps:
                return int(number)

    def _outcome(self, function: Callable[[S], T], item: S) -> _Outcome:
        self.busy = True
        try:
            return _Outcome(function(item), None)
        except Exception as error:  # noqa: BLE001  every process raises it
            return _Outcome(None, error)
        finally:
            self.busy = False

    def _gathered(
        self, what: bytes, own: dict[int, _Outcome], function: Callable[[S], T], items: Sequence[S]
    ) -> dict[int, _Outcome]:
        """All outcomes, in the first process; what a lost one leaves is computed here."""
        every, known = dict(own), dict[tuple[int, int], dict[int, _Outcome]]()
        for member, link in list(self.links.items()):
            try:
                theirs, known[member] = pickle.loads(link.recv_bytes())
            except (EOFError, OSError):
                theirs, known[member] = b"", {}
            if theirs != what:  # it is gone, or went another way
                self._dismiss(member)
                continue
            every |= known[member]
        for number in (number for number in range(len(items)) if number not in every):
            every[number] = self._outcome(function, items[number])
        for member, link in list(self.links.items()):
            others = {number: one for number, one in every.items() if number not in known[member]}
            try:
                link.send_bytes(pickle.dumps(others, pickle.HIGHEST_PROTOCOL))
            except OSError:
                self._dismiss(member)
        return every

    def _sent(self, what: bytes, own: dict[int, _Outcome]) -> dict[int, _Outcome]:
        """The same, in another process."""
        (link,) = self.links.values()
        try:
            content = pickle.dumps((what, own), pickle.HIGHEST_PROTOCOL)
        except Exception:  # noqa: BLE001  what does not pickle the first process computes for itself
            content = pickle.dumps((what, {}))
        try:
            link.send_bytes(content)
            # its own stay: what did not pickle comes from the first process, too
            return pickle.loads(link.recv_bytes()) | own
        except (EOFError, OSError):
            os._exit(1)

    def _dismiss(self, member: tuple[int, int]) -> None:
        self.links.pop(member).close()
        _, process = member
        with suppress(ProcessLookupError):
            os.kill(process, signal.SIGKILL)
        with suppress(ChildProcessError):
            os.waitpid(process, 0)

    def end(self) -> None:
        """Nobody else goes on."""
        if self.number:
            os._exit(0)
        for member in list(self.links):
            self._dismiss(member)
        os.close(self.tokens)
        if self.given is not None:
            os.close(self.given)


@dataclass(frozen=True)
class _Outcome:
    """What a function returned, or raised."""

    returned: Any
    raised: Exception | None

    def value(self) -> Any:
        """The value, or the error raised again."""
        if self.raised is not None:
            raise self.raised
        return self.returned


@contextmanager
def team(count: int) -> Iterator[None]:
    """``with team(2): ...``: so many processes go through the block, all but this one silent; this one leaves it."""
    global _team
    if count < 2 or sys.platform != "linux" or _team is not None:
        yield
        return
    sys.stdout.flush()
    sys.stderr.flush()
    tokens, given = os.pipe()
    _team = Team(0, tokens, given)
    for number in range(1, count):
        if not _fork(number, given):
            break
    try:
        yield
    finally:
        ended, _team = _team, None
        ended.end()


def _fork(number: int, given: int) -> bool:
    """Whether this is still the first process; what it has made stays with both."""
    global _team
    assert _team is not None
    here, there = Pipe()
    gc.freeze()  # looking for garbage in what both have copies it
    with warnings.catch_warnings():
        # Python 3.12 and JAX warn of threads that hold locks at a fork; ours sleep, and a child starts its own
        warnings.filterwarnings("ignore", "This process .* is multi-threaded", DeprecationWarning)
        warnings.filterwarnings("ignore", r"os\.fork\(\) was called", RuntimeWarning)
        process = os.fork()
    if process:
        gc.unfreeze()
        there.close()
        _team.links[number, process] = here
        return True
    parent = os.getppid()
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the first process ends the others
    os.close(given)
    for link in (here, *_team.links.values()):
        link.close()
    silent = Path(os.devnull).open("w")  # noqa: SIM115  as long as the process lives
    for stream in (1, 2):
        os.dup2(silent.fileno(), stream)
    sys.stdout = sys.stderr = silent
    _team = Team(number, _team.tokens, None, {(0, parent): there})
    return False


def current() -> Team | None:
    """The team that may take the items of a map; None without one, and within an item."""
    return None if _team is None or _team.busy else _team


def in_team() -> bool:
    """Whether this process is one of several that go side by side."""
    return _team is not None


def is_first() -> bool:
    """Whether this process goes on after all others."""
    return _team is None or _team.number == 0
