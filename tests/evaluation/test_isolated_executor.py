"""Evaluations in processes: what crashes, hangs or fails costs itself alone, and nothing is left behind."""

import inspect
import os
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path
from threading import Lock

import hostile_simulators
import numpy as np
import pytest
from hostile_simulators import CRASH, EXIT, HANG, NAN, RAISE, Line, chatter, hostile, process_of, two_outputs

from mofit.errors import InputError
from mofit.models.black_box import Record
from mofit.models.registry import find_effect
from mofit.simulation.evaluation import IsolatedExecutor, Task

TIME = np.arange(101) / 100
#: where the simulator raises its error
LINE = inspect.getsource(hostile_simulators).splitlines().index('        raise ValueError("no solution at k = 7")') + 1
RECORD = Record("sine", TIME, {"displacement": np.sin(TIME)}, {"load": 3.0})


def task(k, function=hostile, **more):
    return Task(function, RECORD, {"k": k}, ("force",), **more)


def test_each_failure_costs_its_own_evaluation_and_is_told():
    values = [1.0, CRASH, 2.0, HANG, EXIT, NAN, RAISE, 9.0]
    with IsolatedExecutor(jobs=2, timeout=1.0) as executor:
        found = executor.run([task(k) for k in values])
    assert [one.failure for one in found] == [
        None,
        "crashed (signal 11)",
        None,
        "no answer within 1 s",
        "crashed (exit code 7)",
        "nan at 0.3 s",
        f"it raised ValueError in line {LINE}: no solution at k = 7",
        None,
    ]
    assert [one.lost for one in found] == [k in (CRASH, HANG, EXIT) for k in values]
    for k, one in zip(values, found, strict=True):
        if one.failure is None:
            np.testing.assert_array_equal(one.outputs[:, 0], k * np.sin(TIME))
        else:
            assert one.outputs is None


@pytest.mark.parametrize("jobs", [1, 2])
def test_results_and_their_order_do_not_depend_on_the_number_of_processes(jobs):
    told = []
    tasks = [task(10.0 + k) for k in range(40)]
    with IsolatedExecutor(jobs) as executor:
        found = executor.run(tasks, lambda index, evaluation: told.append((index, evaluation)))
        found += executor.run(tasks[:3])
    for k, one in enumerate(found):
        np.testing.assert_array_equal(one.outputs[:, 0], (10.0 + k % 40) * np.sin(TIME))
    assert sorted(index for index, _ in told) == list(range(40))
    assert all(evaluation is found[index] for index, evaluation in told)


def test_a_process_is_kept_until_it_is_lost():
    with IsolatedExecutor() as executor:
        found = executor.run([task(k, function) for k, function in ((1, process_of), (2, process_of), (3, hostile))])
        first, second = (one.outputs[0, 0] for one in found[:2])
        third = executor.run([task(1, process_of)])[0].outputs[0, 0]
    assert first == second
    assert found[2].failure == "crashed (signal 11)"
    assert third != first


def test_functions_of_scripts_are_sent_as_they_are():
    factor = 3.0

    def closure(record, parameters):
        return factor * parameters["k"] * record.time

    with IsolatedExecutor() as executor:
        one, two = executor.run([task(2.0, closure), task(2.0, lambda record, parameters: record.time + factor)])
    np.testing.assert_array_equal(one.outputs[:, 0], 6 * TIME)
    np.testing.assert_array_equal(two.outputs[:, 0], TIME + 3)


USERS_FILE = """
from functools import lru_cache

import mofit
from mofit.models import Applied


@lru_cache
def slope(k):
    return 2 * k


def ramp(record, parameters):
    return slope(parameters["k"]) * record.time


class Doubled(mofit.Effect):
    name, title, on = "doubled", "doubled", ("output",)
    parameters = (mofit.Parameter("q", "1", -1.0, 1.0, 0.1, neutral=0.0),)
    ramp = staticmethod(ramp)

    def apply(self, s, value):
        return Applied((1 + s.q) * value)
"""


def test_functions_of_users_files_are_sent_with_their_file(tmp_path):
    path = tmp_path / "ramp_rig.py"
    path.write_text(USERS_FILE)
    function = find_effect(f"{path}:Doubled").ramp
    path.unlink()  # the process needs the file no more
    with IsolatedExecutor() as executor:
        (one,) = executor.run([task(2.0, function)])
    np.testing.assert_array_equal(one.outputs[:, 0], 4 * TIME)


def test_what_cannot_be_sent_is_refused():
    told = r"simulator: cannot be sent to another process .* inside of the function"
    with IsolatedExecutor() as executor, pytest.raises(InputError, match=told):
        executor.run([task(1.0, partial(hostile, lock=Lock()))])


def test_several_outputs_are_columns_in_the_order_asked_for():
    asked = Task(two_outputs, RECORD, {"k": 2.0}, ("power", "force"))
    lacking = Task(two_outputs, RECORD, {"k": 2.0}, ("force", "heat"))
    only = Task(hostile, RECORD, {"k": 2.0}, ("force", "heat"))
    short = task(2.0, lambda record, parameters: record.time[1:])
    with IsolatedExecutor() as executor:
        found = executor.run([asked, lacking, only, short])
    np.testing.assert_array_equal(found[0].outputs, np.stack([TIME**2, 2 * TIME], axis=1))
    assert [one.failure for one in found[1:]] == [
        "it returned no heat",
        "it returned a ndarray, not a mapping of force, heat",
        "it returned 100 samples, not the record's 101",
    ]


def test_slopes_come_where_they_are_wanted_and_finite():
    tasks = [task(2.0, Line(), free=free) for free in ((), ("k",), ("k", "wild"))] + [task(2.0, free=("k",))]
    with IsolatedExecutor() as executor:
        found = executor.run(tasks)
    for one in found[:3]:
        np.testing.assert_array_equal(one.outputs[:, 0], 2 * TIME)
    assert [one.slopes is None for one in found] == [True, False, True, True]
    np.testing.assert_array_equal(found[1].slopes, TIME[:, np.newaxis, np.newaxis])


def test_what_simulators_print_goes_to_the_log_alone(tmp_path, capfd):
    with IsolatedExecutor(log=tmp_path / "log") as executor:
        executor.run([task(1.0, chatter)])
    with IsolatedExecutor() as executor:
        executor.run([task(1.0, chatter)])
    assert capfd.readouterr() == ("", "")
    assert (tmp_path / "log").read_text() == "to standard output\nto standard error\n"


def test_an_interruption_ends_what_is_under_way():
    def interrupted(index, evaluation):
        raise KeyboardInterrupt

    begin = time.monotonic()
    with IsolatedExecutor(jobs=2, timeout=600) as executor:
        with pytest.raises(KeyboardInterrupt):
            executor.run([task(1.0), task(HANG), task(HANG), task(HANG)], interrupted)
        assert time.monotonic() - begin < 60
        assert executor.run([task(1.0)])[0].failure is None


@pytest.mark.parametrize(("jobs", "timeout"), [(0, 1.0), (1, 0.0), (1, float("nan"))])
def test_settings_that_cannot_be_used(jobs, timeout):
    with pytest.raises(InputError, match="cannot be used"):
        IsolatedExecutor(jobs, timeout)


SCRIPT = """
import os, tempfile, time
import numpy as np
from mofit.models.black_box import Record
from mofit.simulation.evaluation import IsolatedExecutor, Task

def hang(record, parameters):
    with open(os.environ["PROCESSES"], "a") as file:
        file.write(f"{os.getpid()} {os.getppid()} {tempfile.mkdtemp()}\\n")
    time.sleep(3600)

record = Record("one", np.zeros(3), {}, {})
IsolatedExecutor(2).run([Task(hang, record, {}, ("y",))] * 2)
"""


def test_none_outlives_a_parent_that_is_killed(tmp_path):
    file = tmp_path / "processes"
    parent = subprocess.Popen([sys.executable, "-c", SCRIPT], env={**os.environ, "PROCESSES": str(file)})
    processes = wait_for(lambda: file.read_text().split() if file.exists() else [], lambda found: len(found) == 6)
    folders = [Path(processes.pop(k)) for k in (5, 2)]
    assert all(alive(process) for process in processes)
    assert all(folder.is_dir() for folder in folders)
    parent.send_signal(signal.SIGKILL)
    parent.wait()
    assert not wait_for(lambda: [process for process in processes if alive(process)], lambda left: not left)
    assert not any(folder.exists() for folder in folders)


def wait_for(look, enough):
    deadline = time.monotonic() + 60
    while not enough(found := look()) and time.monotonic() < deadline:
        time.sleep(0.05)
    return found


def alive(process):
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False
