"""How often do intervals contain the true values? Writes reports/calibration/README.md.

    python scripts/studies/calibration.py [--campaigns 300] [--jobs 2] [--work FOLDER]

Simulation-based calibration (Talts et al. 2018). Parameters are drawn from the prior, and a campaign is simulated in
closed form (no code of the model under test). The parameters are identified as `mofit identify` does (search,
refinement, sampling), and the rank of the truth among the posterior's draws is recorded. One mode: a damper with a
Maxwell branch on four sine tests. Two modes: an inclined spring whose sign is nearly invisible; the draws of both
modes are mixed by their probabilities. Noise: white, autoregressive with coefficient 0.8, and growing with the force.
Rows that the work folder holds already are kept.
"""

from __future__ import annotations

import argparse
import json
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

import matplotlib

from mofit._typing import FloatArray

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from scipy.stats import binom, chi2

from calibration_cases import CASES, NOISES, draw_campaign, reference
from mofit.identification.settings import Settings
from mofit.identification.stages import find_modes
from mofit.runtime.parallel import end_with_parent
from report_page import ROOT, header, made_with, table, write_page

LEVELS = (0.5, 0.8, 0.9, 0.95)
DRAWS, BINS = 99, 20
#: Departure from the nominal coverage that is asked for.
ASKED = 0.03


def run(case: str, kind: str, work: Path, number: int) -> dict:
    """One campaign: where the truth lies among the draws of each parameter."""
    row = work / f"{case.replace(' ', '_')}-{kind}-{number}.json"
    if row.exists():
        return json.loads(row.read_text())
    model, unit, truth, campaign, rng = draw_campaign(case, kind, number)
    modes = find_modes(campaign, model, Settings(seed=number, jobs=1))
    draws = []
    for mode in modes:
        points = mode.chains.thinned().points.reshape(-1, len(unit))
        draws.append(points[rng.integers(len(points), size=round(20_000 * mode.probability))])
    mixed = np.concatenate(draws)
    few = mixed[rng.integers(len(mixed), size=DRAWS)]
    found = {
        "truth": truth.tolist(),
        "place": np.mean(mixed < unit, axis=0).tolist(),
        "rank": np.sum(few < unit, axis=0).tolist(),
        "modes": len(modes),
        "converged": all(mode.chains.converged for mode in modes),
    }
    row.write_text(json.dumps(found))
    return found


def covered(place: FloatArray) -> FloatArray:
    """Whether central intervals hold the truth, (campaign, parameter, level), from its place among the draws."""
    return np.stack([np.abs(place - 0.5) <= level / 2 for level in LEVELS], axis=-1)


def coverage(rows: list[dict]) -> FloatArray:
    """Share of campaigns whose central intervals hold the truth, (parameter, level)."""
    return np.mean(covered(np.array([row["place"] for row in rows])), axis=0)


def without_chance(rows: list[dict], places: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Coverage with the chance of these campaigns taken off, and its standard error, (parameter, level) each."""
    ours, theirs = covered(np.array([row["place"] for row in rows])).astype(float), covered(places).astype(float)
    mean = theirs.mean(axis=0)
    share = np.mean((ours - ours.mean(axis=0)) * (theirs - mean), axis=0) / np.maximum(theirs.var(axis=0), 1e-12)
    left = ours - share * (theirs - np.array(LEVELS))
    return left.mean(axis=0), left.std(axis=0) / np.sqrt(len(rows))


def uniformity(rows: list[dict]) -> FloatArray:
    """p value of a chi-square test of the ranks of every parameter."""
    ranks = np.array([row["rank"] for row in rows])
    values = []
    for column in ranks.T:
        counts = np.bincount(column * BINS // (DRAWS + 1), minlength=BINS)
        values.append(chi2.sf(np.sum((counts - len(rows) / BINS) ** 2) / (len(rows) / BINS), BINS - 1))
    return np.array(values)


def draw(results: dict, folder: Path) -> None:
    """Rank histograms with the band of 99 % of chance."""
    width = max(len(case.parameters) for case in CASES.values())
    figure, axes = plt.subplots(len(results), width, figsize=(2.6 * width, 1.7 * len(results)), layout="constrained")
    for row, ((case, kind), rows) in enumerate(results.items()):
        low, high = binom.ppf((0.005, 0.995), len(rows), 1 / BINS)
        ranks = np.array([entry["rank"] for entry in rows])
        for column, spot in enumerate(axes[row]):
            if column >= ranks.shape[1]:
                spot.set_axis_off()
                continue
            spot.hist(ranks[:, column], bins=BINS, range=(-0.5, DRAWS + 0.5), color="#0072B2")
            spot.axhspan(low, high, color="#8c959f", alpha=0.3)
            spot.set(xticks=[], yticks=[])
            spot.set_title(f"{CASES[case].parameters[column].name}: {case}, {kind}", fontsize=8)
    figure.savefig(folder / "ranks.png", dpi=110)
    plt.close(figure)


def page(results: dict, arguments: argparse.Namespace) -> list[str]:
    """The tables as Markdown."""
    head = ["campaigns", "parameter", *(f"{100 * level:g} %" for level in LEVELS)]
    head += [f"{100 * level:g} %, control variate" for level in LEVELS] + ["p of ranks", "converged"]
    errors = ", ".join(f"{100 * np.sqrt(v * (1 - v) / arguments.campaigns):.1f}" for v in LEVELS)
    note = (
        f"Coverage in % of the central intervals; its standard error is {errors} points at the four levels. "
        f"p: chi-square test of the ranks in {BINS} bins. Control variate: minus the chance deviation of these "
        "campaigns, which the linearised estimate with the true noise covariance shows (it covers exactly on average), "
        "with the remaining standard error."
    )
    lines = [
        *header("Calibration of the posterior", __doc__, f"calibration.py --campaigns {arguments.campaigns}", note),
    ]
    cells: list[list[str]] = []
    every, raw, adjusted = [], [], []
    for (case, kind), rows in results.items():
        shares, p = coverage(rows), uniformity(rows)
        places = np.array([reference(case, kind, number) for number in range(len(rows))])
        pure, error = without_chance(rows, places)
        raw.append(shares - LEVELS)
        adjusted.append(pure - LEVELS)
        every.extend(p)
        sure = 100 * np.mean([row["converged"] for row in rows])
        for k, parameter in enumerate(CASES[case].parameters):
            counted = [f"{100 * v:.1f}" for v in shares[k]]
            controlled = [f"{100 * v:.1f} ± {100 * e:.1f}" for v, e in zip(pure[k], error[k], strict=True)]
            kept = [f"{case}, {kind}, {len(rows)}", parameter.name, *counted, *controlled]
            cells.append([*kept, f"{p[k]:.3f}", f"{sure:.0f} %"])
    ordered = np.sort(every)
    corrected = float(np.min(ordered * len(ordered) / np.arange(1, len(ordered) + 1)))
    lines += [
        *table(head, cells),
        f"Smallest p: {ordered[0]:.4f} of {len(ordered)}; after Holm's correction "
        f"{min(1.0, ordered[0] * len(ordered)):.3f}, "
        f"after Benjamini and Hochberg's {min(1.0, corrected):.3f}.",
        "",
        *(_within(name, np.concatenate(found)) for name, found in (("as counted", raw), ("control variate", adjusted))),
        "",
        "![Ranks of the truth among the draws; grey: 99 % of chance](ranks.png)",
        "",
    ]
    return [*lines, made_with()]


def _within(name: str, off: FloatArray) -> str:
    count = int(np.sum(np.abs(off) <= ASKED))
    return (
        f"Coverage {name}: {count} of {off.size} within {100 * ASKED:g} points; on average {100 * off.mean():+.1f}, "
        f"farthest {100 * off.ravel()[np.argmax(np.abs(off))]:+.1f}.\n"
    )


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--campaigns", type=int, default=300, help="of every kind")
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    parser.add_argument("--work", type=Path, default=ROOT / "runs" / "calibration")
    arguments = parser.parse_args()
    arguments.work.mkdir(parents=True, exist_ok=True)
    results = {}
    with ProcessPoolExecutor(arguments.jobs, initializer=end_with_parent) as pool:
        for case in CASES:
            for kind in NOISES:
                single = partial(run, case, kind, arguments.work)
                results[case, kind] = list(pool.map(single, range(arguments.campaigns), chunksize=5))
                print(case, kind, np.round(100 * coverage(results[case, kind]), 1).tolist(), flush=True)
    target = ROOT / "reports" / "calibration"
    target.mkdir(parents=True, exist_ok=True)
    draw(results, target)
    write_page("calibration", page(results, arguments))


if __name__ == "__main__":
    main()
