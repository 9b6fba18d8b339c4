"""Do designed tests keep what they promise? Writes reports/design/README.md.

    python scripts/design_study.py [--repeats 200] [--jobs 1] [--work FOLDER]

Simulated campaigns of the paper's programme with the parameters of its Table 5 (data/plans/paper.toml without its
hidden effect), each with noise of its own. Every one is estimated as `mofit identify` does: calibration stages first,
then all parameters together with what the stages know, refined from the truth. Actual standard deviations are those of
the estimates; in brackets their 95 % interval.

(a) One more test that takes as long as the nine sines together, chosen by `mofit design` for d_M: the spread of d_M
with it and without. (b) A programme designed for d_y, c_M and d_M (D-optimal) on top of the calibration tests alone,
against 1,000 random programmes of the same duration from the same space of tests of 20 and 40 s: ranked by the
predicted criterion, the best of them simulated as often as the designed one. Rows that the work folder holds already
are kept.
"""

from __future__ import annotations

import argparse
import json
import platform
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import cache, partial
from importlib.metadata import version
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mofit.calibration import calibrate
from mofit.campaign import Campaign
from mofit.identifiability.design import PERIODS, Frame
from mofit.identifiability.design_files import DesignJob, Proposal, design_file
from mofit.kernel import Simulator
from mofit.kernel.steps import RK4
from mofit.library import find_model
from mofit.model import Model
from mofit.parameters import ParameterSpace
from mofit.posing import main_problem
from mofit.problem import Problem
from mofit.refine import merge, refine
from mofit.settings import Settings
from mofit.simulate import Plan, read_plan, run_plan
from mofit.simulate.noise import noise
from mofit.simulate.plan_text import plan_text
from mofit.simulate.setup import set_up
from mofit.spread import spread_problem

Array = NDArray[np.float64]

ROOT = Path(__file__).resolve().parents[1]
DYNAMIC = ("d_y", "c_M", "d_M")
RANDOM, SIMULATED = 1000, 3
BUDGET_B = 300.0
#: Short tests, so that a programme has several: where the best is one long test, random programmes find it, too.
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
SEED = 5
#: Repeats per row of the work folder.
CHUNK = 10


def base_plan() -> Plan:
    """The paper's programme with nothing hidden."""
    return read_plan(ROOT / "data" / "plans" / "paper.toml").model_copy(update={"effects": ()})


def proposal(work: Path, plan: Plan, jobs: int, **wanted: object) -> Proposal:
    """What `mofit design` proposes for a plan."""
    path = work / "plan.toml"
    path.write_text(plan_text(plan), encoding="utf-8")
    job = DesignJob(file=path, seed=SEED, jobs=jobs, **wanted)  # type: ignore[arg-type]
    return design_file(job, lambda what: find_model(what.model), lambda what: what.model)


@cache
def clean(text: str) -> tuple[Campaign, dict[str, dict[str, float]], dict[str, float]]:
    """The campaign of a plan without noise, the noise it should have, and the true values."""
    plan = Plan.model_validate_json(text)
    setup = set_up(plan, "plan")
    return run_plan(plan.model_copy(update={"noise": {}})), dict(setup.noise), dict(setup.values)


def noisy(text: str, seed: int) -> Campaign:
    """The same with noise."""
    campaign, settings, _ = clean(text)
    rng = np.random.default_rng([SEED, seed])
    measurements = tuple(
        replace(m, outputs={name: y + noise(y, rng, **settings[name]) for name, y in m.outputs.items()})
        for m in campaign.measurements
    )
    return replace(campaign, measurements=measurements)


def estimates(
    campaign: Campaign, model: Model, truth: dict[str, float], choices: list[list[str]], steps: list[int | None]
) -> list[list[float]]:
    """Estimates of the dynamic parameters from each choice of tests, beside the same calibration tests.

    ``steps`` per choice are found with the first campaign and kept for the others.
    """
    settings = Settings(jobs=1, seed=SEED)
    space = ParameterSpace(model.parameters)
    stages, _ = calibrate(model, campaign, space, seed=SEED, jobs=1)
    start = space.to_unit(np.array([truth[name] for name in space.names]))[None]
    found = []
    for place, tests in enumerate(choices):
        problem = main_problem(model, campaign.select(tests), space, stages, settings)
        local, steps[place] = local_problem(problem, start, steps[place])
        first = merge(refine(local.evaluate, start))[0].point
        counted = local.with_noise_at(first)
        point = merge(refine(counted.evaluate, first[None]))[0].point
        # as sampled: the likelihood as wide as the noise asks, so that the priors of the stages weigh in rightly
        wide = spread_problem(counted, point)
        moved = merge(refine(wide.evaluate, point[None]))[0].point
        values = space.from_unit(moved)
        found.append([float(values[space.index(name)]) for name in DYNAMIC])
    return found


def local_problem(problem: Problem, start: Array, steps: int | None) -> tuple[Problem, int | None]:
    """Integrated for the neighbourhood of the truth; the number of steps that its rule asks for, all repeats share."""
    if steps is not None:
        return replace(
            problem, simulator=Simulator(problem.system, problem.drives, problem.space.names, steps=steps)
        ), steps
    near = problem.near(start, np.full(len(start[0]), 0.01))
    rungs = [rung for rule in near.simulator.rules for rung in rule.rungs if rung.scheme is RK4]
    return near, max((rung.steps for rung in rungs), default=None)


def rows(work: Path, text: str, label: str, choices: list[list[str]], first: int) -> list[list[list[float]]]:
    """Estimates of `CHUNK` repeats, (repeat, choice, parameter); kept in the work folder."""
    path = work / f"{label}-{first}.json"
    if path.exists():
        kept = json.loads(path.read_text())
        if kept["plan"] == text and kept["choices"] == choices:
            return kept["estimates"]
    _, _, truth = clean(text)
    model = find_model("maxwell_tyre")
    steps: list[int | None] = [None] * len(choices)
    found = [estimates(noisy(text, seed), model, truth, choices, steps) for seed in range(first, first + CHUNK)]
    path.write_text(json.dumps({"plan": text, "choices": choices, "estimates": found}))
    return found


def simulated(arguments: argparse.Namespace, plan: Plan, label: str, choices: list[list[str]]) -> Array:
    """Estimates (repeats, choices, 3)."""
    starts = range(0, arguments.repeats, CHUNK)
    task = partial(rows, arguments.work, plan.model_dump_json(), label, choices)
    if arguments.jobs == 1:
        return np.concatenate([np.array(task(first)) for first in starts])
    with ProcessPoolExecutor(arguments.jobs) as pool:
        return np.concatenate([np.array(found) for found in pool.map(task, starts)])


def interval(statistic, values: Array) -> str:  # type: ignore[no-untyped-def]
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
    told = found.design
    place = told.told.source.space.index("d_M")
    predicted = [float((spread.sd * told.told.stretch)[0, place]) for spread in (told.before, told.after)]

    def sd(v: Array) -> float:
        return float(np.std(v, ddof=1))

    def ratio(v: Array) -> float:
        return sd(v[:, 1]) / sd(v[:, 0])

    d_M = values[..., 2]
    lines = [
        "## (a) One more test for d_M",
        "",
        f"The nine sines take {total:.1f} s. Proposed: `{', '.join(test.name for test in extra)}`; "
        f"the design over {len(told.candidates)} candidates took {took:.1f} s of processor time.",
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


def random_programmes(seconds: Array, budget: float) -> list[tuple[int, ...]]:
    """Programmes filled with tests drawn at random as long as one fits."""
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
    """The design against random programmes."""
    plan = base_plan()
    space = arguments.work / "space.toml"
    space.write_text(SPACE_B, encoding="utf-8")
    wanted = {"space": space, "parameters": DYNAMIC, "criterion": "D", "budget": BUDGET_B, "fresh": True}
    found = proposal(arguments.work, plan, arguments.jobs, **wanted)
    told = found.design
    usable = [candidate for candidate in told.candidates if not candidate.refused]
    frame = Frame.of(told.told, told.goal, fresh=True)
    asked = frame.ask(usable, arguments.jobs, PERIODS)
    pool = frame.pool(asked, np.array([candidate.seconds for candidate in usable]))
    drawn = random_programmes(pool.seconds, BUDGET_B)
    values = np.array([pool.value(members) for members in drawn])
    order = np.argsort(values)
    programmes = [[candidate for candidate, times in told.programme for _ in range(times)]]
    programmes += [[usable[i] for i in drawn[k]] for k in order[:SIMULATED]]
    calibration = [test for test in plan.tests if test.kind != "sine"]
    lines = [
        "## (b) A designed programme against 1,000 random ones",
        "",
        f"{BUDGET_B:.0f} s, 10 s of pause per test included; {len(usable)} candidates. The criterion is the mean "
        "radius of the confidence ellipsoid of d_y, c_M and d_M relative to their values, in %.",
        "",
        f"Predicted criterion of the random programmes: best {100 * np.exp(values.min() / 2):.3f}, median "
        f"{100 * np.exp(np.median(values) / 2):.3f}, worst {100 * np.exp(values.max() / 2):.3f}; of the designed one "
        f"{100 * told.value_after:.3f}.",
        "",
        "| programme | tests | predicted | actual | actual sd d_y | c_M | d_M |",
        "|---|---|---|---|---|---|---|",
    ]
    truth = np.array([281.0, 19910.0, 7535.0])

    def radius(v: Array) -> float:
        return float(100 * np.linalg.det(np.cov((v / truth).T)) ** (1 / 6))

    for number, programme in enumerate(programmes):
        tests = [t.plan.model_copy(update={"name": f"t{k}_{t.name}"}) for k, t in enumerate(programme)]
        own = plan.model_copy(update={"tests": (*calibration, *tests)})
        v = simulated(arguments, own, f"b{number}", [[test.name for test in tests]])[:, 0]
        predicted = told.value_after if number == 0 else np.exp(values[order[number - 1]] / 2)
        sds = " | ".join(f"{s:.4g}" for s in np.std(v, axis=0, ddof=1))
        label = "**designed**" if number == 0 else f"random, place {number}"
        names = ", ".join(t.name for t in programme)
        lines.append(f"| {label} | {names} | {100 * predicted:.3f} | {interval(radius, v)} | {sds} |")
    return lines


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--repeats", type=int, default=200)
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--work", type=Path, default=ROOT / "runs" / "design_study")
    arguments = parser.parse_args()
    arguments.work.mkdir(parents=True, exist_ok=True)
    libraries = ", ".join(f"{name} {version(name)}" for name in ("numpy", "scipy", "casadi", "llvmlite"))
    head = [
        "# Designed tests, predicted and actual",
        "",
        (__doc__ or "").partition("\n\n")[2].partition("\n\n")[2].strip(),
        "",
        f"Written by `python scripts/design_study.py --repeats {arguments.repeats}`; seed {SEED}.",
        "",
    ]
    target = ROOT / "reports" / "design"
    target.mkdir(parents=True, exist_ok=True)
    foot = ["", f"Python {platform.python_version()}, {libraries}.", ""]
    told: list[str] = []
    for part in (part_a, part_b):
        told += [*part(arguments), ""]
        # what is done is told, whatever comes of the rest
        text = "\n".join([*head, *told[:-1], *foot])
        (target / "README.md").write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
