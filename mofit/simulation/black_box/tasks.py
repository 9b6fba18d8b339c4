"""One evaluation of a user's function: what it is asked, and what it answers."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from mofit._typing import FloatArray
from mofit.models.black_box import Record


@dataclass(frozen=True)
class Task:
    """A simulation that is asked for."""

    function: Callable[..., Any]
    record: Record
    parameters: Mapping[str, float]
    outputs: tuple[str, ...]
    free: tuple[str, ...] = ()
    """Slopes wanted by these; only where the function offers ``sensitivities``."""


@dataclass(frozen=True)
class Evaluation:
    """Its answer."""

    outputs: FloatArray | None
    """Shape (n, ny); None: failed."""
    slopes: FloatArray | None = None
    """Derivatives by the free parameters, (n, ny, nf)."""
    failure: str | None = None
    """Why it failed, in words."""


class Executor(Protocol):
    """Runs tasks; results are in their order and do not depend on the number of workers."""

    def run(self, tasks: Sequence[Task]) -> list[Evaluation]:
        """An evaluation per task."""


class InProcess:
    """One task after the other, in this process."""

    def run(self, tasks: Sequence[Task]) -> list[Evaluation]:
        """An evaluation per task."""
        return [evaluated(task) for task in tasks]


def evaluated(task: Task) -> Evaluation:
    """Call the function; what it raises, and what is not finite, is a failure."""
    count = len(task.record.time)
    try:
        with np.errstate(all="ignore"):
            return _called(task, count)
    except Exception as error:  # noqa: BLE001 - whatever a user's function raises is a failed simulation
        return Evaluation(None, failure=f"{type(error).__name__}: {error}")


def _called(task: Task, count: int) -> Evaluation:
    if not task.free:
        outputs = as_columns(task.function(task.record, task.parameters), task.outputs, count)
        return checked(outputs, None, task.record)
    given: Any = task.function
    outputs, slopes = given.sensitivities(task.record, task.parameters, task.free)
    shape = (count, len(task.outputs), len(task.free))
    return checked(np.reshape(outputs, shape[:2]), np.reshape(slopes, shape), task.record)


def as_columns(returned: Any, outputs: Sequence[str], count: int) -> FloatArray:
    """What a function returned as columns (n, ny), one per output.

    Raises
    ------
    ValueError
        If an output is missing or has another number of samples.
    """
    if not isinstance(returned, Mapping):
        if len(outputs) > 1:
            raise ValueError(f"the function returned one array for {len(outputs)} outputs: return a mapping of names")
        returned = {outputs[0]: returned}
    if missing := [name for name in outputs if name not in returned]:
        raise ValueError(f"the function returned no '{missing[0]}'")
    columns = [np.asarray(returned[name], dtype=float).ravel() for name in outputs]
    for name, column in zip(outputs, columns, strict=True):
        if len(column) != count:
            raise ValueError(f"output '{name}' has {len(column)} samples, the record {count}")
    return np.stack(columns, axis=1)


def checked(outputs: FloatArray, slopes: FloatArray | None, record: Record) -> Evaluation:
    """The evaluation, failed where something is not finite."""
    good = np.isfinite(outputs).all(axis=1)
    if slopes is not None:
        good &= np.isfinite(slopes).all(axis=(1, 2))
    if good.all():
        return Evaluation(outputs, slopes)
    return Evaluation(None, failure=f"not finite at {record.time[int(np.argmin(good))]:.4g} s")
