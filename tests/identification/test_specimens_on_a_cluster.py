"""Specimens identified on two workers of a cluster, one of which is killed on the way: the numbers stay the same."""

import os
import signal
import threading
import time

import numpy as np
import pytest

import mofit
from mofit.cli import main
from mofit.data import Campaign, Experiment, Measurement, joined, read_campaign, write_campaign
from mofit.errors import InputError
from mofit.identification.conditions import study_conditions
from mofit.identification.settings import Settings
from mofit.models import find_model
from mofit.results import summary

distributed = pytest.importorskip("distributed", reason="needs the extra 'dask'")

LINE = """
from mofit import Channel, Equations, Model, Parameter


class Line(Model):
    name = "line"
    parameters = (Parameter("k", "N/m", 0.1, 10.0, 1.0, "log"), Parameter("b", "N", -10.0, 10.0, 0.0))
    inputs = (Channel("x", "m"),)
    outputs = (Channel("y", "N"),)

    def equations(self, s):
        return Equations(outputs={"y": s.k * s.x + s.b})
"""
COUNT, ODD = 12, 7
STIFFNESSES = (
    2.0 * np.exp(0.03 * np.random.default_rng(5).normal(size=COUNT)) * np.where(np.arange(COUNT) == ODD, 1.7, 1)
)


def specimen(number: int) -> Campaign:
    rng, axis = np.random.default_rng(number), 0.01 * np.arange(200)
    x = np.sin(axis**2 + number)
    y = STIFFNESSES[number] * x + 1.0 + 0.05 * rng.normal(size=len(axis))
    test = Measurement(Experiment("pull", "free", axis, {"x": x}), {"y": y}, {"x": "m", "y": "N"})
    return Campaign("springs", "simulated", {}, (test,))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("specimens")
    (made / "line.py").write_text(LINE, encoding="utf-8")
    for number in range(COUNT):
        write_campaign(specimen(number), made / f"s{number:02d}.nc")
    return made


@pytest.fixture(scope="module")
def cluster():
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=":0", worker_dashboard_address=":0"
    ) as running:
        yield running


def kill_a_busy_worker(client, killed):
    """End a worker's process for good as soon as it works."""
    processes, busy = client.run(os.getpid), list[str]()
    while not busy:
        time.sleep(0.005)
        busy = [address for address, tasks in client.processing().items() if tasks]
    killed.append(processes[busy[0]])
    os.kill(killed[0], signal.SIGKILL)


@pytest.mark.slow
def test_a_worker_that_is_killed_changes_no_estimate(folder, cluster):
    files, model = sorted(folder.glob("s*.nc")), f"{folder / 'line.py'}:Line"
    killed: list[int] = []
    with distributed.Client(cluster.scheduler_address, set_as_default=False) as client:
        killer = threading.Thread(target=kill_a_busy_worker, args=(client, killed))
        killer.start()
        options = ["--over", "specimen", "--model", model, "--no-sample", "--jobs", "1", "--out", str(folder / "run")]
        code = main(["identify", *map(str, files), *options, "--dask", cluster.scheduler_address])
        killer.join()
    assert code == 3  # not sampled
    assert killed
    tree = mofit.open(folder / "run")
    whole = joined([read_campaign(file) for file in files], [file.stem for file in files])
    here = study_conditions(whole, find_model(model), Settings(over=("specimen",), sample=False, jobs=1))
    cells = tree["laws/cells"].to_dataset(inherit=False)
    np.testing.assert_array_equal(cells["value"].values, here.cells.values)
    np.testing.assert_array_equal(cells["sd"].values, here.cells.sd)
    laws = summary(tree, folder / "run")["laws"]
    assert [(one["specimen"], one["parameter"]) for one in laws["outliers"]] == [(f"s{ODD:02d}", "k")]
    assert laws["populations"]["k"]["spread_low"] < 0.03 < laws["populations"]["k"]["spread_high"]
    assert laws["populations"]["k"]["mean_low"] < 2.0 < laws["populations"]["k"]["mean_high"]


@pytest.mark.slow
def test_what_a_worker_refuses_is_an_issue_here(folder, cluster):
    files = sorted(folder.glob("s*.nc"))[:3]
    whole = joined([read_campaign(file) for file in files], [file.stem for file in files])
    settings = Settings(over=("specimen",), sample=False, jobs=1, search="nothing", dask=cluster.scheduler_address)
    with pytest.raises(InputError, match="nothing"):
        study_conditions(whole, find_model(f"{folder / 'line.py'}:Line"), settings)
