"""Evaluations of users' simulators: in processes, on a cluster, kept on disk; their slopes, and emulators of them."""

from mofit.simulation.evaluation.cached import Cached
from mofit.simulation.evaluation.dask_executor import DaskExecutor
from mofit.simulation.evaluation.isolated_executor import IsolatedExecutor
from mofit.simulation.evaluation.task import Done, Evaluation, Executor, Task

__all__ = ["Cached", "DaskExecutor", "Done", "Evaluation", "Executor", "IsolatedExecutor", "Task"]
