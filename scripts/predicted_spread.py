"""Is the spread that `mofit compare` predicts the spread that estimates have? Writes reports/predicted_spread/.

    python scripts/predicted_spread.py [--campaigns 200] [--procedures 12] [--seed 7] [--work FOLDER]

The tyre of the paper's Table 5 on a virtual rig (data/plans/paper.toml without its hidden effect: noise of 5 N white
and 2 N coloured, three steps and a quasi-static test for calibration), tested by procedures from a single sine to all
nine, a chirp, a multisine and a step. Every campaign has noise of its own. Its parameters are estimated as
`mofit identify` does, without the search: calibration stages, refinement of all parameters from the truth and from
starts around it, independent residuals counted, refined again, and once more with the likelihood as wide as the noise
asks for. Predicted is what `mofit compare` says at the true values, from the noise that the plan states. Rows that the
work folder holds already are kept.
"""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mofit.calibration import Calibration, calibrate, calibrated_values
from mofit.campaign import Campaign, Measurement
from mofit.identifiability.compare import compare
from mofit.identifiability.comparison import Entry, Procedure
from mofit.identifiability.sources import planned_source
from mofit.identifiability.telling import tell
from mofit.library import find_model
from mofit.parameters import ParameterSpace
from mofit.posing import main_problem
from mofit.refine import RefineSettings, merge, refine
from mofit.sample import laplace_covariance
from mofit.settings import Settings
from mofit.simulate import Plan, read_plan, run_plan
from mofit.simulate.noise import noise
from mofit.simulate.plan import TestPlan
from mofit.spread import spread_problem
from report_header import header, versions

Array = NDArray[np.float64]

ROOT = Path(__file__).resolve().parents[1]
PARAMETERS = ("d_y", "c_M", "d_M")
EXTRA = (
    {"name": "chirp", "kind": "chirp", "amplitude": "2 deg", "frequency": "0.2 Hz", "last_frequency": "4 Hz",
     "duration": "20 s"},
    {"name": "multisine", "kind": "multisine", "amplitude": "3 deg", "frequency": "0.25 Hz",
     "lines": [1, 2, 4, 8, 16], "periods": 5},
    {"name": "step_alone", "kind": "step", "amplitude": "2 deg", "ramp_rate": "40 deg/s", "delay": "0.5 s",
     "duration": "20 s"},
    {"name": "sine_1_00Hz_8deg", "kind": "sine", "amplitude": "8 deg", "frequency": "1 Hz", "periods": 20},
    {"name": "sine_2_00Hz_quarter_deg", "kind": "sine", "amplitude": "0.25 deg", "frequency": "2 Hz", "periods": 20},
)  # fmt: skip
SINES = tuple(f"sine_{f}Hz" for f in "0_25 0_50 1_00 1_50 2_00 2_50 3_00 3_50 4_00".split())
PROCEDURES = {
    "sine 0.25 Hz": SINES[:1],
    "sine 1 Hz": SINES[2:3],
    "sine 2 Hz": SINES[4:5],
    "sine 4 Hz": SINES[-1:],
    "sines 0.25, 0.5, 1 Hz": SINES[:3],
    "sines 3, 3.5, 4 Hz": SINES[-3:],
    "all nine sines": SINES,
    "chirp 0.2 to 4 Hz": ("chirp",),
    "multisine 0.25 to 4 Hz": ("multisine",),
    "step of 2 deg": ("step_alone",),
    "sine 1 Hz, 8 deg": ("sine_1_00Hz_8deg",),
    "sine 2 Hz, 0.25 deg": ("sine_2_00Hz_quarter_deg",),
}
CALIBRATION = ("step_1deg", "step_2deg", "step_4deg", "quasi_static")
#: Half the width, in the unit cube, of the box around the truth in which other starts lie; their number.
AROUND, STARTS = 0.15, 3
#: Agreement that is asked for.
WITHIN = 0.15


def rig() -> Plan:
    """The plan of the bundled campaign without its effect, with more tests."""
    plan = read_plan(ROOT / "data" / "plans" / "paper.toml")
    more = [TestPlan.model_validate({"sample_rate": "100 Hz", **extra}) for extra in EXTRA]
    return plan.model_copy(update={"effects": (), "tests": (*plan.tests, *more)})


def with_noise(clean: Campaign, plan: Plan, rng: np.random.Generator) -> Campaign:
    """A campaign as the rig would measure it."""
    own = plan.noise["lateral_force"]
    sd, coloured = (float(str(value).split()[0]) for value in (own.sd, own.coloured_sd))
    measured = []
    for test in clean.measurements:
        force = test.outputs["lateral_force"]
        error = noise(force, rng, sd=sd, coloured_sd=coloured, coefficient=own.coefficient)
        measured.append(Measurement(test.procedure, {"lateral_force": force + error}, test.units))
    return replace(clean, measurements=tuple(measured))


def estimate(
    campaign: Campaign, tests: tuple[str, ...], stages: list[Calibration], truth: Array, rng: np.random.Generator
) -> tuple[Array, Array]:
    """Values of all parameters, and the standard deviations that the estimate claims."""
    model, settings = find_model("maxwell_tyre"), Settings(jobs=1)
    space = ParameterSpace(model.parameters)
    centre = space.to_unit(truth)
    known = calibrated_values(stages)
    for name, value in known.items():
        centre[space.index(name)] = space.subset([name]).to_unit(np.array([value]))[0]
    free = np.array([name not in known for name in space.names])
    starts = np.repeat(centre[None], 1 + STARTS, axis=0)
    starts[1:, free] += rng.uniform(-AROUND, AROUND, (STARTS, int(free.sum())))
    problem = main_problem(model, campaign.select(tests), space, stages, settings)
    local = problem.near(np.clip(starts, 0, 1), np.full(len(space), 0.01))
    first = merge(refine(local.evaluate, np.clip(starts, 0, 1)))
    counted = local.with_noise_at(first[0].point)
    found = merge(refine(counted.evaluate, np.stack([minimum.point for minimum in first])))[0]
    wide = spread_problem(counted, found.point)
    (moved, *_) = merge(refine(wide.evaluate, found.point[None], RefineSettings(join=None)))
    freedom = wide.adjustment.freedom  # the likelihood is Student-t: wider than its curvature at the top says
    precision = (1 - 2 / freedom) * wide.adjustment.precision + wide.problem.prior_precision
    claimed = np.sqrt(np.diag(laplace_covariance(precision)))
    values = space.from_unit(moved.point)
    return values, claimed * space.slope(values)


def simulate(
    name: str,
    campaigns: int,
    seed: int,
    work: Path,
    clean: Campaign,
    plan: Plan,
    truth: Array,
    calibrated: dict[int, list[Calibration]],
) -> list[dict]:
    """One row per campaign: the estimates. ``calibrated`` are those of the campaigns, which all procedures share."""
    path = work / f"{name.replace(' ', '_').replace(',', '')}-{seed}.jsonl"
    lines = path.read_text(encoding="utf-8").splitlines(keepends=True) if path.exists() else []
    rows = [json.loads(line) for line in lines if line.endswith("\n")]
    model = find_model("maxwell_tyre")
    space = ParameterSpace(model.parameters)
    tests = PROCEDURES[name]
    own_steps = any(test.startswith("step") for test in tests)
    with path.open("a", encoding="utf-8") as file:
        for number in range(len(rows), campaigns):
            begin = time.process_time()
            rng = np.random.default_rng([seed, number])
            # the calibration tests of a campaign have the same noise, whatever else is tested
            calibration = with_noise(clean.select(CALIBRATION), plan, rng)
            main = with_noise(clean.select(tests), plan, rng)
            both = replace(calibration, measurements=(*calibration.measurements, *main.measurements))
            if own_steps:  # they calibrate, too
                stages, _ = calibrate(model, both, space, seed=0, jobs=1)
            else:
                if number not in calibrated:
                    calibrated[number], _ = calibrate(model, calibration, space, seed=0, jobs=1)
                stages = calibrated[number]
            values, claimed = estimate(both, tests, stages, truth, rng)
            row = {"number": number, "values": values.tolist(), "claimed": claimed.tolist(),
                   "cpu_seconds": time.process_time() - begin}  # fmt: skip
            file.write(json.dumps(row) + "\n")
            file.flush()
            rows.append(row)
    return rows[:campaigns]


def predict(plan: Plan) -> tuple[dict[str, dict[str, Entry]], Array]:
    """What compare says at the truth, and the truth."""
    named = tuple(test for tests in PROCEDURES.values() for test in tests)
    calibration = tuple(t for t in plan.tests if t.name != "step_alone")
    found = {}
    for tests, chosen in (
        (calibration, lambda own: "step_alone" not in own),
        (plan.tests, lambda own: "step_alone" in own),
    ):
        names = {test.name for test in tests}
        source = planned_source("rig", plan.model_copy(update={"tests": tests}), find_model(plan.model),
                                tuple(name for name in named if name in names))  # fmt: skip
        procedures = [Procedure(name, 0, own) for name, own in PROCEDURES.items() if chosen(own)]
        for row in compare([tell(source, source.values[None])], procedures, PARAMETERS).judged:
            found[row.procedure.name] = dict(row.entries)
    return {name: found[name] for name in PROCEDURES}, source.values


def table(
    predicted: dict[str, dict[str, Entry]], results: dict[str, list[dict]], truth: Array
) -> tuple[list[str], list]:
    """Lines of Markdown, and the same as data."""
    space = ParameterSpace(find_model("maxwell_tyre").parameters)
    head = ["procedure", "parameter", "verdict", "predicted sd", "actual sd", "actual / predicted", "inner / predicted",
            "bias / actual sd", "claimed sd", "estimates at a bound", "profile's 95 %", "within 15 %"]  # fmt: skip
    lines = [f"| {' | '.join(head)} |", "|---" * len(head) + "|"]
    data = []
    for name, rows in results.items():
        values = np.array([row["values"] for row in rows])
        claimed = np.array([row["claimed"] for row in rows])
        for parameter in PARAMETERS:
            entry, k = predicted[name][parameter], space.index(parameter)
            own = values[:, k]
            actual, ratio = float(own.std(ddof=1)), float(own.std(ddof=1) / entry.sd_here)
            far = int(np.argmax(np.abs(own - np.median(own))))
            inner = float(np.diff(np.quantile(own, [0.1587, 0.8413]))[0] / 2 / entry.sd_here)
            unit = space.to_unit(values)[:, k]
            edge = float(np.mean((unit < 1e-6) | (unit > 1 - 1e-6)))
            counted = entry.verdict == "identifiable"
            row = {
                "procedure": name, "parameter": parameter, "verdict": entry.verdict, "predicted_sd": entry.sd_here,
                "actual_sd": actual, "ratio": ratio, "inner_ratio": inner,
                "bias": float((own.mean() - truth[k]) / actual),
                "claimed_sd": float(np.median(claimed[:, k])), "at_bound": edge, "campaigns": len(rows),
                "profile": None if entry.limits is None else [_natural(space, truth, k, entry.limits.low),
                                                              _natural(space, truth, k, entry.limits.high)],
                "within": bool(abs(ratio - 1) <= WITHIN) if counted else None,
                "farthest": float(own[far] - truth[k]),
                "ratio_without_farthest": float(np.delete(own, far).std(ddof=1) / entry.sd_here),
            }  # fmt: skip
            data.append(row)
            profile = "" if entry.limits is None else " to ".join(
                "open" if end is None else f"{end:.4g}" for end in row["profile"])  # fmt: skip
            lines.append(
                f"| {name} | {parameter} | {entry.verdict} | {entry.sd_here:.4g} | {actual:.4g} | {ratio:.3f} | "
                f"{inner:.3f} | "
                f"{row['bias']:+.2f} | {row['claimed_sd']:.4g} | {100 * edge:.0f} % | {profile} | "
                f"{'' if row['within'] is None else 'yes' if row['within'] else 'no'} |"
            )
    return lines, data


def _natural(space: ParameterSpace, truth: Array, k: int, limit: float) -> float | None:
    if not np.isfinite(limit):
        return None
    unit = space.to_unit(truth)
    unit[k] = limit
    return float(space.from_unit(unit)[k])


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--campaigns", type=int, default=200, help="of every procedure")
    parser.add_argument("--procedures", type=int, default=len(PROCEDURES), help="only the first so many")
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--work", type=Path, default=ROOT / "runs" / "predicted_spread")
    parser.add_argument("--out", type=Path, default=ROOT / "reports" / "predicted_spread")
    arguments = parser.parse_args()
    arguments.work.mkdir(parents=True, exist_ok=True)
    plan = rig()
    predicted, truth = predict(plan)
    clean = run_plan(plan.model_copy(update={"noise": {}}))
    results: dict[str, list[dict]] = {}
    calibrated: dict[int, list[Calibration]] = {}
    for name in list(PROCEDURES)[: arguments.procedures]:
        results[name] = simulate(
            name, arguments.campaigns, arguments.seed, arguments.work, clean, plan, truth, calibrated
        )
        lines, _ = table(predicted, {name: results[name]}, truth)
        print("\n".join(lines[2:]), flush=True)
    lines, data = table(predicted, results, truth)
    counted = [row for row in data if row["within"] is not None]
    good = sum(row["within"] for row in counted)
    cpu = sum(row["cpu_seconds"] for rows in results.values() for row in rows)
    command = f"predicted_spread.py --campaigns {arguments.campaigns} --seed {arguments.seed}"
    note = (
        f"{cpu:.0f} s of processor time. The standard error of an actual standard deviation is "
        f"{100 / np.sqrt(2 * (arguments.campaigns - 1)):.1f} %. Claimed: median of the standard deviations that the "
        "estimates themselves state. Inner: half the width of the central 68.3 % of the estimates, which a few "
        "outliers do not move. SI units."
    )
    part = "" if len(results) == len(PROCEDURES) else f" --procedures {len(results)}"
    text = "\n".join([
        *header("Predicted and actual spread", __doc__, command + part, note),
        f"Of {len(counted)} standard deviations with the verdict 'identifiable', {good} are within "
        f"{100 * WITHIN:.0f} % of the actual ones.",
        "",
        *(
            f"{row['procedure']}, {row['parameter']}: the farthest of the estimates lies "
            f"{abs(row['farthest']) / row['predicted_sd']:.1f} predicted sd from the truth; without it, "
            f"actual over predicted is {row['ratio_without_farthest']:.3f}.\n"
            for row in counted
            if not row["within"]
        ),
        *lines,
        "",
        versions(),
        "",
    ])  # fmt: skip
    arguments.out.mkdir(parents=True, exist_ok=True)
    (arguments.out / "README.md").write_text(text, encoding="utf-8")
    (arguments.out / "rows.json").write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
