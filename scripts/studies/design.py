"""Do designed tests keep what they promise? Writes reports/design/README.md.

    python scripts/studies/design.py [--repeats 200] [--jobs 1] [--work FOLDER]

Simulated campaigns of the paper's test plan with the parameters of its Table 5 (data/plans/paper.toml without its
hidden effect), each with noise of its own. Every one is estimated as `mofit identify` does: calibration stages first,
then all parameters together with the stages as prior, refined from the truth. Actual standard deviations are those
of the estimates; in brackets their 95 % interval.

(a) One more test that takes as long as the nine sines together, chosen by `mofit design` for d_M: the standard
deviation of d_M with it and without. (b) A test plan designed for d_y, c_M and d_M (D-optimal) on top of the
calibration tests alone, against 1,000 random test plans of the same duration from the same space of tests of 20 and
40 s: ranked by the predicted criterion, the best of them simulated as often as the designed one. Rows that the work
folder holds already are kept.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np

from design_repeats import DYNAMIC, SEED, simulated
from mofit._typing import FloatArray
from mofit.experimental_design.design_job import DesignJob, Proposal, design_file
from mofit.experimental_design.optimal_design import SETTINGS, DesignEvaluation
from mofit.experimental_design.prepare import Inputs
from mofit.simulation.virtual_rig.plan import Plan, plan_text, read_plan
from report_page import ROOT, header, made_with, write_page

RANDOM, SIMULATED = 1000, 3
BUDGET_B = 300.0
#: Short tests, so that a test plan has several: where the best is one long test, random plans find it, too.
SPACE_B = """
overhead = "10 s"

[limits]
amplitude = "4 deg"
rate = "50.3 deg/s"

[defaults]
sample_rate = "100 Hz"
amplitude = ["1 deg", "2 deg", "4 deg"]
duration = ["20 s", "40 s"]

[[tests]]
kind = "sine"
frequency = { from = "0.1 Hz", to = "8 Hz", count = 16 }

[[tests]]
kind = "multisine"
frequency = ["0.1 Hz", "0.2 Hz", "0.4 Hz", "0.8 Hz"]
lines = [[1, 2, 3, 4, 5], [1, 3, 9]]

[[tests]]
kind = "chirp"
frequency = ["0.1 Hz", "0.3 Hz"]
last_frequency = ["2 Hz", "6 Hz"]
"""


def base_plan() -> Plan:
    """The paper's test plan with nothing hidden."""
    return read_plan(ROOT / "data" / "plans" / "paper.toml").model_copy(update={"effects": ()})


def proposal(work: Path, plan: Plan, jobs: int, **wanted: object) -> Proposal:
    """What `mofit design` proposes for a plan."""
    path = work / "plan.toml"
    path.write_text(plan_text(plan), encoding="utf-8")
    inputs = Inputs((path,), samples=8, seed=SEED, jobs=jobs)
    return design_file(DesignJob(inputs, **wanted))  # type: ignore[arg-type]


def interval(statistic, values: FloatArray) -> str:  # type: ignore[no-untyped-def]
    """A statistic of the repeats with its bootstrap interval."""
    rng = np.random.default_rng(SEED)
    drawn = [statistic(values[rng.integers(len(values), size=len(values))]) for _ in range(2000)]
    low, high = np.quantile(drawn, (0.025, 0.975))
    return f"{statistic(values):.4g} ({low:.4g} … {high:.4g})"


def part_a(arguments: argparse.Namespace) -> list[str]:
    """One test more."""
    plan = base_plan()
    sines = [test for test in plan.tests if test.kind == "sine"]
    total = sum(test.periods / float(str(test.frequency).split()[0]) for test in sines)  # type: ignore[operator]
    begun = time.process_time()
    found = proposal(arguments.work, plan, arguments.jobs, parameters=("d_M",), budget=total + 30.0)
    took = time.process_time() - begun
    extra = found.plan.tests
    names = [test.name for test in sines]
    both = plan.model_copy(update={"tests": (*plan.tests, *extra)})
    values = simulated(arguments, both, "a", [names, [*names, *(test.name for test in extra)]])
    own = found.design
    place = own.known.source.space.index("d_M")
    predicted = [float((each.sd * own.known.derivative)[0, place]) for each in (own.before, own.after)]

    def sd(v: FloatArray) -> float:
        return float(np.std(v, ddof=1))

    def ratio(v: FloatArray) -> float:
        return sd(v[:, 1]) / sd(v[:, 0])

    d_M = values[..., 2]
    lines = [
        "## (a) One more test for d_M",
        "",
        f"The nine sines take {total:.1f} s. Proposed: `{', '.join(test.name for test in extra)}`; "
        f"the design over {len(own.candidates)} candidates took {took:.1f} s of processor time.",
        "",
        "| tests | predicted sd of d_M (N s/m) | actual sd (N s/m) | mean (true: 7535) |",
        "|---|---|---|---|",
        f"| nine sines | {predicted[0]:.4g} | {interval(sd, d_M[:, 0])} | {np.mean(d_M[:, 0]):.5g} |",
        f"| and the proposed one | {predicted[1]:.4g} | {interval(sd, d_M[:, 1])} | {np.mean(d_M[:, 1]):.5g} |",
        "",
        f"Ratio of the actual standard deviations: {interval(ratio, d_M)}; predicted "
        f"{predicted[1] / predicted[0]:.3f}.",
    ]
    return lines


def random_designs(seconds: FloatArray, budget: float) -> list[tuple[int, ...]]:
    """Designs filled with tests drawn at random as long as one fits."""
    rng = np.random.default_rng(SEED)
    found = []
    for _ in range(RANDOM):
        members: list[int] = []
        left = budget
        while np.any(seconds <= left):
            members.append(int(rng.choice(np.flatnonzero(seconds <= left))))
            left -= seconds[members[-1]]
        found.append(tuple(sorted(members)))
    return found


def part_b(arguments: argparse.Namespace) -> list[str]:
    """The design against random test plans."""
    plan = base_plan()
    space = arguments.work / "space.toml"
    space.write_text(SPACE_B, encoding="utf-8")
    wanted = {"space": space, "parameters": DYNAMIC, "criterion": "D", "budget": BUDGET_B, "ignore_existing": True}
    found = proposal(arguments.work, plan, arguments.jobs, **wanted)
    own = found.design
    usable = [candidate for candidate in own.candidates if not candidate.infeasible]
    evaluation = DesignEvaluation(own.known, own.criterion, ignore_existing=True, jobs=arguments.jobs)
    information = evaluation.information(usable, SETTINGS.periods)
    pool = evaluation.pool(information, np.array([candidate.seconds for candidate in usable]))
    drawn = random_designs(pool.seconds, BUDGET_B)
    values = np.array([pool.value(members) for members in drawn])
    order = np.argsort(values)
    designs = [[candidate for candidate, times in own.tests for _ in range(times)]]
    designs += [[usable[i] for i in drawn[k]] for k in order[:SIMULATED]]
    calibration = [test for test in plan.tests if test.kind != "sine"]
    lines = [
        "## (b) A designed test plan against 1,000 random ones",
        "",
        f"{BUDGET_B:.0f} s, 10 s of pause per test included; {len(usable)} candidates. The criterion is the mean "
        "radius of the confidence ellipsoid of d_y, c_M and d_M relative to their values, in %.",
        "",
        f"Predicted criterion of the random test plans: best {100 * np.exp(values.min() / 2):.3f}, median "
        f"{100 * np.exp(np.median(values) / 2):.3f}, worst {100 * np.exp(values.max() / 2):.3f}; of the designed one "
        f"{100 * own.value_after:.3f}.",
        "",
        "| test plan | tests | predicted | actual | actual sd d_y | c_M | d_M |",
        "|---|---|---|---|---|---|---|",
    ]
    truth = np.array([281.0, 19910.0, 7535.0])

    def radius(v: FloatArray) -> float:
        return float(100 * np.linalg.det(np.cov((v / truth).T)) ** (1 / 6))

    for number, design in enumerate(designs):
        tests = [t.plan.model_copy(update={"name": f"t{k}_{t.name}"}) for k, t in enumerate(design)]
        whole = plan.model_copy(update={"tests": (*calibration, *tests)})
        v = simulated(arguments, whole, f"b{number}", [[test.name for test in tests]])[:, 0]
        predicted = own.value_after if number == 0 else np.exp(values[order[number - 1]] / 2)
        sds = " | ".join(f"{s:.4g}" for s in np.std(v, axis=0, ddof=1))
        label = "**designed**" if number == 0 else f"random, place {number}"
        names = ", ".join(t.name for t in design)
        lines.append(f"| {label} | {names} | {100 * predicted:.3f} | {interval(radius, v)} | {sds} |")
    return lines


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--repeats", type=int, default=200)
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--work", type=Path, default=ROOT / "runs" / "design")
    arguments = parser.parse_args()
    arguments.work.mkdir(parents=True, exist_ok=True)
    command = f"design.py --repeats {arguments.repeats}"
    head = header("Designed tests, predicted and actual", __doc__, command, f"Seed {SEED}.")
    lines: list[str] = []
    for part in (part_a, part_b):
        lines += [*part(arguments), ""]
        write_page("design", [*head, *lines, made_with()])  # after each part: the second may fail


if __name__ == "__main__":
    main()
