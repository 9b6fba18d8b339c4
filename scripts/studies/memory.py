"""How much memory does an identification take beyond the data? Writes reports/robustness/memory.md.

    python scripts/studies/memory.py [--tests 15] [--samples 200000] [--work FOLDER]

A simulated Maxwell damper, stroked by sines with noise, is identified by one thread. A second thread looks at the
resident memory of the process a hundred times per second. What the process held when the campaign was read is
subtracted, with all that was free given back before; the rest is divided by the number of samples. Up to 50 MB are
tables that do not grow with the data.
"""

from __future__ import annotations

import argparse
import multiprocessing
import shutil
import threading
import time
from pathlib import Path

from mofit.data import read_campaign, write_campaign
from mofit.identification.identify import identify
from mofit.identification.settings import Settings
from mofit.runtime.memory import give_back
from mofit.simulation.virtual_rig import Plan, run_plan
from mofit.simulation.virtual_rig.plan import NoisePlan, TestPlan
from report_page import ROOT, header, made_with, table

RATE = 1000.0


class Memory:
    """Resident memory of this process in bytes, and the most since the last look."""

    def __init__(self) -> None:
        self.most = 0
        threading.Thread(target=self._watch, daemon=True).start()

    @staticmethod
    def now() -> int:
        """Of this moment."""
        lines = Path("/proc/self/status").read_text().splitlines()
        return 1024 * next(int(line.split()[1]) for line in lines if line.startswith("VmRSS"))

    def _watch(self) -> None:
        while True:
            self.most = max(self.most, self.now())
            time.sleep(0.01)


def main() -> None:
    """Identify and write the page."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--tests", type=int, default=15)
    parser.add_argument("--samples", type=int, default=200_000, help="of every test")
    parser.add_argument("--work", type=Path, default=ROOT / "runs" / "memory")
    args = parser.parse_args()
    shutil.rmtree(args.work, ignore_errors=True)
    args.work.mkdir(parents=True)
    path = args.work / "campaign.nc"
    # by a process of its own, whose memory goes with it
    writer = multiprocessing.get_context("fork").Process(target=write, args=(args.tests, args.samples, path))
    writer.start()
    writer.join()
    campaign, memory, total = read_campaign(path), Memory(), args.tests * args.samples
    give_back()
    before, rows, stage = memory.now(), list[tuple[str, str, str]](), ""

    def look(name: str, done: int, of: int, note: str) -> None:
        nonlocal stage
        if name.split(" mode")[0] != stage:
            rows.append((stage, f"{(memory.most - before) / total:.0f}", f"{(memory.now() - before) / total:.0f}"))
            stage, memory.most = name.split(" mode")[0], 0

    identify(campaign, "maxwell_damper", Settings(jobs=1, evaluations=64), out=args.work / "run", progress=look)
    look("end", 0, 0, "")
    command = f"memory.py --tests {args.tests} --samples {args.samples}"
    note = f"Seed 0; {total:,} samples, {before / 1e6:.0f} MB with the campaign read."
    lines = header("Memory beyond the data", __doc__, command, note)
    lines += table(("stage", "most, bytes per sample", "at its end"), rows[1:])
    lines.append(made_with())
    (ROOT / "reports" / "robustness" / "memory.md").write_text("\n".join(lines) + "\n", encoding="utf-8")
    print("\n".join(lines))


def write(tests: int, samples: int, path: Path) -> None:
    """Simulate the campaign and write its file."""
    write_campaign(run_plan(plan(tests, samples)), path)


def plan(tests: int, samples: int) -> Plan:
    """Sines of 0.5 Hz, 1 Hz and so on."""
    seconds = samples / RATE
    return Plan(
        title="memory",
        model="maxwell_damper",
        seed=0,
        parameters={"c": 2000.0, "p": 0.0, "d": 1500.0, "F_0": 0.0, "c_M": 1e5, "d_M": 500.0},
        noise={"force": NoisePlan(sd=1.0)},
        tests=tuple(
            TestPlan(
                name=f"t{k}", kind="sine", sample_rate=RATE, amplitude=0.01, frequency=0.5 * (k + 1),
                periods=int(0.5 * (k + 1) * seconds),
            )
            for k in range(tests)
        ),
    )  # fmt: skip


if __name__ == "__main__":
    main()
