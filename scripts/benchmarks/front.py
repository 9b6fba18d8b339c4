"""The Pareto front of the bundled campaign: mofit's searches beside NSGA-III with ten times their evaluations."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.rows import Absent, imported
from mofit._typing import FloatArray
from mofit.data import bundled_campaign, read_campaign
from mofit.identification.problem_setup import set_up_problem
from mofit.identification.search_registry import find_search, search_descriptions
from mofit.identification.settings import Settings
from mofit.models import find_model
from mofit.optimize.pareto_front import hypervolume, nondominated
from mofit.optimize.searches import effa
from mofit.optimize.searches.effa import EffaSettings
from mofit.problem import Problem
from studies.report_page import versions

#: Budget of the comparison at equal cost, and how many times that NSGA-III gets.
FEW, TIMES = 600, 10
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
    fronts: dict[str, list[FloatArray]] = {}
    evaluations: dict[str, int] = {}
    skipped = []
    for number in range(seed, seed + runs):
        rng, dimension = np.random.default_rng(number), len(problem.space)
        found = {
            name: find_search(name)(problem.objectives, problem.gradients, dimension, rng).objectives
            for name in search_descriptions()
        }
        few = replace(EffaSettings(), completion=replace(EffaSettings().completion, evaluations=FEW))
        fewer = effa.search(problem.objectives, problem.gradients, dimension, np.random.default_rng(number), few)
        found = {f"effa, {FEW} evaluations": fewer.objectives, **found}
        try:
            found |= _nsga(problem, TIMES * FEW, number)
        except Absent as reason:
            skipped = [{"search": "NSGA-III (pymoo)", "skipped": str(reason)}]
        for name, objectives in found.items():
            fronts.setdefault(name, []).append(objectives)
            evaluations[name] = len(objectives)
    evaluations |= {name: TIMES * FEW for name in fronts if name.startswith("NSGA")}
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
    return set_up_problem(model, campaign, settings).searched


def _nsga(problem: Problem, budget: int, seed: int) -> dict[str, FloatArray]:
    """NSGA-III: the front it reports, and the front of all points that it evaluated."""
    base = imported("pymoo.core.problem").Problem
    nsga3 = imported("pymoo.algorithms.moo.nsga3").NSGA3
    directions = imported("pymoo.util.ref_dirs").get_reference_directions
    minimise = imported("pymoo.optimize").minimize
    seen: list[FloatArray] = []

    def evaluate(_: Any, x: FloatArray, out: dict[str, Any], *__: Any, **___: Any) -> None:
        out["F"] = problem.objectives(x)
        seen.append(out["F"])

    task = type("Task", (base,), {"_evaluate": evaluate})
    count = len(problem.tests)
    algorithm = nsga3(pop_size=100, ref_dirs=directions("energy", count, 100, seed=1))
    found = minimise(
        task(n_var=len(problem.space), n_obj=count, xl=0.0, xu=1.0), algorithm, ("n_eval", budget), seed=seed
    )
    return {"NSGA-III (pymoo), its front": np.atleast_2d(found.F), "NSGA-III, all it evaluated": np.vstack(seen)}
