"""The Pareto front of the bundled campaign: mofit's searches beside NSGA-III with ten times their evaluations."""

from __future__ import annotations

from importlib import import_module
from typing import Any

import numpy as np

from mofit.bench.competitors import Absent
from mofit.bench.versions import versions
from mofit.bundled import bundled_campaign
from mofit.calibration import calibrate
from mofit.campaign_file import read_campaign
from mofit.library import find_model
from mofit.parameters import Array
from mofit.posing import choose_tests, dynamic_problem
from mofit.problem import Problem
from mofit.search import PAPER, effa, hypervolume, niching, nondominated, surrogate
from mofit.settings import Settings, free_space

TIMES = 10
MODEL = "maxwell_tyre"


def run(runs: int = 10, seed: int = 0, jobs: int = 1) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """Hypervolume of the fronts, relative to the box between the best and the worst of the front of all of them.

    Parameters
    ----------
    runs
        Seeds.
    seed
        The first of them.
    jobs
        Threads.

    Returns
    -------
    rows
        One per search: median, least and greatest hypervolume.
    settings
        What they were run with.
    """
    problem = _bundled(jobs)
    fronts: dict[str, list[Array]] = {}
    evaluations: dict[str, int] = {}
    skipped = []
    for number in range(seed, seed + runs):
        rng = np.random.default_rng(number)
        found = {
            "niching": niching(problem.objectives, problem.gradients, len(problem.space), rng).objectives,
            "surrogate": surrogate(problem.objectives, len(problem.space), rng).objectives,
            "paper": effa(problem.objectives, len(problem.space), rng, PAPER).objectives,
        }
        try:
            found |= _nsga(problem, TIMES * len(found["niching"]), number)
        except Absent as reason:
            skipped = [{"search": "NSGA-III (pymoo)", "skipped": str(reason)}]
        for name, objectives in found.items():
            fronts.setdefault(name, []).append(objectives)
            evaluations[name] = len(objectives)
    evaluations |= {name: TIMES * evaluations["niching"] for name in fronts if name.startswith("NSGA")}
    everything = np.vstack([values for several in fronts.values() for values in several])
    best = everything[nondominated(everything)]
    ideal, worst = best.min(axis=0), best.max(axis=0)
    rows: list[dict[str, Any]] = []
    for name, several in fronts.items():
        volumes = [hypervolume(values, ideal, worst) for values in several]
        rows.append(
            {
                "search": name,
                "evaluations": evaluations[name],
                "hypervolume, median": float(np.median(volumes)),
                "least": float(np.min(volumes)),
                "greatest": float(np.max(volumes)),
                "points on the front": float(np.median([len(nondominated(values)) for values in several])),
            }
        )
    return [*rows, *skipped], {
        "campaign": "bundled", "model": MODEL, "objectives": len(problem.tests), "runs": runs, "seed": seed,
        **versions("numpy", "moocore"),
    }  # fmt: skip


def _bundled(jobs: int) -> Problem:
    """What the search of the main job sees."""
    campaign, model, settings = read_campaign(bundled_campaign()), find_model(MODEL), Settings(jobs=jobs)
    space = free_space(model, settings)
    calibrations, _ = calibrate(model, campaign, space, seed=0, jobs=jobs)
    return dynamic_problem(model, campaign.select(choose_tests(model, campaign, ())), space, calibrations, settings)


def _nsga(problem: Problem, budget: int, seed: int) -> dict[str, Array]:
    """NSGA-III: the front it reports, and the front of all points that it evaluated."""
    try:
        base = import_module("pymoo.core.problem").Problem
        nsga3 = import_module("pymoo.algorithms.moo.nsga3").NSGA3
        directions = import_module("pymoo.util.ref_dirs").get_reference_directions
        minimise = import_module("pymoo.optimize").minimize
    except ImportError:
        raise Absent("pymoo is not installed (extra 'bench')") from None
    seen: list[Array] = []

    def evaluate(_: Any, x: Array, out: dict[str, Any], *__: Any, **___: Any) -> None:
        out["F"] = problem.objectives(x)
        seen.append(out["F"])

    task = type("Task", (base,), {"_evaluate": evaluate})
    count = len(problem.tests)
    algorithm = nsga3(pop_size=100, ref_dirs=directions("energy", count, 100, seed=1))
    found = minimise(
        task(n_var=len(problem.space), n_obj=count, xl=0.0, xu=1.0), algorithm, ("n_eval", budget), seed=seed
    )
    return {"NSGA-III (pymoo), its front": np.atleast_2d(found.F), "NSGA-III, all it evaluated": np.vstack(seen)}
