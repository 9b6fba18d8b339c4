"""The way of a newcomer, timed: from files of one's own to a report. Writes reports/newcomer/README.md.

    python scripts/studies/newcomer.py [--work FOLDER]

A logger has written three tests of a damper as CSV: German names, semicolons, decimal commas, stroke in mm. It scales
its columns on its own: the file of the fastest test has its force in kN, although its head says N. The newcomer has
nothing but docs/tutorial.md; the commands below are those of its sections 2 to 4, read from the page, and the
correction that section 3 describes: the warning of `mofit check` names the test, its unit is corrected in the map, and
the import is repeated with `--force`. Time for reading is not counted.
"""

from __future__ import annotations

import argparse
import re
import resource
import shlex
import shutil
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import mofit
from report_page import ROOT, header, made_with, table, write_page

#: What the report should find: examples/rig_csv.py in the names of the model of the tutorial.
TRUTH = {"c": 800.0, "c_M": 60e3, "d_M": 2400.0}
#: Noise of the force, N.
NOISE = 4.0
#: Frequency, and what the force is written in: N, and once kN.
TESTS = ((0.5, 1.0), (2.0, 1.0), (8.0, 1e-3))
#: Seconds that the commands may take.
LIMIT = 300.0
#: The warning of `mofit check`.
WARNING = "as if in another unit"


@dataclass(frozen=True)
class Step:
    """A command: its seconds on the clock and of the processor, and what it printed."""

    command: str
    seconds: float
    processor: float
    text: str


def write_logs(folder: Path) -> None:
    """The files of the logger."""
    folder.mkdir(parents=True)
    rng = np.random.default_rng(1)
    stiffness, branch, tau = TRUTH["c"], TRUTH["c_M"], TRUTH["d_M"] / TRUTH["c_M"]
    for frequency, scale in TESTS:
        t, w = np.arange(0, 10 / frequency, 0.002), 2 * np.pi * frequency
        lag = w * tau
        flow = branch * lag / (1 + lag**2) * (np.cos(w * t) + lag * np.sin(w * t) - np.exp(-t / tau))
        force = 0.01 * (stiffness * np.sin(w * t) + flow) + rng.normal(0, NOISE, len(t))
        rows = zip(t, 10 * np.sin(w * t), scale * force, strict=True)
        lines = ["Zeit [s];Weg [mm];Kraft [N]", *(f"{a:.3f};{x:.4f};{f:.6g}".replace(".", ",") for a, x, f in rows)]
        (folder / f"sine_{frequency:g}Hz.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")


def commands() -> list[str]:
    """The commands of sections 2 to 4 of the tutorial."""
    text = (ROOT / "docs" / "tutorial.md").read_text(encoding="utf-8")
    part = text[text.index("\n## 2 ") : text.index("\n## 5 ")]
    return [line for block in re.findall(r"^```sh\n(.*?)^```", part, re.S | re.M) for line in block.splitlines()]


def ran(command: str, folder: Path) -> Step:
    """Run a command of mofit in a folder, as a shell would."""
    words = [one for word in shlex.split(command)[1:] for one in _named(word, folder)]
    before, begun = _processor(), time.perf_counter()
    done = subprocess.run(
        [sys.executable, "-m", "mofit", *words], cwd=folder, capture_output=True, text=True, check=False
    )
    if done.returncode:
        sys.exit(f"{command}: exit code {done.returncode}\n{done.stdout}{done.stderr}")
    seconds = time.perf_counter() - begun
    return Step(command, seconds, _processor() - before, " ".join((done.stdout + done.stderr).split()))


def _named(word: str, folder: Path) -> list[str]:
    """The files that a word with a star names, as a shell puts them in its place."""
    return sorted(str(path.relative_to(folder)) for path in folder.glob(word)) if "*" in word else [word]


def _processor() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def corrected(map_file: Path, warning: str) -> None:
    """Correct the unit of the force in the test that the warning names."""
    [test] = re.findall(rf"group '([^']+)', variable 'force'(?:(?!group ').)*?{WARNING}", warning)
    head, name, tail = map_file.read_text(encoding="utf-8").partition(f'name = "{test}"')
    assert name, test
    map_file.write_text(head + name + re.sub(r'(force = .*unit = )"N"', r'\1"kN"', tail, count=1), encoding="utf-8")


def walked(folder: Path) -> list[Step]:
    """The whole way."""
    write_logs(folder / "my_rig")
    guess, imports, check, *rest = commands()
    steps = [ran(command, folder) for command in (guess, imports, check)]
    corrected(folder / "my_rig" / "map.toml", steps[-1].text)
    steps += [ran(f"{imports} --force", folder), ran(check, folder)]
    if WARNING in steps[-1].text:
        sys.exit("the unit is not corrected")
    return steps + [ran(command, folder) for command in rest]


def _kept(seconds: float) -> str:
    return "kept" if seconds <= LIMIT else "exceeded"


def main() -> None:
    """Walk, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--work", type=Path, default=Path("runs/newcomer"))
    given = parser.parse_args()
    shutil.rmtree(given.work, ignore_errors=True)  # a time that is measured has no earlier part
    steps = walked(given.work)
    found = mofit.summary(given.work / "runs" / "first").loc["m1"]
    lines = header("The way of a newcomer", __doc__, "newcomer.py", made_with())
    total, processor = (sum(getattr(step, name) for step in steps) for name in ("seconds", "processor"))
    lines += [
        f"All commands take {total:.0f} s on the clock, {processor:.0f} s of the processor. The clock ran on a machine "
        f"of two cores that had other work. Five minutes are {_kept(total)} on the clock, {_kept(processor)} by the "
        "processor.",
        "",
        *table(
            ("command", "s", "s of the processor"),
            [(f"`{step.command}`", f"{step.seconds:.1f}", f"{step.processor:.1f}") for step in steps],
        ),
        "What `mofit check` said before the correction:",
        "",
        f"> {steps[2].text}",
        "",
        "What the report says of the parameters, beside the true values:",
        "",
        *table(
            ("parameter", "true", "mean", "sd", "unit", "verdict"),
            [
                (f"`{name}`", f"{TRUTH.get(name, 0.0):g}", f"{row['mean']:.5g}", f"{row['sd']:.2g}", row["unit"],
                 row["verdict"])
                for name, row in found.iterrows()
            ],
        ),
    ]  # fmt: skip
    write_page("newcomer", lines)


if __name__ == "__main__":
    main()
