"""How long ``mofit diagnose`` takes from start to end, on campaigns of the blind test that it has not seen before.

One after the other, with the default number of processes; nothing else should run meanwhile. What the command prints is
kept beside the campaigns, and the scorer, which opens the labels last of all, writes its report there, too.
"""

from __future__ import annotations

import json
import os
import platform
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.withheld_effects import program
from mofit._typing import FloatArray
from studies.report_page import versions

#: Kinds of campaigns, and how many of each the large blind test has, see README_seed_12.md of withheld_effects.
LARGE = {"none": 400, "effect": 500, "unmodelled": 120, "pair": 40}
#: Campaigns without effect, and with two, per campaign of each effect.
NONE, PAIRS = 10, 2
#: Seconds of wall time within which so many end.
LIMITS = (5, 10, 30)


def run(runs: int = 1, seed: int = 1, folder: Path = Path("runs/bench")) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """Generate and diagnose; what exists already is kept, so an interrupted run resumes.

    Parameters
    ----------
    runs
        Campaigns of each effect of the library and of each unmodelled cause; 10 times as many without effect, twice as
        many of two effects.
    seed
        Of the generator.
    folder
        Where campaigns and results are kept.

    Returns
    -------
    rows
        Number, quantiles of seconds and per cent within some seconds: of every kind, of all, and of all with the kinds
        weighted as in the large blind test.
    settings
        What they were made with.
    """
    return _run(runs, seed, folder / f"withheld_speed-{seed}")


def run_bundled(
    runs: int = 1, seed: int = 1, folder: Path = Path("runs/bench")
) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """The same on the programme of the bundled campaign, the paper's nine sines alone."""
    return _run(runs, seed, folder / f"withheld_speed_bundled-{seed}", "--paper")


def _run(runs: int, seed: int, place: Path, *more: str) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    counts = {"none": NONE * runs, "per-effect": runs, "unmodelled": runs, "pairs": PAIRS * runs, "variants": 0}
    rows = measured(counts, seed, place, *more)
    mix = ", ".join(f"{count} {kind}" for kind, count in LARGE.items())
    return rows, {
        "runs": runs,
        "seed": seed,
        "cores": os.cpu_count() or 1,
        "cpu": platform.processor() or platform.machine(),
        **versions("mofit", "numpy", "scipy", "casadi"),
        "seconds": "wall time of `mofit diagnose FILE --json`, page included, nothing else running; every campaign is "
        "new to it, the machine has diagnosed others before",
        "weighted": f"as the large blind test (reports/withheld_effects/README_seed_12.md): {mix}",
    }


def measured(counts: Mapping[str, int], seed: int, place: Path, *more: str) -> list[dict[str, Any]]:
    """The rows for so many campaigns of each kind (the generator's options, and more), which are kept in a folder."""
    options = [*more, *(part for kind, count in counts.items() for part in (f"--{kind}", str(count)))]
    program("generate.py", "--out", place, *options, "--seed", str(seed))
    seconds = timed(place)
    by_kind: dict[str, list[float]] = {}
    for name, kind in _kinds(place).items():
        by_kind.setdefault(kind, []).append(seconds[name])
    return list(_rows(by_kind))


def timed(place: Path) -> dict[str, float]:
    """Seconds of every campaign by its name; what is not there yet is diagnosed."""
    results, file, page = place / "results", place / "seconds.json", place / "page"
    results.mkdir(exist_ok=True)
    known: dict[str, float] = json.loads(file.read_text(encoding="utf-8")) if file.exists() else {}
    for campaign in sorted((place / "campaigns").glob("*.nc")):
        if campaign.stem in known:
            continue
        shutil.rmtree(page, ignore_errors=True)
        command = [sys.executable, "-m", "mofit", "diagnose", str(campaign), "--json", "--out", str(page)]
        begin = time.monotonic()
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        known[campaign.stem] = time.monotonic() - begin
        (results / f"{campaign.stem}.json").write_text(done.stdout, encoding="utf-8")
        file.write_text(json.dumps(known, indent=1) + "\n", encoding="utf-8")
    shutil.rmtree(page, ignore_errors=True)
    return known


def _kinds(place: Path) -> dict[str, str]:
    """The kind of every campaign, as the scorer tells it."""
    program("score.py", place / "labels.blinded", place / "results", "--out", place / "report")
    rows = json.loads((place / "report" / "rows.json").read_text(encoding="utf-8"))
    return {one["campaign"]: one["case"] for one in rows}


def _rows(by_kind: Mapping[str, Sequence[float]]) -> Iterator[dict[str, Any]]:
    kinds = [kind for kind in LARGE if kind in by_kind]
    for kind in kinds:
        yield row(kind, np.array(by_kind[kind]), np.ones(len(by_kind[kind])))
    every = np.concatenate([by_kind[kind] for kind in kinds])
    weights = np.concatenate([np.full(len(by_kind[kind]), LARGE[kind] / len(by_kind[kind])) for kind in kinds])
    yield row("all", every, np.ones(len(every)))
    yield row("all, weighted", every, weights)


def row(name: str, seconds: FloatArray, weights: FloatArray) -> dict[str, Any]:
    """Quantiles of weighted seconds, and how many per cent of the weight lie within `LIMITS`."""
    order = np.argsort(seconds)
    seconds, share = seconds[order], np.cumsum(weights[order]) / weights.sum()
    # of as many below as above the lower one; rounding moves no quantile
    median, most = (seconds[np.searchsorted(share, at - 1e-9)] for at in (0.5, 0.9))
    found = {"campaigns": name, "number": len(seconds), "median_s": round(float(median), 1)}
    found |= {"90_%_s": round(float(most), 1), "longest_s": round(float(seconds[-1]), 1)}
    within = {limit: 100 * float(weights[order][seconds <= limit].sum() / weights.sum()) for limit in LIMITS}
    return found | {f"within_{limit}_s_%": round(share, 1) for limit, share in within.items()}
