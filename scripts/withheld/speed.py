"""Diagnose campaigns one after the other by the command, and say how long each takes from its start to its end.

    python scripts/withheld/speed.py DIR

DIR is what `generate.py` wrote. DIR/results gets one <name>.json per campaign, as `mofit diagnose --json` prints, for
`score.py`; DIR/seconds.json the seconds. What is there already is not done again. The labels are opened last of all.

The table has one line per kind of campaign, and one with the kinds weighted as in the large blind test. Nothing else
should run meanwhile.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from blinded_labels import read_labels

#: Kinds of campaigns, in words, and their share of the large blind test (reports/withheld_effects/README.md).
KINDS = {
    "none": ("no effect", 0.40),
    "effect": ("one effect", 0.50),
    "unmodelled": ("unmodelled", 0.06),
    "pair": ("two effects", 0.04),
}
#: Seconds of wall time that the shares are told for.
LIMITS = (5, 10, 30)


def main() -> None:
    """Diagnose what is left, then print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    folder = parser.parse_args().folder
    seconds = timed(folder)
    by_kind: dict[str, list[float]] = {}
    for name, label in read_labels(folder / "labels.blinded").items():
        if name in seconds:
            by_kind.setdefault(label["case"], []).append(seconds[name])
    print(table(by_kind))


def timed(folder: Path) -> dict[str, float]:
    """Seconds of every campaign by its name; what is not there yet is diagnosed."""
    results, file = folder / "results", folder / "seconds.json"
    results.mkdir(exist_ok=True)
    known: dict[str, float] = json.loads(file.read_text()) if file.exists() else {}
    for campaign in sorted((folder / "campaigns").glob("*.nc")):
        if campaign.stem in known:
            continue
        command = [sys.executable, "-m", "mofit", "diagnose", str(campaign), "--json", "--out", str(folder / "page")]
        begin = time.monotonic()
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        known[campaign.stem] = time.monotonic() - begin
        (results / f"{campaign.stem}.json").write_text(done.stdout, encoding="utf-8")
        subprocess.run(["rm", "-r", str(folder / "page")], check=True)
        file.write_text(json.dumps(known, indent=1) + "\n", encoding="utf-8")
        print(f"{campaign.stem} {known[campaign.stem]:.1f} s", file=sys.stderr)
    return known


def table(by_kind: Mapping[str, Sequence[float]]) -> str:
    """Quantiles by kind, of all, and of all with the kinds weighted, as Markdown."""
    rows = [(*KINDS[kind], np.sort(own)) for kind, own in by_kind.items()]
    rows.sort(key=lambda row: -row[1])
    values = np.concatenate([own for *_, own in rows])
    weights = np.concatenate([np.full(len(own), share / len(own)) for _, share, own in rows])
    head = "| campaigns | number | median (s) | 90 % (s) | longest (s) | " + " | ".join(f"within {s} s" for s in LIMITS)
    lines = [head + " |", "|---|" + "---:|" * (4 + len(LIMITS))]
    lines += [_line(words, own, np.ones(len(own))) for words, _, own in rows]
    lines += [_line("all", values, np.ones(len(values))), _line("all, weighted", values, weights)]
    return "\n".join(lines)


def _line(words: str, values: np.ndarray, weights: np.ndarray) -> str:
    order = np.argsort(values)
    values, share = values[order], np.cumsum(weights[order]) / weights.sum()
    median, most = (values[min(int(np.searchsorted(share, at - 1e-12)), len(values) - 1)] for at in (0.5, 0.9))
    within = [
        100 * share[below - 1] if (below := int(np.searchsorted(values, limit, "right"))) else 0.0 for limit in LIMITS
    ]
    numbers = [f"{one:.1f}" for one in (median, most, values[-1])] + [f"{one:.0f} %" for one in within]
    return f"| {words} | {len(values)} | " + " | ".join(numbers) + " |"


if __name__ == "__main__":
    main()
