"""Evaluations on a cluster: the same as here, and a lost worker's are repeated by another."""

import os
import signal

import numpy as np
import pytest
from hostile_simulators import CRASH, HANG, NAN, hostile

from mofit.errors import InputError
from mofit.models.black_box import Record
from mofit.simulation.evaluation import DaskExecutor, IsolatedExecutor, Task

distributed = pytest.importorskip("distributed", reason="needs the extra 'dask'")

TIME = np.arange(101) / 100
RECORD = Record("sine", TIME, {"displacement": np.sin(TIME)}, {})


@pytest.fixture(scope="module")
def cluster():
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=":0", worker_dashboard_address=":0"
    ) as cluster:
        yield cluster


def task(k, function=hostile):
    return Task(function, RECORD, {"k": k}, ("force",))


def slow(record, parameters):
    import time

    time.sleep(0.1)
    return parameters["k"] * record.time


@pytest.mark.slow
def test_a_cluster_evaluates_as_this_machine_does(cluster):
    tasks = [task(float(k)) for k in (1, CRASH, 2, HANG, NAN, *range(10, 60))]
    with IsolatedExecutor(jobs=2, timeout=1.0) as executor:
        expected = executor.run(tasks)
    told = {}
    with DaskExecutor(cluster.scheduler_address, timeout=1.0) as executor:
        found = executor.run(tasks, told.__setitem__)
    assert [one.failure for one in found] == [one.failure for one in expected]
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_array_equal(one.outputs, other.outputs)
    assert told == dict(enumerate(found))


@pytest.mark.slow
def test_a_killed_worker_costs_its_evaluations_only(cluster):
    with distributed.Client(cluster.scheduler_address, set_as_default=False) as client:
        workers = client.run(os.getpid)
        killed = []

        def kill_one(index, evaluation):
            if not killed:
                killed.append(next(iter(workers.values())))
                os.kill(killed[0], signal.SIGKILL)

        with DaskExecutor(cluster.scheduler_address) as executor:
            found = executor.run([task(float(k), slow) for k in range(60)], kill_one)
    assert killed
    for k, one in enumerate(found):
        assert one.failure is None
        np.testing.assert_array_equal(one.outputs[:, 0], k * TIME)


def test_no_scheduler():
    with pytest.raises(InputError, match=r"--dask tcp://127\.0\.0\.1:9: no scheduler answers"):
        DaskExecutor("tcp://127.0.0.1:9", patience=1.0)
