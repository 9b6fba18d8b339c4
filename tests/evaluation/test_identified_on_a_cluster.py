"""A whole identification on two workers of a cluster, one of which is killed on the way: the numbers stay the same."""

import os
import signal
import threading
import time

import numpy as np
import pytest
from straight_line import campaign, sine_test

import mofit
from mofit.cli import main
from mofit.data import write_campaign
from mofit.results import simulations

distributed = pytest.importorskip("distributed", reason="needs the extra 'dask'")

LINE = """
import time
from pathlib import Path

from mofit import Channel, Parameter, Simulator

CALLS = Path(__file__).with_name("calls")


def force(record, parameters):
    with CALLS.open("a") as calls:
        calls.write(".")
    time.sleep(0.005)
    return parameters["k"] * record.inputs["displacement"] + parameters["b"]


line = Simulator(
    force,
    [Parameter("k", "N/m", -10.0, 10.0, 1.0), Parameter("b", "N", -10.0, 10.0, 0.0)],
    [Channel("displacement", "m")],
    [Channel("force", "N")],
)
"""
#: Simulations after which a worker is killed: the search is on its way.
KILLED_AFTER = 40


def kill_after(calls, count, pid, killed):
    """Kill a process as soon as so many simulations have begun."""
    while not killed.wait(0.005):
        if calls.exists() and calls.stat().st_size >= count:
            os.kill(pid, signal.SIGKILL)
            killed.set()


def identified(folder, name, *more):
    options = ["--model", f"{folder / 'line.py'}:line", "--simulations", "300", "--jobs", "1", "--out"]
    assert main(["identify", str(folder / "line.nc"), *options, str(folder / name), *more]) == 0
    return mofit.open(folder / name)


@pytest.mark.slow
def test_a_worker_that_is_killed_changes_no_number(tmp_path):
    (tmp_path / "line.py").write_text(LINE, encoding="utf-8")
    write_campaign(campaign(sine_test(periods=6)), tmp_path / "line.nc")
    here = identified(tmp_path, "here")
    calls, killed = tmp_path / "calls", threading.Event()
    calls.unlink()
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, dashboard_address=":0", worker_dashboard_address=":0"
        ) as cluster,
        distributed.Client(cluster.scheduler_address, set_as_default=False) as client,
    ):
        before = set(client.run(os.getpid).values())
        victim = threading.Thread(target=kill_after, args=(calls, KILLED_AFTER, min(before), killed))
        victim.start()
        try:
            there = identified(tmp_path, "there", "--dask", cluster.scheduler_address)
        finally:
            missed = not killed.is_set()
            killed.set()
            victim.join()
        assert not missed
        client.wait_for_workers(2)
        deadline = time.monotonic() + 20
        while min(before) in client.run(os.getpid).values() and time.monotonic() < deadline:
            time.sleep(0.1)
        assert min(before) not in client.run(os.getpid).values()
    assert simulations(there)["count"] == simulations(here)["count"] <= 300
    one, other = here["modes/m1"].dataset, there["modes/m1"].dataset
    for column in ("value", "mean", "sd", "q05", "q95"):
        np.testing.assert_array_equal(one[column].values, other[column].values)
