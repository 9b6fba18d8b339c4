"""The file of evaluations: written in transactions, shared by processes."""

from __future__ import annotations

import io
import sqlite3
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import numpy as np

from mofit.errors import InputError, WriteError
from mofit.runtime.files import unwritable
from mofit.simulation.evaluation.task import Evaluation

#: Seconds of work that a killed process may lose.
_INTERVAL = 1.0
#: Seconds to wait for another process that writes.
_PATIENCE = 60.0
_MAKE = "CREATE TABLE IF NOT EXISTS evaluations_1 (key BLOB PRIMARY KEY, failure TEXT, arrays BLOB) WITHOUT ROWID"
_READ = "SELECT failure, arrays FROM evaluations_1 WHERE key = ?"
_WRITE = "INSERT OR IGNORE INTO evaluations_1 VALUES (?, ?, ?)"


class EvaluationFile:
    """Evaluations by key in an SQLite file, which is made if need be. See `opened`."""

    def __init__(self, database: sqlite3.Connection) -> None:
        self._database = database
        self._unwritten: list[tuple[bytes, str | None, bytes]] = []
        self._written = time.monotonic()
        with database:
            database.execute(_MAKE)

    def read(self, key: bytes) -> Evaluation | None:
        """The evaluation of a key, if there is one."""
        row = self._database.execute(_READ, (key,)).fetchone()
        if row is None:
            return None
        failure, content = row
        arrays = np.load(io.BytesIO(content), allow_pickle=False) if content else {}
        return Evaluation(arrays.get("outputs"), arrays.get("slopes"), failure)

    def add(self, key: bytes, evaluation: Evaluation) -> None:
        """Keep an evaluation; it is written within a second of work, or by `write`."""
        named = {"outputs": evaluation.outputs, "slopes": evaluation.slopes}
        arrays = {name: array for name, array in named.items() if array is not None}
        content = io.BytesIO()
        if arrays:
            np.savez(content, allow_pickle=False, **arrays)
        self._unwritten.append((key, evaluation.failure, content.getvalue()))
        if time.monotonic() - self._written > _INTERVAL:
            self.write()

    def write(self) -> None:
        """Write what is not written yet, in one transaction."""
        if self._unwritten:
            with self._database:
                self._database.executemany(_WRITE, self._unwritten)
            self._unwritten.clear()
        self._written = time.monotonic()


@contextmanager
def opened(path: Path) -> Iterator[EvaluationFile]:
    """Open a file of evaluations for a block; what is new is written at its end, however it ends.

    Raises
    ------
    InputError
        If the file is damaged, or cannot be made.
    WriteError
        If the disk is full; what was written before stays.
    """
    where = f"file '{path}'"
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with closing(sqlite3.connect(path, timeout=_PATIENCE)) as database:
            file = EvaluationFile(database)
            try:
                yield file
            finally:
                file.write()
    except OSError as error:
        raise unwritable(where, error) from error
    except sqlite3.OperationalError as error:
        if error.sqlite_errorcode == sqlite3.SQLITE_FULL:
            raise WriteError.of(where, "could not be written: the disk is full", "Make room") from error
        raise InputError.of(where, f"cannot be used: {error}", "Name another folder") from error
    except sqlite3.DatabaseError as error:
        raise InputError.of(where, f"is damaged: {error}", "Remove it: what it keeps is simulated again") from error
