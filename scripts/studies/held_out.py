"""Do predictions hold at frequencies that were not measured? Writes reports/held_out/README.md.

    python scripts/studies/held_out.py [--campaigns 6] [--jobs 2] [--work FOLDER]

The bundled campaign hides a relaxation spectrum from the Maxwell model. Each sine test is left out in turn, the model
is identified from the others, and the amplitude and phase of the force at the left-out frequency are predicted, with
two kinds of 90 % intervals. Plain: from the posterior width of the parameters if the model were right. Gap-aware:
from their posterior width with the gap of the model, and the gap itself on the predicted line. Campaigns differ in
the seed of their noise. Rows that the work folder holds already are kept.
"""

from __future__ import annotations

import argparse
import json
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mofit._typing import FloatArray
from mofit.data import Campaign
from mofit.identification.settings import Settings
from mofit.identification.stages import find_modes
from mofit.models import find_model
from mofit.problem import build_problem
from mofit.runtime.parallel import end_with_parent
from mofit.simulation.virtual_rig.plan import read_plan
from mofit.simulation.virtual_rig.rig import run_plan
from report_page import ROOT, header, made_with, table, write_page

MODEL, PLAN = "maxwell_tyre", ROOT / "data" / "plans" / "paper.toml"
DRAWS = 400


def fundamental(force: FloatArray, time: FloatArray, frequency: float) -> NDArray[np.complex128]:
    """Complex amplitude of records (..., n) at a frequency, over the last whole periods after the first two."""
    step = time[1] - time[0]
    periods = int(len(time) * step * frequency + 0.01) - 2
    count = round(periods / (frequency * step))
    carrier = np.exp(-2j * np.pi * frequency * time[-count:])
    return np.asarray(2 * np.mean(force[..., -count:] * carrier, axis=-1))


def run(work: Path, seed: int, test: str) -> dict:
    """One test left out: the measured amplitude and phase, and the two intervals of each."""
    row = work / f"{seed}-{test}.json"
    if row.exists():
        return json.loads(row.read_text())
    campaign: Campaign = run_plan(read_plan(PLAN).model_copy(update={"seed": seed}))
    model, rng = find_model(MODEL), np.random.default_rng([seed, 9])
    kept = tuple(m.name for m in campaign.measurements if m.kind == "sine" and m.name != test)
    best = find_modes(campaign, model, Settings(seed=seed, jobs=1), kept)[0]
    left_out = campaign.select((test,))
    problem = build_problem(model, left_out)
    measurement = left_out.measurements[0]
    frequency, time = float(measurement.experiment.frequency), measurement.time
    measured = fundamental(measurement.channel("lateral_force"), time, frequency)
    wide = best.chains.thinned().points.reshape(-1, len(problem.space))
    wide = wide[rng.integers(len(wide), size=DRAWS)]
    factor = np.linalg.cholesky(np.linalg.inv(best.noise_hessian))
    narrow = np.clip(best.minimum.point + rng.normal(size=wide.shape) @ factor.T, 0, 1)
    # what the noise of the record adds to its own amplitude
    noise = 2 * problem.signals[0].noise_sd["lateral_force"] / np.sqrt(2 * len(time))
    gap = np.sqrt(best.sampled.score.gap_squares[0] / 2) * np.ptp(measurement.channel("lateral_force"))
    found = {"seed": seed, "test": test, "frequency": frequency}
    for name, points, extra in (("plain", narrow, 0.0), ("gap_aware", wide, gap)):
        spread = np.hypot(noise, extra)
        predicted = fundamental(problem.simulate(points)[0][..., 0], time, frequency)
        predicted = predicted + spread * (rng.normal(size=DRAWS) + 1j * rng.normal(size=DRAWS))
        turned = np.angle(predicted / measured)
        for kind, values, truth in (("amplitude", np.abs(predicted), np.abs(measured)), ("phase", turned, 0.0)):
            low, high = np.quantile(values, (0.05, 0.95))
            found[f"{name}_{kind}"] = bool(low <= truth <= high)
            found[f"{name}_{kind}_width"] = float((high - low) / (np.abs(measured) if kind == "amplitude" else 1.0))
    row.write_text(json.dumps(found))
    return found


def page(rows: list[dict], arguments: argparse.Namespace) -> list[str]:
    """The table as Markdown."""
    title, command = "Predictions at frequencies that were left out", f"held_out.py --campaigns {arguments.campaigns}"
    note = (
        "Coverage of the 90 % intervals in %, their mean width beside it (amplitude: % of the amplitude; phase: mrad)."
    )

    def cells(own: list[dict]) -> list[str]:
        parts = []
        for name in ("plain", "gap_aware"):
            for kind, unit in (("amplitude", 100), ("phase", 1000)):
                share = 100 * np.mean([row[f"{name}_{kind}"] for row in own])
                width = unit * np.mean([row[f"{name}_{kind}_width"] for row in own])
                parts.append(f"{share:.0f} ({width:.3g})")
        return parts

    lines = []
    for frequency in sorted({row["frequency"] for row in rows}):
        own = [row for row in rows if row["frequency"] == frequency]
        lines.append([f"{frequency:g} Hz", len(own), *cells(own)])
    lines.append(["all", len(rows), *cells(rows)])
    columns = ("left out", "predictions", "plain: amplitude", "phase", "gap-aware: amplitude", "phase")
    both = [
        100 * np.mean([[row[f"{name}_amplitude"], row[f"{name}_phase"]] for row in rows])
        for name in ("plain", "gap_aware")
    ]
    together = f"Amplitude and phase together: plain {both[0]:.0f} %, gap-aware {both[1]:.0f} %."
    return [*header(title, __doc__, command, note), *table(columns, lines), together, "", made_with()]


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--campaigns", type=int, default=6)
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    parser.add_argument("--work", type=Path, default=ROOT / "runs" / "held_out")
    arguments = parser.parse_args()
    arguments.work.mkdir(parents=True, exist_ok=True)
    bundled = read_plan(PLAN).seed
    tests = [test.name for test in read_plan(PLAN).tests if test.kind == "sine"]
    tasks = [(bundled + k, test) for k in range(arguments.campaigns) for test in tests]
    with ProcessPoolExecutor(arguments.jobs, initializer=end_with_parent) as pool:
        rows = list(pool.map(partial(run, arguments.work), *zip(*tasks, strict=True)))
    write_page("held_out", page(rows, arguments))


if __name__ == "__main__":
    main()
