"""Machine code kept on disk, so that the same model need not be compiled again in the next process.

A file is named by the hash of everything that decides its content (graph, this package, processor, LLVM) and begins
with the hash of the code in it: a damaged file is ignored and written anew. Files are replaced atomically. Without a
folder that can be written to, nothing is kept.
"""

from __future__ import annotations

import os
import tempfile
from contextlib import suppress
from hashlib import sha256
from pathlib import Path

#: Names the folder instead of the user's cache folder; empty: nothing is kept.
VARIABLE = "MOFIT_KERNEL_CACHE"
#: Oldest files go when the folder holds more; one model takes about ten of 10 kB each, a diagnosis some hundreds.
_MOST_FILES = 5000
_DIGEST = sha256().digest_size


def folder() -> Path | None:
    """Where code is kept: ``$MOFIT_KERNEL_CACHE``, else ``mofit/kernel`` in the user's cache folder."""
    named = os.environ.get(VARIABLE)
    if named is not None:
        return Path(named) if named else None
    with suppress(RuntimeError):
        return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "mofit" / "kernel"
    return None


def load(key: str) -> bytes | None:
    """Code kept under a key; None if there is none or it is damaged."""
    place = folder()
    if place is None:
        return None
    try:
        content = (place / key).read_bytes()
    except OSError:
        return None
    code = content[_DIGEST:]
    return code if sha256(code).digest() == content[:_DIGEST] else None


def keep(key: str, code: bytes) -> None:
    """Keep code under a key, if the disk allows."""
    place = folder()
    if place is None:
        return
    with suppress(OSError):
        place.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(dir=place, prefix=".")
        with os.fdopen(handle, "wb") as file:
            file.write(sha256(code).digest() + code)
        os.replace(temporary, place / key)
        _thin(place)


def _thin(place: Path) -> None:
    files = [path for path in place.iterdir() if not path.name.startswith(".")]
    if len(files) > _MOST_FILES:
        files.sort(key=lambda path: path.stat().st_mtime)
        for path in files[: len(files) - _MOST_FILES]:
            path.unlink(missing_ok=True)
