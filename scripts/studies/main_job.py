"""Time and memory of the main job, stage by stage. Writes reports/main_job/README.md.

    python scripts/studies/main_job.py [--against CHECKOUT] [--repeats 5]

`mofit identify --all-freqs` runs warm in processes of its own on the bundled campaign. Runs of a former checkout
alternate with runs of this one, so that other load of the machine affects both alike; the table shows the fastest run
of each. Wall and CPU seconds (user and system, all threads) are the main process's; what other processes do meanwhile
is one row. Imports are counted wherever they happen. Peak memory is the largest resident set of any one process,
pages shared with others included.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from report_page import ROOT, header, made_with, table, write_page

#: what the measured process runs; nothing of it imports more than mofit's command line does by itself
PROBE = """
import importlib._bootstrap as bootstrap, json, os, resource, sys, time
from contextlib import contextmanager

def spent(who=resource.RUSAGE_SELF):
    used = resource.getrusage(who)
    return used.ru_utime + used.ru_stime

begin, rows, imports, depth = time.perf_counter(), [], [0.0, 0.0], 0
find = bootstrap._find_and_load

def timed(name, import_):
    global depth
    wall, cpu = time.perf_counter(), spent()
    depth += 1
    try:
        return find(name, import_)
    finally:
        depth -= 1
        if depth == 0:
            imports[0] += time.perf_counter() - wall
            imports[1] += spent() - cpu

bootstrap._find_and_load = timed
from mofit.cli import main
from mofit.runtime.progress import StageTimer
measure, own = StageTimer.measure, os.getpid()

@contextmanager
def measured(clock, stage):
    wall, cpu = time.perf_counter(), spent()
    with measure(clock, stage):
        yield
    if os.getpid() == own:
        rows.append((stage, wall - begin, time.perf_counter() - wall, spent() - cpu, cpu))

StageTimer.measure = measured
code = main(["identify", "--all-freqs", "--seed", "0", "--json", "--out", sys.argv[1]])
children = resource.RUSAGE_CHILDREN
with open("/proc/self/status") as status:
    peak = next(int(line.split()[1]) for line in status if line.startswith("VmHWM")) / 1024
figures = {"code": code, "wall": time.perf_counter() - begin, "cpu": spent(), "imports": imports, "rows": rows,
           "others": spent(children), "peak": peak, "others_peak": resource.getrusage(children).ru_maxrss / 1024}
with open(sys.argv[2], "w") as file:
    json.dump(figures, file)
"""


def run(checkout: Path) -> dict[str, Any]:
    """One run of a checkout, as its probe measured it."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "figures.json"
        command = [sys.executable, "-c", PROBE, str(Path(folder) / "run"), str(out)]
        environment = {**os.environ, "PYTHONPATH": str(checkout)}
        subprocess.run(command, check=True, cwd=folder, env=environment, capture_output=True)
        return json.loads(out.read_text())


def stages(figures: dict[str, Any]) -> dict[str, tuple[float, float]]:
    """Wall and CPU seconds by stage, in order, adding up to the whole."""
    first = figures["rows"][0]
    found = {"start, imports and reading": (first[1], first[4])}
    wall, cpu = first[1], first[4]
    for stage, _, seconds, used, _ in figures["rows"]:
        found[stage.replace("_", " ")] = (seconds, used)
        wall, cpu = wall + seconds, cpu + used
    found["assemble, write, report"] = (figures["wall"] - wall, figures["cpu"] - cpu)
    return found


def tables(runs: dict[str, dict[str, Any]]) -> list[str]:
    """Stages by row; wall and CPU seconds of every checkout by column."""
    by_run = [stages(figures) for figures in runs.values()]
    names = list(dict.fromkeys(name for found in by_run for name in found))
    names = [name for name in names if name != "assemble, write, report"] + ["assemble, write, report"]
    rows = [(name, *(found.get(name) for found in by_run)) for name in names]
    rows.append(("**all**", *((figures["wall"], figures["cpu"]) for figures in runs.values())))
    rows.append(("of which imports", *(tuple(figures["imports"]) for figures in runs.values())))
    rows.append(("other processes", *((None, figures["others"]) for figures in runs.values())))
    heading = ["seconds", *(f"{which}, {kind}" for which in runs for kind in ("wall", "CPU"))]
    cells = []
    for name, *pairs in rows:
        values = [value for pair in pairs for value in (pair or (None, None))]
        cells.append([name, *("" if value is None else f"{value:.2f}" for value in values)])
    memory = [
        [name, *(f"{figures[key]:.0f}" for figures in runs.values())]
        for name, key in (("main process", "peak"), ("largest other process", "others_peak"))
    ]
    return [*table(heading, cells), *table(["peak memory, MB", *runs], memory)]


def main() -> None:
    """Measure, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--against", type=Path, help="former checkout of mofit to measure as well")
    parser.add_argument("--repeats", type=int, default=5)
    options = parser.parse_args()
    checkouts = ({"before": options.against.resolve()} if options.against else {}) | {"now": ROOT}
    for checkout in checkouts.values():
        subprocess.run([sys.executable, "-m", "compileall", "-q", str(checkout / "mofit")], check=True)
        run(checkout)  # what is kept from run to run: compiled kernels, matplotlib's list of fonts
    runs: dict[str, dict[str, Any]] = {}
    loads = []
    for _ in range(options.repeats):
        for name, checkout in checkouts.items():
            figures = run(checkout)
            if name not in runs or figures["wall"] < runs[name]["wall"]:
                runs[name] = figures
        loads.append(os.getloadavg()[0])
    command = f"main_job.py{' --against CHECKOUT' if options.against else ''} --repeats {options.repeats}"
    machine = f"{platform.machine()}, {os.cpu_count()} cores, niceness {os.nice(0)}"
    machine += f", load {min(loads):.1f} to {max(loads):.1f}"
    note = f"Quickest of {options.repeats} runs; {machine} (the measured process counts as about 1)."
    head = header("The main job, stage by stage", __doc__, command, note)
    write_page("main_job", [*head, made_with(), "", *tables(runs)])


if __name__ == "__main__":
    main()
