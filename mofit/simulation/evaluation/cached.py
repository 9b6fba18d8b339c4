"""Evaluations kept on disk, so that a killed run loses next to nothing."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from hashlib import sha256
from pathlib import Path

import numpy as np

from mofit.simulation.evaluation.evaluation_file import opened
from mofit.simulation.evaluation.task import Done, Evaluation, Executor, Task


class Cached:
    """An executor that keeps evaluations in a file of a folder and evaluates none twice.

    What decides an evaluation is the fingerprint of the simulator, the record, the parameters, and what is asked for.
    New evaluations are written every second, in transactions: a killed process leaves the file whole, and several
    processes may use it at once. Crashes and time-outs are not kept; they may be the machine's.

    Parameters
    ----------
    executor
        Evaluates what is not known.
    folder
        Where the file is; made if need be.
    fingerprint
        Text that changes with anything that can change a number of the simulator. By default the attribute
        ``fingerprint`` of each task's function; of a function without one nothing is kept.
    """

    def __init__(self, executor: Executor, folder: Path, fingerprint: str | None = None) -> None:
        self.executor, self.file, self.fingerprint = executor, folder / "evaluations.sqlite", fingerprint

    def run(self, tasks: Sequence[Task], done: Done | None = None) -> list[Evaluation]:
        """Take what is known from the file, evaluate the rest; see `Executor.run`.

        Raises
        ------
        InputError
            If the file is damaged or cannot be made.
        WriteError
            If the disk is full; what was written before stays.
        """
        results: dict[int, Evaluation] = {}

        def finished(index: int, evaluation: Evaluation) -> None:
            results[index] = evaluation
            if done is not None:
                done(index, evaluation)

        keys = [self._key(task) for task in tasks]
        with opened(self.file) as file:
            unknown: dict[object, list[int]] = {}  # alike tasks are evaluated once
            for index, key in enumerate(keys):
                known = None if key is None else file.read(key)
                if known is None:
                    unknown.setdefault(index if key is None else key, []).append(index)
                else:
                    finished(index, known)
            alike = list(unknown.values())

            def keep(number: int, evaluation: Evaluation) -> None:
                key = keys[alike[number][0]]
                if key is not None and not evaluation.lost:
                    file.add(key, evaluation)
                for index in alike[number]:
                    finished(index, evaluation)

            if alike:
                self.executor.run([tasks[indices[0]] for indices in alike], keep)
        return [results[index] for index in range(len(tasks))]

    def _key(self, task: Task) -> bytes | None:
        """Hash of all that decides an evaluation; None where that is not known."""
        fingerprint = self.fingerprint or getattr(task.function, "fingerprint", None)
        if fingerprint is None:
            return None
        record, found = task.record, sha256()
        parts: list[tuple[str, bytes]] = [("simulator", fingerprint.encode()), (record.name, _bytes(record.time))]
        parts += [(name, _bytes(values)) for name, values in sorted(record.inputs.items())]
        for numbers in (record.conditions, task.parameters):
            parts += [(name, struct.pack("<d", value)) for name, value in sorted(numbers.items())]
            parts.append(("", b""))
        parts += [(name, b"") for name in (record.interpolation, *task.outputs, "", *task.free)]
        for name, content in parts:  # with their lengths, so that no two lists look alike
            found.update(struct.pack("<QQ", len(name.encode()), len(content)) + name.encode() + content)
        return found.digest()


def _bytes(values: object) -> bytes:
    return np.ascontiguousarray(values, dtype="<f8").tobytes()
