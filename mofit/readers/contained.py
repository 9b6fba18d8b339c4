"""Files that a library parses are read in a process of their own, so that a damaged one can do no harm."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from types import TracebackType

import numpy as np

from mofit.errors import Fault, InputError
from mofit.readers.columns import Columns

#: wall time in s that one file may take, and what a big one may take beyond that
SECONDS = 60
BYTES_PER_SECOND = 5_000_000


class Contained:
    """Reads MAT and MDF files one after another in a child process (`mofit.readers.worker`).

    Damaged files make the libraries that parse them loop without end (linked blocks in a circle), ask for any amount
    of memory, or crash the interpreter; none of these can be told before, nor stopped from inside. The child sets
    itself an alarm and a limit on memory, and is started anew after it died.

    Parameters
    ----------
    seconds
        Wall time that one file may take, in s; a big one gets more.
    """

    def __init__(self, seconds: int = SECONDS) -> None:
        self.seconds = seconds
        self._process: subprocess.Popen[bytes] | None = None
        self._folder: tempfile.TemporaryDirectory[str] | None = None

    def __enter__(self) -> Contained:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stop()

    def columns(self, path: Path) -> Columns:
        """Columns and units of a file.

        Raises
        ------
        InputError
            If the file cannot be read, within its time and memory.
        """
        process = self._start()
        assert process.stdin is not None
        assert process.stdout is not None
        allowed = self.seconds + path.stat().st_size // BYTES_PER_SECOND
        try:
            process.stdin.write(json.dumps([str(path.resolve()), path.name, allowed]).encode() + b"\n")
            process.stdin.flush()
            answer = json.loads(process.stdout.readline() or "null")
            sizes = [count for _, count in (answer or {}).get("columns", [])]
            # whole or not at all: the process may die in the middle
            numbers = np.frombuffer(process.stdout.read(8 * sum(sizes)), dtype="<f8")
        except (BrokenPipeError, ValueError):
            answer = None
        except BaseException:
            # interrupted in between: what is still under way belongs to no later file
            self._stop()
            raise
        if answer is None or ("columns" in answer and numbers.size < sum(sizes)):
            self._stop()
            what = f"damaged: reading it crashed, or took more than {allowed} s"
            raise InputError.of(f"file '{path.name}'", what, "Copy or export it again")
        if "faults" in answer:
            raise InputError(Fault(*fault) for fault in answer["faults"])
        parts = np.split(numbers.astype(float), np.cumsum(sizes)[:-1])
        return dict(zip((name for name, _ in answer["columns"]), parts, strict=True)), answer["units"]

    def _start(self) -> subprocess.Popen[bytes]:
        if self._process is None:
            # what the libraries unpack on disk goes with the process, however it ended
            self._folder = tempfile.TemporaryDirectory(prefix="mofit-")
            root = str(Path(__file__).resolve().parents[2])
            search = os.pathsep.join([root, *(entry for entry in sys.path if entry)])
            self._process = subprocess.Popen(
                [sys.executable, "-W", "ignore", "-m", "mofit.readers.worker"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                env={**os.environ, "PYTHONPATH": search, "TMPDIR": self._folder.name},
            )
        return self._process

    def _stop(self) -> None:
        if self._process is not None:
            for pipe in (self._process.stdin, self._process.stdout):
                assert pipe is not None
                try:
                    pipe.close()
                except BrokenPipeError:
                    continue
            self._process.kill()
            self._process.wait()
            self._process = None
        if self._folder is not None:
            self._folder.cleanup()
            self._folder = None
