"""Many campaigns: each as if alone, finished ones are kept, one failure stops nothing, a lost worker loses nothing."""

import csv
import json
import os
import shutil
import signal
import threading
import time
from dataclasses import replace

import numpy as np
import pytest
from lag_rig import campaign, write_model

from mofit.data import write_campaign
from mofit.errors import InputError
from mofit.identification.settings import Settings
from mofit.sampling.settings import SampleSettings
from mofit.workflows.batch import BatchJob, run_batch
from mofit.workflows.batch_page import differing
from mofit.workflows.batch_tasks import Task, work
from mofit.workflows.jobs import Job, identify_file

GAINS = {"a": (1.0, 3000.0), "b": (2.0, 5000.0)}
#: a short sampling that still counts as converged
SHORT = SampleSettings(tau_multiple=20.0, tau_growth=0.1, min_ess=200.0, max_r_hat=1.05)
SETTINGS = Settings(seed=4, sampling=SHORT, jobs=1)


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """Two campaigns and one damaged file."""
    folder = tmp_path_factory.mktemp("campaigns")
    for seed, (name, (gain, load)) in enumerate(GAINS.items()):
        made = campaign(frequencies=(0.5, 2.0), seed=seed, gain=gain, conditions={"vertical_force": load})
        write_campaign(made, folder / f"{name}.nc")
    (folder / "damaged.nc").write_bytes(b"\x89HDF\r\n\x1a\n and nothing more")
    return folder


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    return write_model(tmp_path_factory.mktemp("model"))


def job_of(place, model, out, **more):
    return BatchJob((place,), out, model=model, settings=SETTINGS, processes=2, **more)


@pytest.fixture(scope="module")
def rows(place, model, tmp_path_factory):
    out = tmp_path_factory.mktemp("batch") / "out"
    return run_batch(job_of(place, model, out)), out


def numbers(summary):
    return json.dumps({key: value for key, value in summary.items() if key not in ("run", "seconds")}, sort_keys=True)


def test_rows_are_those_of_single_runs(rows, place, model, tmp_path):
    found, _ = rows
    single = identify_file(Job(place / "b.nc", model, settings=replace(SETTINGS, jobs=2), out=tmp_path / "b"))[1]
    row = next(row for row in found if row.name == "b")
    assert numbers(row.summary) == numbers(single)


def test_one_failure_stops_nothing_and_says_why(rows):
    found, out = rows
    states = {row.name: row.state for row in found}
    assert states == {"a": "done", "b": "done", "damaged": "failed"}
    assert "damaged.nc" in found[-1].message
    for name, (gain, _) in GAINS.items():
        entry = next(row for row in found if row.name == name).parameters["k"]
        assert abs(entry["mean"] - gain) < 4 * entry["sd"]
    assert (out / "b" / "report.html").exists()


def test_table_and_page(rows):
    found, out = rows
    assert differing(found) == ["vertical_force"]
    with (out / "table.csv").open(newline="") as file:
        table = {line["campaign"]: line for line in csv.DictReader(file)}
    assert float(table["b"]["vertical_force [N]"]) == 5000.0
    assert float(table["b"]["k [N/rad]"]) == found[1].parameters["k"]["mean"]
    assert table["damaged"]["k [N/rad]"] == ""
    page = (out / "batch.html").read_text()
    assert "Over the vertical force" in page
    assert 'href="b/report.html"' in page


def test_again_keeps_finished_runs_and_repeats_failed_ones(rows, place, model):
    """A run whose row is missing is finished, too."""
    found, out = rows
    (out / "rows" / "a.json").unlink()
    before = {name: (out / name / "result.nc").stat().st_mtime_ns for name in GAINS}
    again = run_batch(job_of(place, model, out))
    assert [numbers(row.summary) for row in again] == [numbers(row.summary) for row in found]
    assert [row.state for row in again] == ["done", "done", "failed"]
    assert before == {name: (out / name / "result.nc").stat().st_mtime_ns for name in GAINS}


def test_another_campaign_under_the_same_name_is_refused(rows, model, tmp_path):
    _, out = rows
    write_campaign(campaign(frequencies=(0.5,), seed=9, gain=2.5), tmp_path / "a.nc")
    task = Task("a", tmp_path / "a.nc", out, "identify", model, (), SETTINGS)
    copy = tmp_path / "out"
    shutil.copytree(out, copy)
    row = work(replace(task, out=copy))
    assert row.state == "failed"
    assert "has changed" in row.message
    assert (copy / "a" / "result.nc").exists()


def test_unusable_options_are_refused_before_anything_is_written(rows, place, model, tmp_path):
    _, out = rows
    with pytest.raises(InputError, match=r"other settings is there \(seed\)"):
        run_batch(BatchJob((place,), out, model=model, settings=replace(SETTINGS, seed=5)))
    with pytest.raises(InputError, match="no such file or folder"):
        run_batch(BatchJob((tmp_path / "none",), tmp_path / "out"))
    with pytest.raises(InputError, match="diagnose"):
        run_batch(BatchJob((place,), tmp_path / "out", what="diagnos"))
    occupied = tmp_path / "occupied"
    occupied.mkdir()
    (occupied / "thesis.txt").write_text("mine")
    with pytest.raises(InputError, match="holds no batch"):
        run_batch(job_of(place, model, occupied))
    assert [path.name for path in tmp_path.iterdir()] == ["occupied"]


def kill_a_busy_worker(address, out):
    """End a worker's process for good as soon as a run is under way."""
    from distributed import Client

    with Client(address, set_as_default=False) as client:
        workers, busy = client.run(os.getpid), list[str]()
        while not busy:
            time.sleep(0.02)
            if list(out.glob("*.partial")):
                busy = [address for address, tasks in client.processing().items() if tasks]
        os.kill(workers[busy[0]], signal.SIGKILL)


@pytest.mark.slow
def test_dask_gives_the_same_and_a_killed_worker_loses_nothing(rows, place, model, tmp_path):
    distributed = pytest.importorskip("distributed", reason="needs the extra 'dask'")
    found, _ = rows
    out = tmp_path / "out"
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=":0", worker_dashboard_address=":0"
    ) as cluster:
        killer = threading.Thread(target=kill_a_busy_worker, args=(cluster.scheduler_address, out))
        killer.start()
        again = run_batch(job_of(place, model, out, scheduler=cluster.scheduler_address))
        killer.join()
    assert [row.state for row in again] == [row.state for row in found]
    for one, other in zip(again, found, strict=True):
        mine, theirs = ({name: (e["mean"], e["sd"]) for name, e in row.parameters.items()} for row in (one, other))
        assert mine == theirs
    assert np.all([row.summary == {} or row.summary["converged"] for row in again])


def test_no_scheduler(place, model, tmp_path):
    pytest.importorskip("distributed", reason="needs the extra 'dask'")
    with pytest.raises(InputError, match="no scheduler answers"):
        run_batch(job_of(place, model, tmp_path / "out", scheduler="tcp://127.0.0.1:9", patience=1.0))
