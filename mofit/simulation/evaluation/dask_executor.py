"""Evaluations on a Dask cluster."""

from __future__ import annotations

import uuid
from collections.abc import Sequence
from typing import TYPE_CHECKING

from mofit.errors import InputError
from mofit.runtime.cluster import connected
from mofit.simulation.evaluation.task import Done, Evaluation, SentTask, Task, sent

if TYPE_CHECKING:
    from distributed import Future

#: Tasks that go to a worker together, at most: few are repeated when it is lost.
_TOGETHER = 16
#: Parcels of tasks per thread of the cluster, at least: all end together.
_PARCELS = 8


class DaskExecutor:
    """Evaluates on the workers of a Dask cluster, which must have mofit and see the same files.

    Every worker evaluates in processes beside it, as `IsolatedExecutor` does: a simulator that crashes or hangs costs
    one evaluation, not the worker. What a lost worker had to do is repeated by another one.

    Parameters
    ----------
    address
        Of the scheduler, as tcp://host:port.
    timeout
        Seconds that one simulation may take.
    patience
        Seconds to wait for the scheduler's answer.

    Raises
    ------
    InputError
        If Dask is not installed, or no scheduler answers.
    """

    def __init__(self, address: str, timeout: float = 60.0, patience: float = 15.0) -> None:
        self.address = address
        self._client = connected("--dask", address, patience)
        from mofit.simulation.evaluation.dask_worker import EvaluatingPlugin

        self._plugin = f"mofit-{uuid.uuid4().hex}"
        self._client.register_plugin(EvaluatingPlugin(self._plugin, timeout))

    def __enter__(self) -> DaskExecutor:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        """End the processes of the workers, and leave the cluster."""
        if self._client.status == "running":
            self._client.unregister_worker_plugin(self._plugin)
        self._client.close()

    def run(self, tasks: Sequence[Task], done: Done | None = None) -> list[Evaluation]:
        """Evaluate; see `Executor.run`.

        Raises
        ------
        InputError
            If a simulator cannot be sent to another process, or the cluster is lost.
        """
        from distributed import as_completed

        to_send, found = sent(tasks), dict[int, Evaluation]()
        futures = {self._submitted([to_send[k] for k in place]): place for place in self._places(len(tasks))}
        finished = as_completed(futures, loop=self._client.loop)
        try:
            for future in finished:
                answers = self._answers(future, futures[future])
                if answers is None:  # one of them may have taken the others with it
                    alone = {self._submitted([to_send[k]]): range(k, k + 1) for k in futures[future]}
                    futures |= alone
                    finished.update(alone)
                    continue
                for index, evaluation in zip(futures[future], answers, strict=True):
                    found[index] = evaluation
                    if done is not None:
                        done(index, evaluation)
        except BaseException:
            self._client.cancel(list(futures))  # nobody waits for what they do any more
            raise
        return [found[index] for index in range(len(tasks))]

    def _submitted(self, tasks: Sequence[SentTask]) -> Future:
        from mofit.simulation.evaluation.dask_worker import evaluate

        return self._client.submit(evaluate, self._plugin, tasks, pure=False)

    def _places(self, count: int) -> list[range]:
        """Indices of tasks that go to a worker together."""
        threads = max(1, sum(self._client.nthreads().values()))
        size = min(_TOGETHER, max(1, count // (_PARCELS * threads)))
        return [range(begin, min(begin + size, count)) for begin in range(0, count, size)]

    def _answers(self, future: Future, place: range) -> list[Evaluation] | None:
        """Evaluations of a parcel; None where it is to be sent again task by task."""
        from distributed import CancelledError, KilledWorker

        try:
            return list(future.result())
        except KilledWorker:  # worker after worker was lost with it
            if len(place) > 1:
                return None
            return [Evaluation(None, failure="its workers were lost (too little memory?)", lost=True)]
        except (CancelledError, OSError) as error:
            message = f"the cluster was lost ({type(error).__name__})"
            raise InputError.of(f"--dask {self.address}", message, "Start it again, then resume the run") from error
