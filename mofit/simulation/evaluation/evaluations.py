"""The simulations of a user's simulator: counted, bounded, and none made twice."""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from mofit.models import Model, Record, Simulator
from mofit.models.extended_model import ExtendedModel
from mofit.simulation.evaluation import Evaluation, Executor, Task
from mofit.simulation.evaluation.differences import Step
from mofit.simulation.evaluation.in_process import InProcess, OneOfMany, evaluate_many

#: bytes of answers that are remembered
_REMEMBERED = 1_000_000_000
#: what is answered beyond the limit
SPENT = "the simulations that are allowed are spent"


class Call(NamedTuple):
    """A simulation of a record at values of the parameters, in the simulator's order."""

    record: Record
    values: tuple[float, ...]
    free: tuple[str, ...] = ()

    @property
    def key(self) -> bytes:
        """What decides its answer."""
        return self.record.digest + np.array(self.values).tobytes() + "/".join(self.free).encode()


class Evaluations:
    """Answers calls of a simulator.

    Parameters
    ----------
    box
        The simulator.
    limit
        Most simulations; what is asked beyond them fails. None: no limit.
    executor
        Runs them; by default this process.
    """

    def __init__(self, box: Simulator, limit: int | None = None, executor: Executor | None = None) -> None:
        self.box, self.limit = box, math.inf if limit is None else limit
        self.executor = executor
        """Runs them; None: this process."""
        self._known: OrderedDict[bytes, Evaluation] = OrderedDict()
        self._bytes = 0
        self.count = 0
        """Simulations so far."""
        self.reserved: dict[str, int] = {}
        """Simulations that are kept for later, by what for."""
        self.failed = 0
        """Those of them that failed."""
        self.refused = 0
        """Simulations that were asked for beyond the limit."""
        self.steps: dict[str, Step] = {}
        """Steps of differences by parameter, see `mofit.simulation.evaluation.differences`."""
        self.near_minimum = False
        """Whether descents take central differences where forward ones are coarse: by these they end beside it."""

    @property
    def left(self) -> float:
        """Simulations that are still allowed."""
        return max(self.limit - sum(self.reserved.values()) - self.count, 0)

    def settle(self, near_minimum: bool) -> None:
        """From now on descents are near a minimum or not; steps of differences are found anew."""
        self.near_minimum = near_minimum
        self.steps.clear()

    @property
    def offers_slopes(self) -> bool:
        """Whether the function gives derivatives itself."""
        return callable(getattr(self.box.function, "sensitivities", None)) and not self.box.many

    def run(self, calls: Sequence[Call]) -> list[Evaluation]:
        """The answers, in the order of the calls; alike calls are one simulation."""
        keys = [call.key for call in calls]
        new = {key: call for key, call in zip(keys, calls, strict=True) if key not in self._known}
        allowed = dict(list(new.items())[: int(min(self.left, len(new)))])
        self.refused += len(new) - len(allowed)
        found = dict(zip(allowed, self._answers(list(allowed.values())), strict=True))
        self.count += len(found)
        self.failed += sum(one.outputs is None for one in found.values())
        answers = [found.get(key) or self._known.get(key) or Evaluation(None, failure=SPENT) for key in keys]
        for key, answer in found.items():
            self._remember(key, answer)
        return answers

    def _remember(self, key: bytes, answer: Evaluation) -> None:
        self._known[key] = answer
        self._bytes += _size(answer)
        while self._bytes > _REMEMBERED:
            _, oldest = self._known.popitem(last=False)
            self._bytes -= _size(oldest)

    def _answers(self, calls: Sequence[Call]) -> list[Evaluation]:
        if self.box.many and self.executor is None:
            return self._of_many(calls)
        outputs = tuple(channel.name for channel in self.box.outputs)
        function = OneOfMany(self.box.function) if self.box.many else self.box.function
        tasks = [Task(function, call.record, self._named(call.values), outputs, call.free) for call in calls]
        return (self.executor or InProcess()).run(tasks) if tasks else []

    def _named(self, values: Sequence[Any]) -> dict[str, Any]:
        return {one.name: value for one, value in zip(self.box.parameters, values, strict=True)}

    def _of_many(self, calls: Sequence[Call]) -> list[Evaluation]:
        """Those of a record at a time."""
        outputs = tuple(channel.name for channel in self.box.outputs)
        found: dict[int, Evaluation] = {}
        records: dict[bytes, list[int]] = {}
        for k, call in enumerate(calls):
            records.setdefault(call.record.digest, []).append(k)
        for places in records.values():
            record = calls[places[0]].record
            parameters = self._named(
                [np.array(column) for column in zip(*(calls[k].values for k in places), strict=True)]
            )
            found |= dict(zip(places, evaluate_many(self.box.function, record, parameters, outputs), strict=True))
        return [found[k] for k in range(len(calls))]


def _size(answer: Evaluation) -> int:
    return sum(values.nbytes for values in (answer.outputs, answer.slopes) if values is not None)


def simulator_of(model: Model) -> Simulator | None:
    """The user's simulator that a model is made of; None of one that has equations."""
    base = model.base if isinstance(model, ExtendedModel) else model
    return base if isinstance(base, Simulator) else None


def evaluations_of(model: Model) -> Evaluations | None:
    """Those of a model that is a user's simulator, effects or not; None of one that has equations."""
    box = simulator_of(model)
    return None if box is None else box.once(Evaluations)


def with_evaluations(model: Model, limit: int | None, executor: Executor | None = None) -> Model:
    """A model whose simulations begin to count anew, and run where they ran; of equations the model as it is."""
    box = simulator_of(model)
    if box is None:
        return model
    fresh = box.with_shared(Evaluations, Evaluations(box, limit, executor or box.once(Evaluations).executor))
    return ExtendedModel(fresh, model.effects) if isinstance(model, ExtendedModel) else fresh
