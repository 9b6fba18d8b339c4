"""Memory that was freed goes back to the system."""

from __future__ import annotations

import ctypes
import sys
from contextlib import suppress

#: ``mallopt`` of glibc: bytes free at the top of the heap, and bytes of an array, from which memory is returned
_TRIM_THRESHOLD, _MMAP_THRESHOLD = (-1, 1 << 25), (-3, 1 << 22)
#: ``prctl`` of Linux: no page of 2 MB, of which one number that lives on keeps all
_NO_HUGE_PAGES = (41, 1, 0, 0, 0)


def return_at_once() -> None:
    """From now on large arrays go back to the system when they are freed.

    glibc keeps up to 32 MB of each otherwise, in pieces between what lives on, and numpy asks for huge pages. Nothing
    happens where the C library is another one.
    """
    if sys.platform == "linux":
        with suppress(OSError, AttributeError):
            library = ctypes.CDLL(None)
            for option in (_TRIM_THRESHOLD, _MMAP_THRESHOLD):
                library.mallopt(*option)
            library.prctl(*_NO_HUGE_PAGES)


def give_back() -> None:
    """Return what is free to the system; glibc would keep it for later, in pieces that large arrays do not fit into.

    Nothing happens where the C library is another one.
    """
    if sys.platform == "linux":
        with suppress(OSError, AttributeError):
            ctypes.CDLL(None).malloc_trim(0)
