"""How often do 90 % intervals hold the truth, over many seeds? Writes reports/robustness/coverage.md.

    python scripts/studies/interval_coverage.py [--first 2] [--seeds 8] [--parallel 1] [--limit 60]
                                                [--option ARGUMENT] [--work FOLDER]

The seventeen systems of `sixty_systems.py` with the right model and a box that holds the truth, each with new
parameters, tests and noise for every seed: one seed has some fifty intervals, too few to tell 90 % from 98 %. The
departure is the truth's distance from the median, in standard deviations of its side of the posterior; its root mean
square is 1 where intervals are as wide as they should be, less where they are too wide. Rows that the work folder holds
are kept, if no code has changed since.
"""

from __future__ import annotations

import argparse
import json
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from report_page import ROOT, header, made_with, table
from sixty_systems import code_digest, kept_rows
from systems.design import cases
from systems.judge import NINETY
from systems.running import LIMIT, run


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--first", type=int, default=2, help="first seed; 0 and 1 have pages of their own")
    parser.add_argument("--seeds", type=int, default=8)
    parser.add_argument("--parallel", type=int, default=1, help="systems at a time")
    parser.add_argument("--work", type=Path, default=ROOT / "runs" / "interval_coverage")
    parser.add_argument("--option", action="append", default=[], help="one more argument of mofit identify; repeatable")
    parser.add_argument("--limit", type=float, default=LIMIT, help="s of wall time; longer on a busy machine")
    arguments = parser.parse_args()
    arguments.work.mkdir(parents=True, exist_ok=True)
    right = [case for case in cases() if case.kind == "right" and not case.narrow]
    digest = code_digest([*arguments.option, f"{arguments.limit:g}"])
    tasks, rows = [], dict[tuple[int, str], dict]()
    for seed in range(arguments.first, arguments.first + arguments.seeds):
        known = kept_rows(arguments.work / f"rows-{seed}-{digest}.jsonl")
        rows |= {(seed, name): row for name, row in known.items()}
        tasks += [(seed, case) for case in right if case.name not in known]

    def one(task: tuple) -> tuple:
        seed, case = task
        return seed, run(case, seed, arguments.work, tuple(arguments.option), arguments.limit)

    with ThreadPoolExecutor(arguments.parallel) as pool:
        for seed, row in pool.map(one, tasks):
            rows[seed, row["name"]] = row
            with (arguments.work / f"rows-{seed}-{digest}.jsonl").open("a", encoding="utf-8") as file:
                file.write(json.dumps(row) + "\n")
            print(seed, row["name"], row["code"], f"{row['seconds']} s", flush=True)
    options = [f"--option={option}" for option in arguments.option]
    chosen = f"--first {arguments.first} --seeds {arguments.seeds} --limit {arguments.limit:g}"
    command = " ".join(["interval_coverage.py", chosen, *options])
    text = page(list(rows.values()), command)
    path = ROOT / "reports" / "robustness" / "coverage.md"
    path.write_text(text, encoding="utf-8")
    print(text)


def page(rows: list[dict], command: str) -> str:
    """Coverage of all systems and of each kind."""
    away: dict[str, list[float]] = {}
    for row in rows:
        own = away.setdefault(row["title"], [])
        own += [entry["away"] for entry in row["parameters"].values() if entry["away"] is not None]
    wrong, every = sum(row["green_but_wrong"] for row in rows), np.concatenate(list(away.values()))
    lines = header("Coverage of the intervals", __doc__, command)
    share = 100 * np.mean(every <= NINETY)
    first = (
        f"**The 90 % intervals hold {share:.1f} % of {every.size} true values in {len(rows)} runs; {wrong} were green "
        "and wrong.**"
    )
    body = [(title, *_line(np.array(own))) for title, own in sorted(away.items())] + [("all", *_line(every))]
    lines = [lines[0], "", first, "", *lines[2:]]
    lines += table(("system", "intervals", "90 % hold, %", "50 % hold, %", "rms departure"), body)
    return "\n".join([*lines, made_with()]).rstrip() + "\n"


def _line(away: np.ndarray) -> tuple[str, ...]:
    return (
        str(away.size), f"{100 * np.mean(away <= NINETY):.0f}", f"{100 * np.mean(away <= 0.6745):.0f}",
        f"{np.sqrt(np.mean(away**2)):.2f}",
    )  # fmt: skip


if __name__ == "__main__":
    main()
