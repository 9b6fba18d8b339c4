"""Do the intervals of the shrinkage hold what is then measured? Writes a page with the coverage by kind of hold-out.

    python scripts/studies/shrinkage_coverage.py [--seed 1000] [--limit 60] [--parallel 2] [--work FOLDER] [--page FILE]

Campaigns of `other_rigs.py` at random: all rigs, excitations and noises, effects of the catalogue and laws of their
own. Candidates are only the laws of the family that is hidden, and no term is proposed, so that a diagnosis takes
seconds: the question is not what is named, but how far the interval reaches. Measured is against noise-free records
that no fit saw. Rows that the work folder holds already are kept.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import beta

from mofit import diagnose, read_campaign
from mofit.diagnosis.result import summary
from mofit.diagnosis.settings import DiagnosisSettings
from mofit.errors import InputError
from mofit.identification.settings import Settings
from other_rigs_cases.campaign import make, name_of
from other_rigs_cases.cases import CASES, Cell, cells
from other_rigs_cases.diagnosed import predictions
from other_rigs_cases.score import KINDS, intervals, measured_shares
from report_page import ROOT

#: candidates per family
LAWS = {
    "friction": ("dry_friction",),
    "non-linear stiffness": ("cubic_stiffness",),
    "non-linear damping": ("quadratic_damping",),
    "relaxation": ("second_branch",),
    "lag or delay": ("delay", "sensor_lowpass"),
    "drift": ("drift",),
    "play": ("backlash",),
}


def drawn(seed: int, limit: int) -> list[Cell]:
    """Campaigns with an effect or a law of its own, in random order."""
    every = [cell for cell in cells(1, 0) if CASES[cell.case].kind in ("library", "own law")]
    return [every[k] for k in np.random.default_rng(seed).permutation(len(every))[:limit]]


def run(cell: Cell, seed: int, work: Path) -> dict[str, Any]:
    """Intervals that are told and shares that are measured of one campaign."""
    name, case = name_of(cell, seed), CASES[cell.case]
    path = work / "rows" / f"{name}.json"
    if path.exists():
        return dict(json.loads(path.read_text(encoding="utf-8")))
    model = make(cell, seed, work)
    campaign, given, unseen = (read_campaign(work / part / f"{name}.nc") for part in ("campaigns", "given", "held_out"))
    whole = replace(campaign, measurements=(*campaign.measurements, *given.measurements))
    row: dict[str, Any] = {"name": name, "cell": (cell.rig, cell.excitation, cell.noise, case.name)}
    try:
        found = diagnose(
            whole,
            model,
            (case.effect,) if case.effect else LAWS[case.family],
            Settings(seed=seed, jobs=1),
            hold_out=[one.name for one in given.measurements],
            diagnosis=DiagnosisSettings(propose=False),
        )
    except InputError as error:  # a model may have the law already
        row |= {"verdict": str(error).splitlines()[0], "told": {}, "measured": {}}
    else:
        with np.load(work / "labels" / f"{name}.npz") as stored:
            truth = {key: stored[key] for key in stored.files if key != "label"}
        row |= {
            "verdict": found.conclusion.verdict,
            "told": intervals(summary(found)["shrinkage"] or {}),
            "measured": measured_shares(predictions(found, model, unseen), truth),
        }
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(row), encoding="utf-8")
    return row


def page(rows: Sequence[dict[str, Any]], command: str) -> str:
    """Coverage and width by kind of hold-out, as Markdown."""
    lines = ["# Coverage of the shrinkage's intervals", "", f"Written by `{command}`.", ""]
    lines += [
        "| measured on | hold | of | share | 95 % interval | above | below | median width | left, upper : lower end |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for kind in KINDS:
        told = [(*row["told"][kind], row["measured"][kind]) for row in rows if kind in row["told"] and row["measured"]]
        if told:
            low, high, share = np.array(told).T
            held, ratio = int(np.sum((low <= share) & (share <= high))), (1 - low) / np.maximum(1 - high, 1e-9)
            ends = [beta.ppf(q, held + k, len(told) - held + 1 - k) for q, k in ((0.025, 0), (0.975, 1))]
            ends = [0.0 if held == 0 else ends[0], 1.0 if held == len(told) else ends[1]]
            lines.append(
                f"| {kind} records | {held} | {len(told)} | {held / len(told):.0%} | {ends[0]:.0%} to {ends[1]:.0%} | "
                f"{np.mean(share > high):.0%} | {np.mean(share < low):.0%} | {np.median(high - low):.2%} | "
                f"{np.median(ratio):.0f} |"
            )
    return "\n".join([*lines, ""])


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--seed", type=int, default=1000)
    parser.add_argument("--limit", type=int, default=60)
    parser.add_argument("--parallel", type=int, default=2)
    parser.add_argument("--work", type=Path, default=ROOT / "runs" / "shrinkage_coverage")
    parser.add_argument("--page", type=Path, default=ROOT / "runs" / "shrinkage_coverage" / "README.md")
    args = parser.parse_args()
    one = partial(run, seed=args.seed, work=args.work.resolve())
    with ProcessPoolExecutor(args.parallel, get_context("spawn")) as pool:
        rows = list(pool.map(one, drawn(args.seed, args.limit)))
    args.page.parent.mkdir(parents=True, exist_ok=True)
    args.page.write_text(page(rows, f"shrinkage_coverage.py --seed {args.seed} --limit {args.limit}"), encoding="utf-8")


if __name__ == "__main__":
    main()
