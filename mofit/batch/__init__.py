"""Many campaigns: the same work on every one, resumable, in local processes or on a Dask cluster."""

from mofit.batch.batch import BatchJob, run_batch
from mofit.batch.tasks import Row, Task

__all__ = ["BatchJob", "Row", "Task", "run_batch"]
