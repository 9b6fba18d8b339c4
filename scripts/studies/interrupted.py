"""Is a run damaged if it is killed at any moment, or if the disk fills up? Writes reports/robustness/interrupted.md.

    python scripts/studies/interrupted.py [--count 100] [--full 20] [--seed 0] [--work FOLDER]

A simulated campaign of two sines of a damper is identified once without interruption. Then the same command is
started and killed (SIGKILL) after a time drawn uniformly from the length of such a run, `count` times, and resumed
with `--resume` until it ends; every second one is killed once more on the way. One that ended before it could be killed
is started again. A run is *damaged* if the resumed
command does not end with exit code 0, or if its result cannot be read; its numbers are the *same* if all values of
`result.nc` but times are equal to the last bit. A full disk is simulated without privileges: the size of the files of
the process is limited (RLIMIT_FSIZE) to a size drawn between 0 and that of the largest file of a run, which gives the
error EFBIG in the place of ENOSPC; the run is resumed without the limit.
"""

from __future__ import annotations

import argparse
import json
import resource
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import xarray as xr

from mofit.errors import InputError
from mofit.results import open_result
from report_page import ROOT, header, made_with, table

PLAN = """
title = "interrupted"
model = "kelvin_voigt_damper"
seed = 1
parameters = { c = 2000.0, p = 0.0, d = 1500.0, F_0 = 0.0 }
[noise.force]
sd = 2.0
[defaults]
kind = "sine"
sample_rate = 100.0
[[tests]]
name = "slow"
amplitude = 0.02
frequency = 0.5
periods = 4
[[tests]]
name = "fast"
amplitude = 0.01
frequency = 2.0
periods = 8
"""
#: Attributes of a result that say when and how long, not what.
TIMES = ("created", "seconds")


def command(out: Path, *more: str) -> list[str]:
    """The command under test."""
    file = out.parent / "campaign.nc"
    options = ["--model", "kelvin_voigt_damper", "--seed", "1", "--jobs", "1", "--out", str(out), "--json", *more]
    return [sys.executable, "-m", "mofit", "identify", str(file), *options]


def run(out: Path, *more: str, limit: int | None = None) -> subprocess.CompletedProcess[str]:
    """Run it to its end, with a limit on the size of files [bytes]."""

    def limited() -> None:
        if limit is not None:
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

    return subprocess.run(command(out, *more), preexec_fn=limited, capture_output=True, text=True, check=False)


def kill_after(seconds: float, out: Path, *more: str) -> float | None:
    """Start it and kill it after a time; how long it took, if it ended before [s]."""
    began = time.perf_counter()
    process = subprocess.Popen(command(out, *more), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        process.wait(seconds)
    except subprocess.TimeoutExpired:
        process.send_signal(signal.SIGKILL)
    return None if process.wait() == -signal.SIGKILL else time.perf_counter() - began


def values(tree: xr.DataTree) -> dict[str, object]:
    """Everything in a result but times."""
    found: dict[str, object] = {}
    for node in tree.subtree:
        for name, variable in node.variables.items():
            found[f"{node.path}/{name}"] = variable.values
        for name, value in node.attrs.items():
            if name not in TIMES:
                found[f"{node.path}@{name}"] = value
    return found


def same(one: dict[str, object], other: dict[str, object]) -> bool:
    """Whether two results are equal to the last bit."""
    return one.keys() == other.keys() and all(_equal(one[name], other[name]) for name in one)


def _equal(one: object, other: object) -> bool:
    a, b = np.asarray(one), np.asarray(other)
    return a.shape == b.shape and np.array_equal(a, b, equal_nan=a.dtype.kind == "f")


def outcome(out: Path, whole: dict[str, object]) -> str:
    """What came of an interrupted run, resumed if it had not ended."""
    moment = "when it was ending"
    if not out.exists():
        partial = out.with_name(out.name + ".partial")
        files = {path.name for path in partial.iterdir()} if partial.exists() else set()
        moment = "while sampling or later" if "chains.h5" in files else "before sampling"
        done = run(out, "--resume")
        if done.returncode != 0:
            return f"{moment}: damaged, exit {done.returncode}: {done.stderr.strip()[-200:]}"
    try:
        found = values(open_result(out))
    except InputError as error:
        return f"{moment}: damaged, {error}"
    left = [path.name for path in out.parent.iterdir() if path.name.startswith((out.name + ".", "." + out.name))]
    if left:
        return f"{moment}: {', '.join(left)} is left"
    return f"{moment}: same numbers" if same(found, whole) else f"{moment}: OTHER numbers"


def killed(work: Path, number: int, seconds: float, rng: np.random.Generator, whole: dict[str, object]) -> str:
    """One run, killed once or twice."""
    out = work / "killed"
    shutil.rmtree(out, ignore_errors=True)
    while took := kill_after(rng.uniform(0, seconds), out):
        seconds = min(seconds, took)  # a machine that is busy with other things is not always equally fast
        shutil.rmtree(out)
    if number % 2:
        kill_after(rng.uniform(0, seconds), out, "--resume")
    return outcome(out, whole)


def filled(work: Path, largest: int, rng: np.random.Generator, whole: dict[str, object]) -> tuple[str, str]:
    """One run on a full disk: its message, and what came of it."""
    out = work / "full"
    shutil.rmtree(out, ignore_errors=True)
    done = run(out, limit=int(rng.uniform(0, largest)))
    lines = done.stderr.strip().splitlines() or ["none"]
    reason = "one message" if len(lines) == 1 and "could not be written" in lines[0] else " ".join(lines)[-200:]
    return f"exit {done.returncode}, {reason if done.returncode else 'done'}", outcome(out, whole)


def page(arguments: argparse.Namespace, seconds: float, kills: Sequence[str], fulls: Sequence[tuple[str, str]]) -> str:
    """The report."""
    note = f"The uninterrupted run took {seconds:.1f} s."
    call = f"interrupted.py --count {arguments.count} --full {arguments.full} --seed {arguments.seed}"
    lines = header("Interrupted runs", __doc__, call, note)
    damaged = sum(not text.endswith("same numbers") for text in (*kills, *(after for _, after in fulls)))
    lines += [f"**{damaged} of {len(kills) + len(fulls)} damaged or with other numbers.**", "", "## Killed", ""]
    lines += table(["killed, then resumed", "runs"], Counter(kills).most_common())
    lines += ["## Full disk", ""]
    rows = [(first, after, count) for (first, after), count in Counter(fulls).most_common()]
    lines += table(["at the limit", "resumed", "runs"], rows)
    return "\n".join([*lines, made_with("h5py", "netCDF4")]).rstrip() + "\n"


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--count", type=int, default=100, help="runs that are killed")
    parser.add_argument("--full", type=int, default=20, help="runs on a full disk")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--work", type=Path, default=ROOT / "runs" / "interrupted")
    parser.add_argument("--page", type=Path, default=ROOT / "reports" / "robustness" / "interrupted.md")
    arguments = parser.parse_args()
    shutil.rmtree(arguments.work, ignore_errors=True)
    arguments.work.mkdir(parents=True)
    (arguments.work / "plan.toml").write_text(PLAN, encoding="utf-8")
    simulate = ["simulate", str(arguments.work / "plan.toml"), "--out", str(arguments.work / "campaign.nc")]
    subprocess.run([sys.executable, "-m", "mofit", *simulate], check=True, stdout=subprocess.DEVNULL)
    whole_run = arguments.work / "whole"
    run(arguments.work / "first")  # compiles the kernel, which later runs find
    began = time.perf_counter()
    json.loads(run(whole_run).stdout)
    seconds = time.perf_counter() - began
    whole = values(open_result(whole_run))
    largest = max(path.stat().st_size for path in whole_run.rglob("*"))
    rng = np.random.default_rng(arguments.seed)
    kills, fulls = [], []
    for number in range(arguments.count):
        kills.append(killed(arguments.work, number, seconds, rng, whole))
        print(number, kills[-1], flush=True)
    for number in range(arguments.full):
        fulls.append(filled(arguments.work, largest, rng, whole))
        print(number, *fulls[-1], flush=True)
    arguments.page.parent.mkdir(parents=True, exist_ok=True)
    arguments.page.write_text(page(arguments, seconds, kills, fulls), encoding="utf-8")


if __name__ == "__main__":
    main()
