"""The process that reads MAT and MDF files for `mofit.readers.contained`: a request a line in, columns out."""

from __future__ import annotations

import json
import os
import resource
import signal
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from mofit.errors import InputError
from mofit.readers.columns import Columns
from mofit.readers.mat import mat_columns
from mofit.readers.mdf import mdf_columns

#: bytes that reading may take: for the libraries, and per byte of the file
MEMORY, MEMORY_PER_BYTE = 2 << 30, 32

READERS: dict[str, Callable[[Path], Columns]] = {".mat": mat_columns, ".mf4": mdf_columns, ".mdf": mdf_columns}


def main() -> None:
    """Answer requests until standard input ends.

    A request is ``[path, name, seconds]``; the answer is one line of JSON, then the numbers of every column (``<f8``).
    """
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    answers = os.fdopen(os.dup(1), "wb")
    # what a library prints must not get between the answers
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    for line in sys.stdin.buffer:
        path, name, seconds = json.loads(line)
        _limit_memory(Path(path).stat().st_size)
        # the default action of the alarm ends the process, whatever it is in
        signal.alarm(seconds)
        head, numbers = _answer(Path(path), name)
        signal.alarm(0)
        answers.write(json.dumps(head).encode() + b"\n")
        for values in numbers:
            answers.write(np.ascontiguousarray(values, dtype="<f8").tobytes())
        answers.flush()


def _limit_memory(size: int) -> None:
    """So that an allocation which a sound file of this size (bytes) would not need fails."""
    _, hard = resource.getrlimit(resource.RLIMIT_DATA)
    limit = MEMORY + MEMORY_PER_BYTE * size
    resource.setrlimit(resource.RLIMIT_DATA, (limit if hard == resource.RLIM_INFINITY else min(limit, hard), hard))


def _answer(path: Path, name: str) -> tuple[dict[str, Any], list[np.ndarray]]:
    where = f"file '{name}'"
    try:
        columns, units = READERS[path.suffix.lower()](path)
    except InputError as error:
        return {"faults": [[_clean(text) for text in (f.where, f.what, f.cure)] for f in error.faults]}, []
    except Exception as error:  # noqa: BLE001  a damaged file raises anything, from struct.error to MemoryError
        reason = (str(error).splitlines() or [""])[0][:200] or type(error).__name__
        what = f"not a readable {path.suffix.lower()[1:].upper()} file ({_clean(reason)})"
        return {"faults": [[where, what, "Copy it again"]]}, []
    if not columns:
        return {"faults": [[where, "holds no numeric vector", "Save the signals as vectors"]]}, []
    named = {_clean(name): values for name, values in columns.items()}
    head = {"columns": [[name, values.size] for name, values in named.items()]}
    return {**head, "units": {_clean(name): _clean(unit) for name, unit in units.items()}}, list(named.values())


def _clean(text: str) -> str:
    """Text that can be printed and stored: names of damaged files hold bytes that are no UTF-8."""
    return text.encode("utf-8", "replace").decode("utf-8").replace("\0", "?")


if __name__ == "__main__":
    main()
