"""What is to be evaluated, what became of it, and who evaluates."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, TypeAlias

from mofit._typing import FloatArray
from mofit.models.black_box import Record
from mofit.models.simulator_call import call_simulator
from mofit.runtime.isolated import Call
from mofit.runtime.sending import Sendable, sendable


@dataclass(frozen=True, eq=False)
class Task:
    """One simulation: a test at one set of parameters."""

    function: Callable[..., Any]
    """``function(record, parameters)``; it may offer ``sensitivities(record, parameters, free)``."""
    record: Record
    parameters: Mapping[str, float]
    outputs: tuple[str, ...]
    free: tuple[str, ...] = ()
    """Parameters by which slopes are wanted, if the function offers its sensitivities."""


@dataclass(frozen=True, eq=False)
class Evaluation:
    """What became of a task."""

    outputs: FloatArray | None
    """Shape (n, ny); None where it failed."""
    slopes: FloatArray | None = None
    """Derivatives of the outputs by the free parameters, shape (n, ny, nf)."""
    failure: str | None = None
    """Why it failed: "crashed (signal 11)", "no answer within 30 s", "nan at 0.31 s", what was raised."""
    lost: bool = False
    """Whether its process crashed or hung: another machine, or more time, may give an answer."""


@dataclass(frozen=True, eq=False)
class SentTask:
    """A task as it goes to other processes."""

    function: Sendable
    record: Sendable
    parameters: Mapping[str, float]
    outputs: tuple[str, ...]
    free: tuple[str, ...]
    preload: tuple[str, ...] = ()
    """Modules that a process is to import once, before any child: those that the function's ``preload`` names."""

    @property
    def call(self) -> Call:
        """What a process is to call."""
        return Call(call_simulator, (self.function, self.record), (self.parameters, self.outputs, self.free))


def sent(tasks: Sequence[Task]) -> list[SentTask]:
    """Tasks with functions and records as bytes, each pickled once.

    Raises
    ------
    InputError
        If a function cannot be sent to another process.
    """
    known: dict[int, Sendable] = {}  # by identity: the tasks keep the objects

    def once(value: Any, where: str) -> Sendable:
        if id(value) not in known:
            known[id(value)] = sendable(value, where)
        return known[id(value)]

    return [
        SentTask(
            once(task.function, "simulator"),
            once(task.record, f"test '{task.record.name}'"),
            {name: float(value) for name, value in task.parameters.items()},
            task.outputs,
            task.free,
            tuple(getattr(task.function, "preload", ())),
        )
        for task in tasks
    ]


#: called with the index of a task and its evaluation as soon as that is there, in any order
Done: TypeAlias = Callable[[int, Evaluation], None]


class Executor(Protocol):
    """Evaluates tasks."""

    def run(self, tasks: Sequence[Task], done: Done | None = None) -> list[Evaluation]:
        """Evaluations in the order of the tasks; they do not depend on the number of workers."""
        ...
