"""Open the labels, last of all, and count how the diagnosis did.

    python scripts/withheld/score.py DIR/labels.blinded DIR/results [--next DIR/next-results ...]
                                     [--without DIR/without] [--made-by TEXT] --out REPORT

Each folder of results has one <name>.json per campaign, as `mofit diagnose --json` prints. Beside it may lie a
<name>.npz with arrays `<test>/start`, `<test>/before`, `<test>/after`: the first sample, and the force in N that the
models without and with the effect predict for each test when fitted to all others. Then the true shrinkage is that of
those predictions, judged by the noise-free record; elsewhere it is the expectation in the label.

REPORT gets README.md, figures.json, rows.json (one row per campaign) and confusion.png.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from blinded_labels import read_labels
from hidden import case_of, setting, slot_of
from respond import respond
from tally import Pairing, confusion, figures
from verdict_page import draw, page


def main() -> None:
    """Score and write the report."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("labels", type=Path)
    parser.add_argument("results", type=Path)
    parser.add_argument("--next", type=Path, nargs="*", default=[], help="results with an advised test added, by round")
    parser.add_argument("--without", type=Path, help="results with the true effect taken from the candidates")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--made-by", default="", help="command and versions, for the page")
    options = parser.parse_args()
    labels = read_labels(options.labels)
    main_run = joined(labels, options.results, with_truth=True)
    if not main_run:
        sys.exit(f"{options.results}: no result belongs to a campaign of {options.labels}; run the diagnosis first")
    following = [joined(labels, folder) for folder in options.next]
    found = figures(main_run, following, joined(labels, options.without) if options.without else [])
    found["not_diagnosed"] = len(labels) - len(main_run)
    options.out.mkdir(parents=True, exist_ok=True)
    down, across, counts = confusion(main_run)
    (options.out / "README.md").write_text(page(found, down, across, counts, options.made_by), encoding="utf-8")
    (options.out / "figures.json").write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    rows = ",\n".join(json.dumps(row(p)) for p in main_run)
    (options.out / "rows.json").write_text(f"[\n{rows}\n]\n", encoding="utf-8")
    draw(options.out / "confusion.png", down, across, counts)
    print(json.dumps(found, indent=1))


def joined(labels: Mapping[str, Mapping[str, Any]], folder: Path, with_truth: bool = False) -> list[Pairing]:
    """Results beside their labels; ``with_truth`` with the shrinkage that the noise-free records show."""
    paths = [folder / f"{name}.json" for name in labels if (folder / f"{name}.json").exists()]
    return [
        Pairing(p.stem, label, json.loads(p.read_text()), actual(label, p.with_suffix(".npz")) if with_truth else None)
        for p, label in ((path, labels[path.stem]) for path in paths)
    ]


def actual(entry: Mapping[str, Any], predictions: Path) -> float | None:
    """Share of the structured gap that is gone on tests that the fits had not seen."""
    if not predictions.exists():
        return (entry.get("shrinkage") or {}).get("share")
    tests = {test.name: test for test in setting(slot_of(entry))[1]}
    before = after = 0.0
    with np.load(predictions) as stored:
        names = sorted({key.rsplit("/", 1)[0] for key in stored if key.endswith("/before")} & set(tests))
        forces = respond([(case_of(entry), tests[name]) for name in names])
        for name, force in zip(names, forces, strict=True):
            start = int(stored[f"{name}/start"])
            pair = [stored[f"{name}/{side}"] for side in ("before", "after")]
            true = force[start : start + len(pair[0])]
            squares = [float(np.mean((side - true) ** 2)) / np.ptp(force) ** 2 for side in pair]
            before, after = before + squares[0], after + squares[1]
    return 1 - after / before if before > 0 else None


def row(p: Pairing) -> dict[str, Any]:
    """One campaign in short."""
    return {
        "campaign": p.campaign,
        "case": p.label["case"],
        "noise": p.label["noise"],
        "causes": [{key: cause[key] for key in ("name", "size", "unit", "strength")} for cause in p.label["causes"]],
        "beyond_library": p.label.get("beyond_library"),
        "verdict": p.verdict,
        "named": list(p.named),
        "score": p.score if p.label["causes"] else None,
        "exact": p.exact,
        "actual_shrinkage": p.actual,
        "shrinkage": p.result.get("shrinkage"),
        "seconds": p.result.get("seconds"),
    }


if __name__ == "__main__":
    main()
