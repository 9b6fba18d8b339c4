"""The CEC 2013 niching benchmark: all twenty functions, with the official budgets, accuracies and count of optima.

Li, Engelbrecht and Epitropakis, "Benchmark functions for CEC'2013 special session and competition on niching methods
for multimodal function optimization", RMIT University 2013. Functions 11 to 20 need the package ``ioh``. Every run is
kept in ``runs.jsonl`` when it is done, so that an interrupted study resumes where it was; a run of other code is none.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, replace
from multiprocessing import get_context
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

import mofit
from benchmarks import peers as competitors
from benchmarks.cec2013_functions import FUNCTIONS, Niching, found_optima
from benchmarks.rows import Absent, Row
from mofit._typing import FloatArray
from mofit.optimize.global_search import SearchResult
from mofit.optimize.searches import effa, mlsl
from studies.report_page import versions

ACCURACIES = (1e-1, 1e-2, 1e-3, 1e-4, 1e-5)
#: Of a search's minima, those whose value is so close to its best are reported as global.
GLOBAL = 1e-4
#: Steps to which minima are polished: for the tightest accuracy.
POLISHED = 1e-7
#: Runs of a peer, and of any on a function that takes minutes.
FEW = 3
#: Where the runs are kept.
RUNS = Path("reports/cec2013/runs.jsonl")


@dataclass(frozen=True)
class Entry:
    """A competitor and the most runs it gets."""

    name: str
    search: competitors.Search
    runs: int = 1000


def _effa(
    landscape: competitors.Landscape, dimension: int, budget: int, rng: np.random.Generator, _: int
) -> competitors.Answer:
    """The default search."""
    settings = effa.EffaSettings()
    completion = replace(settings.completion, evaluations=budget, final_tolerance=POLISHED)
    return _global(
        effa.search(landscape.value, landscape.gradient, dimension, rng, replace(settings, completion=completion))
    )


def _mlsl(
    landscape: competitors.Landscape, dimension: int, budget: int, rng: np.random.Generator, _: int
) -> competitors.Answer:
    """With its own stop rule."""
    settings = mlsl.MlslSettings(evaluations=budget, final_tolerance=POLISHED)
    return _global(mlsl.search(landscape.value, landscape.gradient, dimension, rng, settings))


def _global(result: SearchResult) -> competitors.Answer:
    """The minima about as good as the best."""
    best = result.archived_cost <= result.archived_cost.min() + GLOBAL
    return competitors.Answer(result.archived_points[best], result.evaluations)


def _reported(search: competitors.Search) -> competitors.Search:
    """A peer of whose local minima those about as good as its best are reported, each once."""

    def run(landscape: competitors.Landscape, dimension: int, budget: int, rng: np.random.Generator, price: int) -> Any:
        answer = search(landscape, dimension, budget, rng, price)
        if len(answer.points) == 0:
            return answer
        cost = landscape.value(answer.points)[:, 0]
        kept: list[FloatArray] = []
        for k in np.argsort(cost, kind="stable"):
            if cost[k] > cost.min() + GLOBAL:
                break
            if all(np.linalg.norm(answer.points[k] - other) > 1e-3 for other in kept):
                kept.append(answer.points[k])
        return competitors.Answer(np.array(kept), answer.spent)

    return run


ENTRIES = (
    Entry("effa", _effa),
    Entry("mlsl", _mlsl, FEW),
    Entry("multi-start L-BFGS-B, Sobol", _reported(competitors.multi_start), FEW),
    Entry("shgo, Sobol", _reported(competitors.shgo), FEW),
    Entry("NicheGA (pymoo)", competitors.niche_ga, FEW),
    Entry("Omni-optimizer (pymoo)", competitors.omni, FEW),
)

#: Mean peak ratio over all functions and accuracies as published, rescored with the official code.
PUBLISHED = {"RS-CMSA-ESII (published)": 0.906, "HillVallEA19 (published)": 0.892}

NOTES = {
    "published": "peak ratio 1.000 on functions 1 to 7 and 10 at all accuracies",
    "reported": f"minima within {GLOBAL:g} of the best; a gradient counts as one evaluation",
    "F1": "harmonic mean of peak ratio and of the share of reported points that are distinct global optima",
}


def run(
    runs: int = 50,
    seed: int = 0,
    jobs: int = 1,
    peers: int = FEW,
    functions: Sequence[Niching] = FUNCTIONS,
    entries: Sequence[Entry] = ENTRIES,
    kept: Path = RUNS,
) -> tuple[list[Row], dict[str, Any]]:
    """All competitors on all functions.

    Parameters
    ----------
    runs
        Of the default search on each function; the others do fewer.
    seed
        Of all runs; results do not depend on ``jobs``.
    jobs
        Processes.
    peers
        Runs of the others at most; with 0 they are left out.
    functions, entries
        Which of the functions and competitors.
    kept
        JSON lines, one per run: what is there with this seed is not run again.

    Returns
    -------
    rows
        One per competitor over all functions, beside the published ones, then one per function and competitor: means
        of evaluations, seconds, peak ratio and F1 at each accuracy.
    settings
        What they were run with.
    """
    code = _code()
    limited = [replace(entry, runs=min(entry.runs, runs if entry.runs > FEW else peers)) for entry in entries]
    entries = [entry for entry in limited if entry.runs]
    wanted = [
        {"function": function.number, "search": entry.name, "run": number, "seed": seed, "code": code}
        for number in range(runs)  # what is there of an unfinished study is as many runs of every function
        for function in sorted(functions, key=lambda function: function.budget)  # the quick ones first
        for entry in entries
        if number < entry.runs
    ]
    done = _kept(kept, code)
    missing = [head for head in wanted if _key(head) not in done]
    kept.parent.mkdir(parents=True, exist_ok=True)
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool, kept.open("a", encoding="utf-8") as file:
        for future in as_completed([pool.submit(_single, head) for head in missing]):
            row = future.result()
            done[_key(row)] = row
            if "skipped" not in row:
                file.write(json.dumps(row) + "\n")
                file.flush()
    rows = [done[_key(head)] for head in wanted]
    per_function = [
        _means({"function": _label(function), "search": entry.name}, _chosen(rows, function, entry))
        for function in functions
        for entry in entries
    ]
    overall = [_overall(entry, [row for row in per_function if row["search"] == entry.name]) for entry in entries]
    published = [
        {"function": "mean of all", "search": name, "functions": len(FUNCTIONS), "mean PR": ratio}
        for name, ratio in PUBLISHED.items()
    ]
    settings = {"runs": runs, "seed": seed, "peers": peers, **versions("numpy", "scipy", "casadi", "ioh"), **NOTES}
    return overall + published + per_function, settings


def _code() -> str:
    """Short hash of what the runs depend on: the searches and the functions; one objective has no front."""
    folder = Path(mofit.__file__).parent / "optimize"
    searches = [file for file in sorted(folder.rglob("*.py")) if file.name != "pareto_front.py"]
    files = [*searches, Path(__file__).with_name("cec2013_functions.py")]
    return hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()[:12]


def _key(row: Row) -> tuple[int, str, int, int]:
    return row["function"], row["search"], row["run"], row["seed"]


def _kept(file: Path, code: str) -> dict[tuple[int, str, int, int], Row]:
    """Runs of this code by key; others, and an incomplete last line, are cut off the file."""
    if not file.exists():
        return {}
    lines = [line for line in file.read_text(encoding="utf-8").splitlines(keepends=True) if line.endswith("\n")]
    rows = [row for row in map(json.loads, lines) if row["code"] == code]
    file.write_text("".join(json.dumps(row) + "\n" for row in rows), encoding="utf-8")
    return {_key(row): row for row in rows}


def _chosen(rows: Sequence[Row], function: Niching, entry: Entry) -> list[Row]:
    return [row for row in rows if row["function"] == function.number and row["search"] == entry.name]


def _label(function: Niching) -> str:
    return f"{function.number} {function.name}"


def _single(head: Row) -> Row:
    """One run: evaluations, seconds, peak ratio and F1 at every accuracy."""
    problem = next(function for function in FUNCTIONS if function.number == head["function"])
    entry = next(entry for entry in ENTRIES if entry.name == head["search"])
    rng = np.random.default_rng([head["seed"], problem.number, head["run"]])
    try:
        problem.value(np.full((1, problem.dimension), 0.5))  # compiles it, which is no part of the time
        begin = perf_counter()
        answer = entry.search(problem, problem.dimension, problem.budget, rng, 1)
    except Absent as reason:
        return {**head, "skipped": str(reason)}
    scores: Row = {**head, "evaluations": answer.spent, "seconds": round(perf_counter() - begin, 2)}
    for accuracy in ACCURACIES:
        count = found_optima(problem, answer.points, accuracy)
        recall, precision = count / problem.optima, count / max(len(answer.points), 1)
        scores[f"PR {accuracy:g}"] = recall
        scores[f"F1 {accuracy:g}"] = 2 * recall * precision / (recall + precision) if count else 0.0
    return scores


def _means(head: Row, rows: Sequence[Row]) -> Row:
    """Means over the runs of one competitor on one function."""
    skipped = next((row["skipped"] for row in rows if "skipped" in row), None)
    if skipped is not None:
        return {**head, "skipped": skipped}
    measures = ["evaluations", "seconds", *(f"{name} {a:g}" for name in ("PR", "F1") for a in ACCURACIES)]
    return {**head, "runs": len(rows), **{key: float(np.mean([row[key] for row in rows])) for key in measures}}


def _overall(entry: Entry, rows: Sequence[Row]) -> Row:
    """Means over the functions that could be run."""
    head = {"function": "mean of all", "search": entry.name}
    run = [row for row in rows if "skipped" not in row]
    if not run:
        return head
    means = {key: float(np.mean([row[key] for row in run])) for key in run[0] if key[:2] in ("PR", "F1")}
    mean = float(np.mean([means[f"PR {a:g}"] for a in ACCURACIES]))
    return {**head, "functions": len(run), "mean PR": mean, **means}
