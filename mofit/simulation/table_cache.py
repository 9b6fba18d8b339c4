"""The tables of all kernels of the process, and what they are made of, kept within one budget of memory."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Hashable, Iterator, Set
from itertools import count
from operator import itemgetter
from threading import Lock
from typing import Any, Generic, Protocol, TypeVar
from weakref import WeakSet

#: bytes of tables that are kept; the usual campaign needs less
KEPT_BYTES = 1e8

_lock = Lock()
_calls = count()


class Kept(Protocol):
    """What takes memory."""

    @property
    def nbytes(self) -> int:
        """Bytes that it takes."""


T = TypeVar("T", bound=Kept)


class TableCache(Generic[T]):
    """The tables of one scheduler, say; they go with it, or when another one needs the room."""

    def __init__(self) -> None:
        #: table and number of its last use, the longest unused first
        self._kept: dict[Hashable, tuple[T, int]] = {}
        self._bytes = 0

    def table(self, name: Hashable, make: Callable[[], T], used: Set[Hashable]) -> T:
        """The table of that name, made if it is not there, and kept where there is room.

        Tables of this cache that the present call has ``used`` stay: where all do not fit, the next call finds
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
                self._bytes += table.nbytes
                _caches.add(self)
        return table

    def clear(self) -> None:
        """Forget all tables."""
        self._kept.clear()
        self._bytes = 0
        _caches.discard(self)

    def _by_use(self) -> Iterator[tuple[int, Hashable, TableCache[T]]]:
        """Last use and name of every table, the longest unused first, and this cache."""
        return ((call, name, self) for name, (_, call) in self._kept.items())

    def _drop(self, name: Hashable) -> None:
        self._bytes -= self._kept.pop(name)[0].nbytes
        if not self._kept:
            _caches.discard(self)


#: Those that hold tables: few of thousands.
_caches: WeakSet[TableCache[Any]] = WeakSet()


def drop_tables() -> None:
    """Forget all tables of the process; those that are needed are made again."""
    with _lock:
        for cache in list(_caches):
            cache.clear()


def _room_for(needed: int, own: TableCache[Any], used: Set[Hashable]) -> bool:
    """Whether there is room, which the longest unused tables make."""
    caches = list(_caches)
    room, spare = KEPT_BYTES - sum(cache._bytes for cache in caches), list[tuple[TableCache[Any], Hashable]]()
    if room >= needed:
        return True
    for _, name, cache in heapq.merge(*(cache._by_use() for cache in caches), key=itemgetter(0)):
        if room >= needed:
            break
        if cache is not own or name not in used:
            room += cache._kept[name][0].nbytes
            spare.append((cache, name))
    if room < needed:
        return False
    for cache, name in spare:
        cache._drop(name)
    return True
