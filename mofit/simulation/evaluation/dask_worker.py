"""What the workers of a Dask cluster do; imported where Dask is installed."""

from __future__ import annotations

from collections.abc import Sequence

from distributed import Worker, WorkerPlugin, get_worker

from mofit.simulation.evaluation.isolated_executor import IsolatedExecutor
from mofit.simulation.evaluation.task import Evaluation, SentTask


class EvaluatingPlugin(WorkerPlugin):
    """Gives a worker an executor for as long as the plugin is registered."""

    def __init__(self, name: str, timeout: float) -> None:
        self.name, self.timeout = name, timeout
        self.executor: IsolatedExecutor | None = None

    def setup(self, worker: Worker) -> None:
        """Make the executor; its processes start with the first tasks."""
        self.executor = IsolatedExecutor(timeout=self.timeout)

    def teardown(self, worker: Worker) -> None:
        """End its processes."""
        if self.executor is not None:
            self.executor.close()


def evaluate(plugin: str, tasks: Sequence[SentTask]) -> list[Evaluation]:
    """Evaluate tasks, one after the other; every thread of the worker has a process."""
    own = get_worker().plugins[plugin]
    assert isinstance(own, EvaluatingPlugin)
    assert own.executor is not None
    return own.executor.run_sent(tasks)
