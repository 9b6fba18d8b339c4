"""Many campaigns at once: equal numbers, speed-up, a lost worker. Writes reports/batch/README.md.

    python scripts/studies/batch.py [--count 24] [--seed 1] [--work FOLDER]

Simulated tyre campaigns (the test plan data/plans/table5.toml) over loads and speeds are identified one by one, as
`mofit identify` does it. Then `mofit batch` identifies them on a local Dask cluster of one worker, of two, and of two
of which one is killed while it works. Every worker has one thread. Two runs are equal if their results hold the same
numbers, bit by bit. Finished campaigns are kept, except for the timed runs.
"""

from __future__ import annotations

import argparse
import os
import shutil
import signal
import threading
import time
from collections.abc import Sequence
from itertools import product
from pathlib import Path

import numpy as np
from distributed import Client, LocalCluster

from mofit.data import write_campaign
from mofit.identification.settings import Settings
from mofit.results import open_result
from mofit.simulation.virtual_rig.plan import read_plan
from mofit.simulation.virtual_rig.rig import run_plan
from mofit.workflows.batch import BatchJob, run_batch
from mofit.workflows.jobs import Job, identify_file
from report_page import ROOT, header, made_with, table, write_page

LOADS, SPEEDS = (2400, 3000, 3600, 4200, 4800, 5400), (30, 45, 60, 90)


def campaigns(folder: Path, count: int, seed: int) -> list[Path]:
    """Campaign files of tyres whose stiffness, grip and relaxation grow with the load."""
    folder.mkdir(parents=True, exist_ok=True)
    plan = read_plan(ROOT / "data" / "plans" / "table5.toml")
    files = []
    for number, (load, speed) in enumerate(list(product(LOADS, SPEEDS))[:count]):
        path = folder / f"tyre_{load}N_{speed}kmh.nc"
        files.append(path)
        if path.exists():
            continue
        ratio = load / 3600
        values = {"F_M": 3100 * ratio, "c_M": 19910 * ratio**0.5, "dF0": 62e3 * ratio**0.8}
        conditions = {"vertical_force": f"{load} N", "longitudinal_velocity": f"{speed} km/h"}
        changed = {
            "seed": seed + number,
            "title": f"simulated tyre, {load} N, {speed} km/h",
            "conditions": {**plan.conditions, **conditions},
            "parameters": {**plan.parameters, **values},
        }
        write_campaign(run_plan(plan.model_copy(update=changed)), path)
    return files


def one_by_one(files: Sequence[Path], out: Path, settings: Settings) -> None:
    """What `mofit identify` writes for each campaign."""
    for file in files:
        if not (out / file.stem).exists():
            identify_file(Job(file, settings=settings, out=out / file.stem))


def on_workers(place: Path, out: Path, settings: Settings, workers: int, kill: bool = False) -> tuple[float, int]:
    """Seconds that a batch takes on a local cluster, workers being up, and how many were killed."""
    shutil.rmtree(out, ignore_errors=True)
    quiet = {"dashboard_address": None, "worker_dashboard_address": None}
    with LocalCluster(n_workers=workers, threads_per_worker=1, **quiet) as cluster:
        killed: list[int] = []
        if kill:
            threading.Thread(target=_kill, args=(cluster.scheduler_address, out, killed), daemon=True).start()
        begin = time.perf_counter()
        rows = run_batch(BatchJob((place,), out, settings=settings, scheduler=cluster.scheduler_address))
        seconds = time.perf_counter() - begin
    failed = [row.name for row in rows if row.state != "done"]
    if failed:
        raise SystemExit(f"{out}: not done: {', '.join(failed)}")
    return seconds, len(killed)


def _kill(scheduler: str, out: Path, killed: list[int]) -> None:
    """End a busy worker for good once a few campaigns are done."""
    with Client(scheduler) as client:
        while len(list(out.glob("rows/*.json"))) < 3 or not list(out.glob("*.partial")):
            time.sleep(0.05)
        processes = client.run(os.getpid)
        busy = next(address for address, tasks in client.processing().items() if tasks)
        os.kill(processes[busy], signal.SIGKILL)
        killed.append(processes[busy])


def differing(files: Sequence[Path], one: Path, other: Path) -> list[str]:
    """Campaigns whose results do not hold the same numbers."""
    return [file.stem for file in files if not _equal(one / file.stem, other / file.stem)]


def _equal(one: Path, other: Path) -> bool:
    trees = [open_result(folder) for folder in (one, other)]
    groups = [{node.path: node.to_dataset() for node in tree.subtree} for tree in trees]
    if groups[0].keys() != groups[1].keys():
        return False
    return all(
        mine.variables.keys() == theirs.variables.keys()
        and all(_same(mine[name].values, theirs[name].values) for name in mine.variables)
        for mine, theirs in ((groups[0][path], groups[1][path]) for path in groups[0])
    )


def _same(one: np.ndarray, other: np.ndarray) -> bool:
    return np.array_equal(one, other, equal_nan=one.dtype.kind == "f")


def main() -> None:
    """Run, compare, and write reports/batch/README.md."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=24)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--work", type=Path, default=ROOT / "runs" / "batch")
    options = parser.parse_args()
    place, settings = options.work / "campaigns", Settings(seed=options.seed, jobs=1)
    files = campaigns(place, options.count, options.seed)
    single, alone, both, lost = (options.work / name for name in ("single", "one", "two", "killed"))
    one_by_one(files, single, settings)
    slow, _ = on_workers(place, alone, settings, 1)
    fast, _ = on_workers(place, both, settings, 2)
    crippled, killed = on_workers(place, lost, settings, 2, kill=True)
    rows = [("one worker", alone, slow, 0), ("two workers", both, fast, 0), ("two, one killed", lost, crippled, killed)]
    command = f"batch.py --count {options.count} --seed {options.seed}"
    columns = ("Dask workers", "killed", "seconds", "speed-up", "campaigns whose numbers differ from the single run")
    cells = [
        (
            name,
            lives,
            f"{seconds:.0f}",
            f"{slow / seconds:.2f}",
            f"{len(differing(files, single, out))} of {len(files)}",
        )
        for name, out, seconds, lives in rows
    ]
    write_page("batch", [*header("Many campaigns", __doc__, command, made_with()), *table(columns, cells)])


if __name__ == "__main__":
    main()
