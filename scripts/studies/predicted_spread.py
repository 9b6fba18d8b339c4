"""Do estimates scatter as `mofit compare` predicts? Writes reports/predicted_spread/README.md.

    python scripts/studies/predicted_spread.py [--campaigns 200] [--experiments 12] [--seed 7] [--work FOLDER]

The tyre of the paper's Table 5 is on a virtual rig (data/plans/paper.toml without its hidden effect: noise of 5 N
white and 2 N coloured, three steps and a quasi-static test for calibration). Experiments go from a single sine to all
nine, a chirp, a multisine and a step. Every campaign has noise of its own. Its parameters are estimated as `mofit
identify` does, without the search: calibration stages, refinement of all parameters from the truth and from starts
around it, independent residuals counted, refined again, and once more with the likelihood adjusted to the noise.
Predicted is what `mofit compare` reports at the true values, from the noise that the plan states. Rows that the work
folder holds already are kept.
"""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from mofit._typing import FloatArray
from mofit.data import Campaign, Measurement
from mofit.experimental_design.comparison import compare
from mofit.experimental_design.comparison_result import ExperimentSet, ParameterResult
from mofit.experimental_design.information import source_information
from mofit.experimental_design.sources import planned_source
from mofit.identification.calibration import Calibration, calibrate, calibrated_values
from mofit.identification.problem_setup import set_up_problem
from mofit.identification.settings import Settings
from mofit.models import find_model
from mofit.optimize import RefineSettings, merge, refine
from mofit.parameters import ParameterSpace
from mofit.problem import adjusted_posterior
from mofit.sampling import laplace_covariance
from mofit.simulation.virtual_rig.plan import Plan, TestPlan, read_plan
from mofit.simulation.virtual_rig.rig import run_plan
from mofit.simulation.virtual_rig.signals import noise
from report_page import ROOT, header, made_with, table, write_page

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
EXPERIMENTS = {
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
        measured.append(Measurement(test.experiment, {"lateral_force": force + error}, test.units))
    return replace(clean, measurements=tuple(measured))


def estimate(
    campaign: Campaign, tests: tuple[str, ...], stages: list[Calibration], truth: FloatArray, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
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
    problem = set_up_problem(model, campaign, settings, tests, done=stages).posterior.main
    local = problem.near(np.clip(starts, 0, 1), np.full(len(space), 0.01))
    first = merge(refine(local.evaluate, np.clip(starts, 0, 1)))
    counted = local.with_noise_at(first[0].point)
    found = merge(refine(counted.evaluate, np.stack([minimum.point for minimum in first])))[0]
    wide = adjusted_posterior(counted, found.point)
    (moved, *_) = merge(refine(wide.evaluate, found.point[None], RefineSettings(merge=None)))
    freedom = wide.adjustment.freedom  # the likelihood is Student-t: wider than its curvature at the top says
    precision = (1 - 2 / freedom) * wide.adjustment.precision + wide.problem.main.prior_density.precision
    claimed = np.sqrt(np.diag(laplace_covariance(precision)))
    values = space.from_unit(moved.point)
    return values, claimed * space.derivative(values)


def simulate(
    name: str,
    campaigns: int,
    seed: int,
    work: Path,
    clean: Campaign,
    plan: Plan,
    truth: FloatArray,
    calibrated: dict[int, list[Calibration]],
) -> list[dict]:
    """One row per campaign: the estimates. ``calibrated`` are those of the campaigns, which all experiments share."""
    path = work / f"{name.replace(' ', '_').replace(',', '')}-{seed}.jsonl"
    lines = path.read_text(encoding="utf-8").splitlines(keepends=True) if path.exists() else []
    rows = [json.loads(line) for line in lines if line.endswith("\n")]
    model = find_model("maxwell_tyre")
    space = ParameterSpace(model.parameters)
    tests = EXPERIMENTS[name]
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


def predict(plan: Plan) -> tuple[dict[str, dict[str, ParameterResult]], FloatArray]:
    """What compare gives at the truth, and the truth."""
    named = tuple(test for tests in EXPERIMENTS.values() for test in tests)
    calibration = tuple(t for t in plan.tests if t.name != "step_alone")
    found = {}
    for tests, chosen in (
        (calibration, lambda own: "step_alone" not in own),
        (plan.tests, lambda own: "step_alone" in own),
    ):
        names = {test.name for test in tests}
        source = planned_source("rig", plan.model_copy(update={"tests": tests}), find_model(plan.model),
                                tuple(name for name in named if name in names))  # fmt: skip
        experiments = [ExperimentSet(name, 0, own) for name, own in EXPERIMENTS.items() if chosen(own)]
        for row in compare([source_information(source, source.values[None])], experiments, PARAMETERS).experiments:
            found[row.experiment.name] = dict(row.parameters)
    return {name: found[name] for name in EXPERIMENTS}, source.values


def comparison(
    predicted: dict[str, dict[str, ParameterResult]], results: dict[str, list[dict]], truth: FloatArray
) -> tuple[list[str], list]:
    """Lines of Markdown, and the same as data."""
    space = ParameterSpace(find_model("maxwell_tyre").parameters)
    head = ["experiment", "parameter", "classification", "predicted sd", "actual sd", "actual / predicted",
            "inner / predicted", "bias / actual sd", "claimed sd", "estimates at a bound", "profile's 95 %",
            "within 15 %"]  # fmt: skip
    cells, data = [], []
    for name, rows in results.items():
        values = np.array([row["values"] for row in rows])
        claimed = np.array([row["claimed"] for row in rows])
        for parameter in PARAMETERS:
            entry, k = predicted[name][parameter], space.index(parameter)
            own = values[:, k]
            actual, ratio = float(own.std(ddof=1)), float(own.std(ddof=1) / entry.sd_at_values)
            far = int(np.argmax(np.abs(own - np.median(own))))
            inner = float(np.diff(np.quantile(own, [0.1587, 0.8413]))[0] / 2 / entry.sd_at_values)
            unit = space.to_unit(values)[:, k]
            edge = float(np.mean((unit < 1e-6) | (unit > 1 - 1e-6)))
            counted = entry.verdict == "identifiable"
            row = {
                "experiment": name, "parameter": parameter, "verdict": entry.verdict,
                "predicted_sd": entry.sd_at_values, "actual_sd": actual, "ratio": ratio, "inner_ratio": inner,
                "bias": float((own.mean() - truth[k]) / actual),
                "claimed_sd": float(np.median(claimed[:, k])), "at_bound": edge, "campaigns": len(rows),
                "profile": None if entry.profile is None else [
                    end if np.isfinite(end) else None for end in (entry.profile.low, entry.profile.high)
                ],
                "within": bool(abs(ratio - 1) <= WITHIN) if counted else None,
                "farthest": float(own[far] - truth[k]),
                "ratio_without_farthest": float(np.delete(own, far).std(ddof=1) / entry.sd_at_values),
            }  # fmt: skip
            data.append(row)
            profile = "" if entry.profile is None else " to ".join(
                "open" if end is None else f"{end:.4g}" for end in row["profile"])  # fmt: skip
            within = "" if row["within"] is None else "yes" if row["within"] else "no"
            numbers = (
                f"{entry.sd_at_values:.4g}",
                f"{actual:.4g}",
                f"{ratio:.3f}",
                f"{inner:.3f}",
                f"{row['bias']:+.2f}",
            )
            claim = (f"{row['claimed_sd']:.4g}", f"{100 * edge:.0f} %")
            cells.append([name, parameter, entry.verdict, *numbers, *claim, profile, within])
    return table(head, cells), data


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--campaigns", type=int, default=200, help="of every experiment")
    parser.add_argument("--experiments", type=int, default=len(EXPERIMENTS), help="only the first so many")
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--work", type=Path, default=ROOT / "runs" / "predicted_spread")
    arguments = parser.parse_args()
    arguments.work.mkdir(parents=True, exist_ok=True)
    plan = rig()
    predicted, truth = predict(plan)
    clean = run_plan(plan.model_copy(update={"noise": {}}))
    results: dict[str, list[dict]] = {}
    calibrated: dict[int, list[Calibration]] = {}
    for name in list(EXPERIMENTS)[: arguments.experiments]:
        results[name] = simulate(
            name, arguments.campaigns, arguments.seed, arguments.work, clean, plan, truth, calibrated
        )
        lines, _ = comparison(predicted, {name: results[name]}, truth)
        print("\n".join(lines[2:]), flush=True)
    lines, data = comparison(predicted, results, truth)
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
    part = "" if len(results) == len(EXPERIMENTS) else f" --experiments {len(results)}"
    outliers = [
        f"{row['experiment']}, {row['parameter']}: the farthest of the estimates lies "
        f"{abs(row['farthest']) / row['predicted_sd']:.1f} predicted sd from the truth; without it, "
        f"actual over predicted is {row['ratio_without_farthest']:.3f}.\n"
        for row in counted
        if not row["within"]
    ]
    summary = (
        f"Of {len(counted)} standard deviations classified as identifiable, {good} are within "
        f"{100 * WITHIN:.0f} % of the actual ones."
    )
    head = header("Predicted and actual spread", __doc__, command + part, note)
    write_page("predicted_spread", [*head, summary, "", *outliers, *lines, made_with()])
    (ROOT / "reports" / "predicted_spread" / "rows.json").write_text(json.dumps(data, indent=1) + "\n", "utf-8")


if __name__ == "__main__":
    main()
