"""The tables of all kernels of the process, kept for the next call within one budget of memory."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Set
from itertools import count
from threading import Lock
from weakref import WeakSet

from mofit.simulation.kernel import Table

#: bytes of tables that are kept; the usual campaign needs less
KEPT_BYTES = 1e8

_lock = Lock()
_calls = count()


class Shelf:
    """The tables of one scheduler; they go with it, or when another one needs the room."""

    def __init__(self) -> None:
        #: table and number of its last use, the longest unused first
        self._kept: dict[Hashable, tuple[Table, int]] = {}
        _shelves.add(self)

    def table(self, name: Hashable, make: Callable[[], Table], used: Set[Hashable]) -> Table:
        """The table of that name, made if it is not there, and kept where there is room.

        Tables of this shelf that the present call has ``used`` stay: where all do not fit, the next call finds
        these at least.
        """
        with _lock:
            if name in self._kept:
                table, _ = self._kept.pop(name)
                self._kept[name] = table, next(_calls)
                return table
        table = make()
        with _lock:
            if _room_for(table.nbytes, self, used):
                self._kept[name] = table, next(_calls)
        return table


_shelves: WeakSet[Shelf] = WeakSet()


def _room_for(needed: int, own: Shelf, used: Set[Hashable]) -> bool:
    """Whether there is room, which the longest unused tables make."""
    shelves = list(_shelves)
    room = KEPT_BYTES - sum(table.nbytes for shelf in shelves for table, _ in shelf._kept.values())
    spare = [
        (call, shelf, name)
        for shelf in shelves
        for name, (_, call) in shelf._kept.items()
        if shelf is not own or name not in used
    ]
    for _, shelf, name in sorted(spare, key=lambda entry: entry[0]):
        if room >= needed:
            break
        room += shelf._kept.pop(name)[0].nbytes
    return room >= needed
