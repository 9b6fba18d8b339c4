"""Evaluations in processes of this machine."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from queue import SimpleQueue
from threading import Event, Thread

from mofit.errors import InputError
from mofit.models.simulator_call import call_simulator
from mofit.runtime.isolated import Answer, IsolatedProcess, ProcessLostError
from mofit.simulation.evaluation.task import Done, Evaluation, SentTask, Task, sent

#: How often a task is tried whose process was ended from outside.
_TRIES = 3
#: Tasks that a process takes at once, at most, and at least so many chunks per process while there are enough tasks.
_TOGETHER, _CHUNKS = 16, 4
#: What a process imports before it forks the child that calls.
_PRELOAD = (call_simulator.__module__,)


class IsolatedExecutor:
    """Evaluates in processes beside this one: a simulator that crashes or hangs costs one evaluation.

    Every process keeps the simulator (an FMU stays loaded) and the records that it was sent. `close` ends them; they
    end with this process in any case.

    Parameters
    ----------
    jobs
        Number of processes.
    timeout
        Seconds that one simulation may take.
    log
        File for what simulators print; by default it is dropped.

    Raises
    ------
    InputError
        If jobs or timeout cannot be used.
    """

    def __init__(self, jobs: int = 1, timeout: float = 60.0, log: Path | None = None) -> None:
        if jobs < 1:
            raise InputError.of(f"jobs {jobs}", "cannot be used", "Give at least 1")
        if not timeout > 0:
            raise InputError.of(f"timeout {timeout:g} s", "cannot be used", "Give a time above 0 for one simulation")
        self.jobs, self.timeout, self.log = jobs, timeout, log
        self._idle: deque[IsolatedProcess] = deque()

    def __enter__(self) -> IsolatedExecutor:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        """End the processes; the next run starts others."""
        while self._idle:
            self._idle.pop().close()

    def run(self, tasks: Sequence[Task], done: Done | None = None) -> list[Evaluation]:
        """Evaluate; several threads may do so at once. See `Executor.run`.

        Raises
        ------
        InputError
            If a simulator cannot be sent to another process.
        """
        return self.run_sent(sent(tasks), done)

    def run_sent(self, tasks: Sequence[SentTask], done: Done | None = None) -> list[Evaluation]:
        """Evaluate tasks whose objects are bytes already; see `run`."""
        pending, stop = deque(range(len(tasks))), Event()
        results: SimpleQueue[tuple[int, Evaluation | BaseException]] = SimpleQueue()
        preload = tuple(dict.fromkeys(name for task in tasks for name in task.preload))
        processes = [self._process(preload) for _ in range(min(self.jobs, len(tasks)))]
        threads = [
            Thread(target=self._work, args=(process, tasks, pending, stop, results), daemon=True)
            for process in processes
        ]
        found: dict[int, Evaluation] = {}
        try:
            for thread in threads:
                thread.start()
            for _ in tasks:
                index, result = results.get()
                if isinstance(result, BaseException):
                    raise result
                found[index] = result
                if done is not None:
                    done(index, result)
        finally:
            stop.set()
            for thread, process in zip(threads, processes, strict=True):
                while thread.is_alive():
                    if len(found) < len(tasks):  # nobody waits for what it does any more
                        process.end()
                    thread.join(0.05)
            self._idle.extend(processes)
        return [found[index] for index in range(len(tasks))]

    def _process(self, preload: tuple[str, ...]) -> IsolatedProcess:
        try:
            return self._idle.pop()
        except IndexError:
            return IsolatedProcess((*_PRELOAD, *preload), self.log)

    def _work(
        self,
        process: IsolatedProcess,
        tasks: Sequence[SentTask],
        pending: deque[int],
        stop: Event,
        results: SimpleQueue[tuple[int, Evaluation | BaseException]],
    ) -> None:
        try:
            while not stop.is_set() and (chunk := self._chunk(pending)):
                tries = 0
                while chunk and not stop.is_set():
                    try:
                        for answer in process.answers([tasks[index].call for index in chunk], self.timeout):
                            results.put((chunk.popleft(), _evaluation(answer)))
                            tries = 0
                    except ProcessLostError as error:
                        tries += 1
                        if tries == _TRIES:
                            results.put((chunk.popleft(), Evaluation(None, failure=str(error), lost=True)))
                            tries = 0
        except BaseException as error:  # noqa: BLE001  raised again by who waits
            results.put((-1, error))

    def _chunk(self, pending: deque[int]) -> deque[int]:
        """The next tasks of one process: the fewer are left the fewer, so that all processes end together."""
        chunk: deque[int] = deque()
        for _ in range(min(_TOGETHER, max(1, len(pending) // (_CHUNKS * self.jobs)))):
            with suppress(IndexError):  # another thread took the last one
                chunk.append(pending.popleft())
        return chunk


def _evaluation(answer: Answer) -> Evaluation:
    if answer.failure is not None:
        return Evaluation(None, failure=answer.failure, lost=answer.lost)
    return Evaluation(*answer.value)
