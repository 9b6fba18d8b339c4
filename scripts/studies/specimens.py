"""Specimens pooled on a Dask cluster: population and the odd one. Writes reports/conditions/specimens.md.

    python scripts/studies/specimens.py [--count 200] [--fleets 4] [--few 40] [--seeds 5] [--seed 0]

Simulated: specimens of a Maxwell damper, integrated by the Runge-Kutta method of conditions_cases.py. c, ln d_M and the
offset are drawn from normals with spreads of 1000 N/m, 0.1 and 2 N; d and c_M are the same in all. One specimen is odd:
its d_M is half of what it would be. Each is a file with one multisine of 2 s and 20 N of white noise. `mofit identify
specimen_*.nc --over specimen --no-sample --dask ADDRESS` identifies them on a cluster of two workers with one thread
each, one of which is killed once a few specimens are done. Counted are the parameters pooled as made, the specimens
named, and the 90 % intervals that hold mean and spread of the population: by the estimates of the specimens, without
the odd one, and by the joint fit, with it. More fleets, and fleets of fewer specimens, are by the estimates alone
(`study_conditions` of mofit, on such a cluster). Rows that the work folder holds already are kept.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import threading
import time
from collections.abc import Sequence
from contextlib import nullcontext, redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
from distributed import Client, LocalCluster

from conditions_cases import driven, measured
from mofit.cli import main as mofit
from mofit.data import Campaign, Experiment, joined, read_campaign, write_campaign
from mofit.data.join import specimen_name
from mofit.identification.conditions import study_conditions
from mofit.identification.settings import Settings
from mofit.models import find_model
from report_page import ROOT, header, made_with, table, write_page

MODEL = "maxwell_damper"
CENTRE = {"c": 2e4, "d": 300.0, "c_M": 3e4, "d_M": 1500.0, "F_0": 5.0}
#: of the logarithm for d_M
SPREAD = {"c": 1e3, "d_M": 0.1, "F_0": 2.0}
#: standard deviations of a 90 % interval
SIGMAS = 1.645
#: specimens that are done when a worker is killed
KILLED_AFTER = 10


def made(count: int, seed: int, folder: Path) -> tuple[list[Path], str]:
    """Files of specimens, and the name of the odd one."""
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng((seed, count))
    known = {name: np.full(count, value) for name, value in CENTRE.items()}
    known["c"] += SPREAD["c"] * rng.normal(size=count)
    known["d_M"] *= np.exp(SPREAD["d_M"] * rng.normal(size=count))
    known["F_0"] += SPREAD["F_0"] * rng.normal(size=count)
    odd = int(rng.integers(count))
    known["d_M"][odd] *= 0.5
    axis, strokes, forces = driven(known, rng)
    files = [folder / f"specimen_{k + 1:03d}.nc" for k in range(count)]
    for file, x, force in zip(files, strokes, forces, strict=True):
        test = measured(Experiment("multisine", "free", axis, {"displacement": x}), force, rng)
        write_campaign(Campaign("damper", "simulated", {}, (test,)), file)
    return files, files[odd].stem


def fleet(count: int, seed: int, work: Path) -> dict[str, Any]:
    """By the command, on a cluster of which a worker is killed."""
    files, odd = made(count, seed, work / f"specimens_{count}_{seed}")
    out, killed, printed = work / f"run_{count}_{seed}", list[int](), StringIO()
    began = time.perf_counter()
    with cluster() as running:
        watch = threading.Thread(target=_kill, args=(running.scheduler_address, count, killed), daemon=True)
        watch.start()
        options = ["--over", "specimen", "--model", MODEL, "--fix", "p=0", "--no-sample", "--jobs", "1", "--json"]
        given = [*map(str, files), *options, "--dask", running.scheduler_address, "--out", str(out)]
        with redirect_stdout(printed):
            code = mofit(["identify", *given])
    found = json.loads(printed.getvalue())
    joint = {
        name: [one["value"] - SIGMAS * one["sd"], one["value"] + SIGMAS * one["sd"]]
        for name, one in found["modes"][0]["parameters"].items()
    }
    bands = {
        name: {key: [one[f"{key}_low"], one[f"{key}_high"]] for key in ("mean", "spread")}
        for name, one in found["laws"]["populations"].items()
    }
    return {
        "laws": {row["parameter"]: row["law"] for row in found["laws"]["laws"]},
        "named": [[one["specimen"], one["parameter"]] for one in found["laws"]["outliers"]],
        "odd": odd,
        "alone": bands,
        "joint": {n: {key: joint.get(f"{n}_{key}") for key in ("mean", "spread")} for n in SPREAD},
        "killed": len(killed),
        "code": code,
        "stages": found["seconds"],
        "seconds": time.perf_counter() - began,
    }


def _kill(address: str, count: int, killed: list[int]) -> None:
    """End a busy worker for good once a few specimens are done."""
    with Client(address, set_as_default=False) as client:
        processes, waiting = client.run(os.getpid), dict[str, Any]()
        while not 0 < sum(map(len, waiting.values())) <= count - KILLED_AFTER:
            time.sleep(0.05)
            waiting = client.processing()
        busy = next(place for place, tasks in waiting.items() if tasks)
        os.kill(processes[busy], signal.SIGKILL)
        killed.append(processes[busy])


def cluster() -> LocalCluster:
    """Two workers of one thread each."""
    return LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None, worker_dashboard_address=None)


def estimated(count: int, seed: int, work: Path, address: str) -> dict[str, Any]:
    """Population and odd specimen from the estimates of every specimen."""
    files, odd = made(count, seed, work / f"specimens_{count}_{seed}")
    whole = joined([read_campaign(file) for file in files], [file.stem for file in files])
    settings = Settings(fixed={"p": 0.0}, over=("specimen",), sample=False, jobs=1, seed=seed, dask=address)
    study = study_conditions(whole, find_model(MODEL), settings)
    return {
        "laws": {name: form for (name, _), form in study.fit.forms.items()},
        "named": [[specimen_name(whole, one.specimen + 1.0), one.parameter] for one in study.outliers],
        "odd": odd,
        "alone": {one.parameter: {"mean": one.mean_band, "spread": one.spread_band} for one in study.populations},
    }


def page(
    first: dict[str, Any], more: Sequence[dict[str, Any]], few: Sequence[dict[str, Any]], count: int, fewer: int
) -> list[str]:
    """The tables."""
    head = ("specimens", "fleets", "laws as made", "odd one named", "others named", "means held", "spreads held")
    rows = [[number, len(own), *told(own, "alone")] for number, own in ((count, [first, *more]), (fewer, few)) if own]
    lines = ["## By the estimates of the specimens", "", *table(head, rows)]
    lines += ["## By the joint fit, the odd specimen among them", ""]
    lines += table(("specimens", "means held", "spreads held"), [[count, *told([first], "joint")[3:]]])
    bands = [
        (name, key, f"{truth(name)[key]:.4g}", *(_said(first[by][name][key]) for by in ("alone", "joint")))
        for name in SPREAD
        for key in ("mean", "spread")
    ]
    lines += [
        f"The first fleet of {count} ({first['killed']} worker killed, exit code {first['code']}: not sampled):",
        "",
    ]
    lines += table(("parameter", "of the population", "truth", "by the specimens", "by the joint fit"), bands)
    lines += table(
        ("seconds", *first["stages"]), [[f"{first['seconds']:.0f}", *(f"{s:.0f}" for s in first["stages"].values())]]
    )
    return lines


def told(rows: Sequence[dict[str, Any]], by: str) -> list[str]:
    """Counts over fleets; intervals ``by`` the specimens alone or the joint fit."""
    laws = sum(row["laws"][name] == ("pooled" if name in SPREAD else "constant") for row in rows for name in CENTRE)
    odd = sum([row["odd"], "d_M"] in row["named"] for row in rows)
    others = sum(name != row["odd"] for row in rows for name, _ in row["named"])
    held = [
        [row[by][name][key][0] <= truth(name)[key] <= row[by][name][key][1] for row in rows for name in SPREAD]
        for key in ("mean", "spread")
    ]
    shares = [f"{sum(own)} of {len(own)}" for own in held]
    return [f"{laws} of {len(CENTRE) * len(rows)}", f"{odd} of {len(rows)}", str(others), *shares]


def truth(name: str) -> dict[str, float]:
    """Mean and spread of a population, as the intervals state them."""
    return {"mean": CENTRE[name], "spread": SPREAD[name]}


def _said(band: Sequence[float]) -> str:
    return f"{band[0]:.4g} to {band[1]:.4g}"


def main() -> None:
    """Run the study and write its page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--fleets", type=int, default=4)
    parser.add_argument("--few", type=int, default=40)
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--work", type=Path, default=ROOT / "runs" / "specimens")
    options = parser.parse_args()
    options.work.mkdir(parents=True, exist_ok=True)
    file = options.work / f"fleet_{options.count}_{options.seed}.json"
    if not file.exists():
        file.write_text(json.dumps(fleet(options.count, options.seed, options.work)), encoding="utf-8")
    first = json.loads(file.read_text(encoding="utf-8"))
    wanted = [(options.few, seed) for seed in range(options.seed, options.seed + options.seeds)]
    wanted += [(options.count, seed) for seed in range(options.seed + 1, options.seed + options.fleets)]
    files = {(count, seed): options.work / f"estimated_{count}_{seed}.json" for count, seed in wanted}
    done: dict[int, list[dict[str, Any]]] = {options.few: [], options.count: []}
    with nullcontext() if all(file.exists() for file in files.values()) else cluster() as running:
        for (count, seed), file in files.items():
            if running and not file.exists():
                row = estimated(count, seed, options.work, running.scheduler_address)
                file.write_text(json.dumps(row), encoding="utf-8")
            done[count].append(json.loads(file.read_text(encoding="utf-8")))
            more, few = done[options.count], done[options.few]
            command = (
                f"specimens.py --count {options.count} --fleets {1 + len(more)} --few {options.few} --seeds {len(few)} "
                f"--seed {options.seed}"
            )
            lines = header("Specimens", __doc__, command, made_with("distributed"))
            lines += page(first, more, few, options.count, options.few)
            write_page("conditions", lines, "specimens.md")


if __name__ == "__main__":
    main()
