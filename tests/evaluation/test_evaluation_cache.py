"""Evaluations on disk: none twice, none lost by a kill, none mistaken for another."""

import os
import signal
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from hostile_simulators import CRASH, HANG, NAN, RAISE, hostile

from mofit.errors import InputError
from mofit.models.black_box import Record
from mofit.simulation.evaluation import Cached, Evaluation, IsolatedExecutor, Task

TIME = np.arange(101) / 100
RECORD = Record("sine", TIME, {"displacement": np.sin(TIME)}, {"load": 3.0})


class Counting:
    """An executor that answers k times the input, with slopes if asked, and keeps what it was asked."""

    def __init__(self):
        self.asked = []

    def run(self, tasks, done=None):
        found = []
        for index, task in enumerate(tasks):
            self.asked.append(task)
            slopes = np.ones((101, 1, len(task.free))) if task.free else None
            found.append(Evaluation(task.parameters["k"] * np.ones((101, 1)), slopes))
            if done is not None:
                done(index, found[-1])
        return found


def task(k, record=RECORD, **more):
    return Task(hostile, record, {"k": k}, ("force",), **more)


def test_none_is_evaluated_twice(tmp_path):
    first, second, told = Counting(), Counting(), []
    Cached(first, tmp_path / "new", "v1").run([task(1.0), task(2.0, free=("k",)), task(1.0)])
    assert [one.parameters["k"] for one in first.asked] == [1.0, 2.0]
    found = Cached(second, tmp_path / "new", "v1").run(
        [task(3.0), task(2.0, free=("k",)), task(1.0)], lambda index, evaluation: told.append(index)
    )
    assert [one.parameters["k"] for one in second.asked] == [3.0]
    assert [one.outputs[0, 0] for one in found] == [3.0, 2.0, 1.0]
    assert [one.slopes is None for one in found] == [True, False, True]
    np.testing.assert_array_equal(found[1].slopes, np.ones((101, 1, 1)))
    assert sorted(told) == [0, 1, 2]


@pytest.mark.parametrize(
    "other",
    [
        task(np.nextafter(1.0, 2.0)),
        task(1.0, free=("k",)),
        replace(task(1.0), outputs=("power",)),
        replace(task(1.0), parameters={"k": 1.0, "d": 0.0}),
        task(1.0, replace(RECORD, name="other")),
        task(1.0, replace(RECORD, time=2 * TIME)),
        task(1.0, replace(RECORD, inputs={"displacement": np.sin(TIME) + 1e-15})),
        task(1.0, replace(RECORD, inputs={"angle": np.sin(TIME)})),
        task(1.0, replace(RECORD, conditions={"load": 4.0})),
    ],
    ids=["value", "slopes", "output", "parameters", "name", "time", "samples", "channel", "condition"],
)
def test_whatever_decides_an_evaluation_is_told_apart(other, tmp_path):
    executor = Counting()
    Cached(executor, tmp_path, "v1").run([task(1.0), other])
    assert len(executor.asked) == 2


def test_another_fingerprint_is_another_simulator(tmp_path):
    executor = Counting()
    for fingerprint in ("v1", "v2", "v1"):
        Cached(executor, tmp_path, fingerprint).run([task(1.0)])
    assert len(executor.asked) == 2


class Marked:
    """A function that brings its fingerprint."""

    fingerprint = "own"

    def __call__(self, record, parameters):
        raise NotImplementedError


def test_the_fingerprint_may_be_the_functions_and_without_one_nothing_is_kept(tmp_path):
    executor = Counting()
    for _ in range(2):
        Cached(executor, tmp_path).run([replace(task(1.0), function=Marked()), task(1.0), task(1.0)])
    assert [one.function is hostile for one in executor.asked] == [False, True, True, True, True]


def test_failures_are_kept_but_not_what_may_be_the_machines(tmp_path):
    values, executor = (CRASH, HANG, NAN, RAISE), Counting()
    with IsolatedExecutor(jobs=2, timeout=1.0) as isolated:
        before = Cached(isolated, tmp_path, "v1").run([task(k) for k in values])
    after = Cached(executor, tmp_path, "v1").run([task(k) for k in values])
    assert [one.parameters["k"] for one in executor.asked] == [CRASH, HANG]
    assert [one.failure for one in after[2:]] == [one.failure for one in before[2:]]
    assert after[2].failure == "nan at 0.3 s"


SCRIPT = """
import os, sys, time
import numpy as np
from pathlib import Path
from mofit.models.black_box import Record
from mofit.simulation.evaluation import Cached, IsolatedExecutor, Task

def slow(record, parameters):
    time.sleep(0.05)
    return parameters["k"] * np.ones(3)

def told(index, evaluation):
    print(index, flush=True)

record = Record("one", np.arange(3.0), {}, {})
tasks = [Task(slow, record, {"k": float(k)}, ("y",)) for k in range(int(sys.argv[2]))]
with IsolatedExecutor() as executor:
    Cached(executor, Path(sys.argv[1]), "v1").run(tasks, told)
"""


def test_a_killed_run_goes_on_where_it_was(tmp_path):
    command = [sys.executable, "-c", SCRIPT, str(tmp_path), "1000"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        for line in process.stdout:
            if int(line) == 60:  # three seconds of work
                break
        process.send_signal(signal.SIGKILL)
    executor, record = Counting(), Record("one", np.arange(3.0), {}, {})
    tasks = [Task(hostile, record, {"k": float(k)}, ("y",)) for k in range(61)]
    found = Cached(executor, tmp_path, "v1").run(tasks)
    kept = 61 - len(executor.asked)
    assert kept >= 10
    assert [one.outputs[0, 0] for one in found] == [float(k) for k in range(61)]
    assert all(one.outputs.shape == (3, 1) for one in found[:kept])


def test_two_processes_may_use_it_at_once(tmp_path):
    command = [sys.executable, "-c", SCRIPT, str(tmp_path), "40"]
    both = [subprocess.Popen(command, stdout=subprocess.DEVNULL, env=os.environ) for _ in range(2)]
    assert [process.wait(timeout=120) for process in both] == [0, 0]
    executor, record = Counting(), Record("one", np.arange(3.0), {}, {})
    Cached(executor, tmp_path, "v1").run([Task(hostile, record, {"k": float(k)}, ("y",)) for k in range(40)])
    assert executor.asked == []


def test_a_damaged_file_is_told(tmp_path):
    (tmp_path / "evaluations.sqlite").write_bytes(b"no database at all, whatever it may be" * 100)
    with pytest.raises(InputError, match=r"evaluations\.sqlite.*is damaged.*Remove it"):
        Cached(Counting(), tmp_path, "v1").run([task(1.0)])


def test_a_folder_that_cannot_be_is_told(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="no folder"):
        Cached(Counting(), tmp_path / "file" / "folder", "v1").run([task(1.0)])
