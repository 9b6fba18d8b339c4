"""Which constants should the swarm of the default search have? Writes reports/swarm/README.md.

    python scripts/studies/swarm.py [--seeds 100] [--jobs 2] [--work FOLDER]

One setting is changed at a time; the first row has the defaults. *Rastrigin*: share of runs that find all minima on
[-2, 2]^2 with 700 evaluations, plain, and shifted and rotated at random; and the share of the minima to which the
clusters of the swarm alone led. *CEC 2013*: mean peak ratio of functions 1 to 5 and 10 at an accuracy of 1e-4 with
3,000 evaluations, a small part of the official budget (a fifth of the runs). *Bundled campaign*, 600 evaluations:
median hypervolume of the front after the whole search, relative to the box between the best and the worst point that
the defaults found with 4,000 evaluations in ten runs; of the points of the swarm alone; and the mean excess of the best
NRMSD per test, over the swarm's points, above the least one known. *Several modes*: share of runs in which search and
refinement find all modes of the campaigns of `several_modes.py` (exchange: a tenth of the runs). Rows that the work
folder holds already are kept.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import cache, partial
from pathlib import Path

import numpy as np

from mofit._typing import FloatArray
from mofit.data import bundled_campaign, read_campaign
from mofit.identification.problem_setup import set_up_problem
from mofit.identification.settings import Settings
from mofit.models import find_model
from mofit.optimize import SearchResult, merge, refine
from mofit.optimize.pareto_front import hypervolume, nondominated
from mofit.optimize.searches.effa import EffaSettings, search
from mofit.optimize.swarm import SwarmSettings
from mofit.parameters import ParameterSpace
from mofit.problem import Problem
from mofit.runtime.parallel import end_with_parent
from report_page import ROOT, header, made_with, table, write_page

sys.path.insert(0, str(ROOT / "scripts"))  # the functions of the benchmarks
from benchmarks.cec2013_functions import FUNCTIONS, found_optima
from benchmarks.rastrigin import STRICT, Rastrigin, found
from several_modes import CASES, STANDARD_DEVIATIONS, campaign

VARIANTS: dict[str, dict[str, float]] = {
    "defaults": {},
    **{f"fireflies {n}": {"most": n} for n in (16, 32)},
    **{f"moves {n}": {"moves": n} for n in (0, 1, 4)},
    **{f"candidates {n}": {"candidates": n} for n in (1, 2)},
    **{f"neighbours {x}": {"neighbours": x} for x in (0.7, 1.5)},
    **{f"alpha {x}": {"alpha": x} for x in (0.0, 1.0, 2.0)},
    "joint 0: none sees the mean": {"joint": 0.0},
    "joint 1: all see the mean": {"joint": 1.0},
}
RASTRIGIN_BUDGET, CEC_BUDGET, BUNDLED_BUDGET = 700, 3000, 600
CEC = (1, 2, 3, 4, 5, 10)
Row = dict[str, float]


def settings_of(variant: str, evaluations: int | None = None, final: float | None = None) -> EffaSettings:
    """The default search with one setting of the swarm changed."""
    default = EffaSettings()
    budget = default.completion.evaluations if evaluations is None else evaluations
    completion = replace(default.completion, evaluations=budget, final_tolerance=final)
    return EffaSettings(replace(default.swarm, **VARIANTS[variant]), completion)  # type: ignore[arg-type]


def rastrigin(variant: str, seed: int, *, turned: bool) -> Row:
    """All minima found, and the share of them to which the swarm led."""
    rng = np.random.default_rng([seed, turned])
    function = Rastrigin.turned(rng) if turned else Rastrigin.plain()
    result = search(function.value, function.gradient, 2, rng, settings_of(variant, RASTRIGIN_BUDGET))
    points, minima = function.scaled(result.archived_points), function.minima
    swarm = points[np.array(result.found_by) == "swarm"]
    name = "turned" if turned else "plain"
    return {
        f"{name}: all %": 100.0 * (found(points, minima, STRICT) == len(minima)),
        f"{name}: swarm %": 100.0 * found(swarm, minima, STRICT) / len(minima),
    }


def cec2013(variant: str, seed: int) -> Row:
    """Mean peak ratio of the quick functions."""
    ratios = []
    for number in CEC:
        function = FUNCTIONS[number - 1]
        rng = np.random.default_rng([seed, number])
        chosen = settings_of(variant, CEC_BUDGET, 1e-7)
        result = search(function.value, function.gradient, function.dimension, rng, chosen)
        ratios.append(found_optima(function, result.archived_points, 1e-4) / function.optima)
    return {"CEC: peak ratio": float(np.mean(ratios))}


@cache
def bundled() -> tuple[Problem, FloatArray, FloatArray, FloatArray]:
    """The problem, the corners of the box of its front, and the least NRMSD known of each test."""
    model, file = find_model("maxwell_tyre"), read_campaign(bundled_campaign())
    problem = set_up_problem(model, file, Settings(jobs=1)).searched
    values = np.vstack([_searched(problem, settings_of("defaults"), 1000 + k).objectives for k in range(10)])
    front = values[nondominated(values)]
    return problem, front.min(axis=0), front.max(axis=0), np.nanmin(values, axis=0)


def _searched(problem: Problem, settings: EffaSettings, seed: int) -> SearchResult:
    rng = np.random.default_rng(seed)
    return search(problem.objectives, problem.gradients, len(problem.space), rng, settings)


def front(variant: str, seed: int) -> Row:
    """Hypervolume of the whole search and of its swarm, and how near the swarm comes to the minima of single tests."""
    problem, ideal, worst, least = bundled()
    result = _searched(problem, settings_of(variant, BUNDLED_BUDGET), seed)
    flown = result.objectives[: int(result.generations.max()) + 1]
    return {
        "bundled: hypervolume": hypervolume(result.objectives, ideal, worst),
        "bundled: swarm's": hypervolume(flown, ideal, worst),
        "bundled: excess %": 100 * float(np.mean(np.nanmin(flown, axis=0) / least - 1)),
    }


def modes(variant: str, seed: int, *, case: str) -> Row:
    """Whether search and refinement find all modes."""
    model = CASES[case]()
    problem = set_up_problem(model, campaign(case, seed), Settings(jobs=1)).searched
    result = _searched(problem, settings_of(variant), seed)
    noisy = problem.with_noise_at(result.points[result.best])
    minima = merge(refine(noisy.evaluate, result.archived_points))
    space = ParameterSpace(model.parameters)
    near = []
    for truth in space.to_unit(np.array(model.truths)):
        gaps = [(one.point - truth) @ one.hessian @ (one.point - truth) for one in minima]
        near.append(min(gaps) < len(space) * STANDARD_DEVIATIONS**2)
    return {f"{case}: all %": 100.0 * all(near)}


#: Each problem, and the share of the seeds that it gets.
PROBLEMS: dict[str, tuple[Callable[[str, int], Row], float]] = {
    "plain": (partial(rastrigin, turned=False), 1.0),
    "turned": (partial(rastrigin, turned=True), 1.0),
    "cec2013": (cec2013, 0.2),
    "front": (front, 1.0),
    **{case: (partial(modes, case=case), 0.1 if case == "exchange" else 1.0) for case in CASES},
}


def block(work: Path, seeds: int, task: tuple[str, str]) -> Row:
    """Means of one variant on one problem; hypervolumes as medians."""
    variant, problem = task
    kept = work / f"{problem}-{variant.partition(':')[0].replace(' ', '_')}-{seeds}.json"
    if not kept.exists():
        run, share = PROBLEMS[problem]
        rows = [run(variant, seed) for seed in range(max(1, round(share * seeds)))]
        centre = {key: np.median if "hypervolume" in key or "swarm's" in key else np.mean for key in rows[0]}
        kept.write_text(json.dumps({key: float(centre[key]([row[key] for row in rows])) for key in rows[0]}))
    found: Row = json.loads(kept.read_text())
    return found


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--seeds", type=int, default=100)
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    parser.add_argument("--work", type=Path, default=ROOT / "runs" / "swarm")
    arguments = parser.parse_args()
    arguments.work.mkdir(parents=True, exist_ok=True)
    tasks = [(variant, problem) for problem in PROBLEMS for variant in VARIANTS]
    rows: dict[str, Row] = {variant: {} for variant in VARIANTS}
    with ProcessPoolExecutor(arguments.jobs, initializer=end_with_parent) as pool:
        results = pool.map(partial(block, arguments.work, arguments.seeds), tasks)
        for (variant, problem), row in zip(tasks, results, strict=True):
            print(variant, problem, row, flush=True)
            rows[variant] |= row
    columns = list(rows["defaults"])
    cells = [[variant, *(f"{row[column]:.4g}" for column in columns)] for variant, row in rows.items()]
    default = SwarmSettings()
    constants = ", ".join(f"{name} {getattr(default, name):.3g}" for name in vars(default))
    note = f"Defaults: {constants}."
    lines = [*header("Swarm", __doc__, f"swarm.py --seeds {arguments.seeds}", note), *table(["", *columns], cells)]
    write_page("swarm", [*lines, made_with()])


if __name__ == "__main__":
    main()
