"""Evaluations in this process: for simulators that take many parameter sets at once, and for quick ones."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from mofit._typing import FloatArray
from mofit.models import Record
from mofit.models.simulator_call import call_simulator
from mofit.simulation.evaluation import Done, Evaluation, Task


class InProcess:
    """One task after the other; what a simulator warns of is not shown."""

    def run(self, tasks: Sequence[Task], done: Done | None = None) -> list[Evaluation]:
        """An evaluation per task; see `mofit.simulation.evaluation.Executor`."""
        found = []
        for index, task in enumerate(tasks):
            with warnings.catch_warnings(), np.errstate(all="ignore"):
                warnings.simplefilter("ignore")
                answer = call_simulator(task.function, task.record, task.parameters, task.outputs, task.free)
            found.append(Evaluation(*answer))
            if done is not None:
                done(index, found[-1])
        return found


class OneOfMany:
    """A function of many parameter sets, called with one."""

    def __init__(self, function: Any) -> None:
        self.function = function

    def __call__(self, record: Record, parameters: Mapping[str, float]) -> Any:
        """The outputs of one set."""
        found = self.function(record, {name: np.array([value]) for name, value in parameters.items()})
        return _row(found, 0)


def evaluate_many(
    function: Any, record: Record, parameters: Mapping[str, FloatArray], outputs: tuple[str, ...]
) -> list[Evaluation]:
    """Evaluations of a function of many parameter sets: ``parameters`` are arrays (N,)."""
    count = len(next(iter(parameters.values())))
    returned: list[Any] = []

    def whole(record: Record, _: Mapping[str, float]) -> FloatArray:
        returned.append(function(record, parameters))
        return np.zeros(len(record.time))

    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        called = call_simulator(whole, record, {}, outputs[:1], ())
    if called.failure is not None:
        return [Evaluation(None, failure=called.failure)] * count
    rows = (lambda record, _, k=k: _row(returned[0], k) for k in range(count))
    return [Evaluation(*call_simulator(row, record, {}, outputs, ())) for row in rows]


def _row(found: Any, k: int) -> Any:
    """The outputs of one set among those of many."""
    if isinstance(found, Mapping):
        return {name: np.asarray(values)[k] for name, values in found.items()}
    return np.asarray(found)[k]
