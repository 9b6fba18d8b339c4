"""Tables 3 to 5 of Hackl et al. 2016 as published, and beside them what is found on the bundled campaign."""

from __future__ import annotations

import numpy as np
import xarray as xr

from mofit._typing import FloatArray
from mofit.optimize import SearchResult
from mofit.optimize.population_clusters import cluster
from mofit.optimize.searches import effa_2016
from mofit.problem import Problem
from report_page import table

NAMES, UNITS = ("d_y", "c_M", "d_M"), ("N s/m", "N/m", "N s/m")
#: The areas in which the paper searches: "a large range" (its Figure 9), and MA 1 (its Table 4).
WIDE, NARROW = (750.0, 6e4, 6e4), (750.0, 3e4, 1.5e4)
FIGURE_9 = (1.0, 2.0, 3.0, 4.0)
#: Two minima are distinct if they differ by this share of the box.
DISTINCT = 0.05

TABLE_3 = {"MA 1": (270, 18000, 6000), "MA 2": (300, 20000, 36000), "SA 1": (380, 22000, 19000),
           "SA 1 (second)": (290, 33000, 30000)}  # fmt: skip
#: Table 4: frequency [Hz] -> d_y [N s/m], c_M [N/m], d_M [N s/m] of three minima.
TABLE_4 = {
    0.25: ((218, 27057, 7194), (278, 14671, 11731), (225, 21154, 10659)),
    0.5: ((511, 20724, 9112), (230, 23894, 9457), (558, 26750, 6941)),
    1.0: ((333, 18740, 12367), (267, 19436, 11170), (310, 26151, 8023)),
    1.5: ((287, 19165, 10764), (484, 19771, 5666), (520, 14933, 6092)),
    2.0: ((260, 21560, 8484), (331, 20321, 8208), (579, 15564, 5519)),
    2.5: ((223, 20345, 4798), (244, 21075, 5905), (294, 17123, 7026)),
    3.0: ((133, 19879, 4490), (122, 20193, 5331), (181, 19689, 5263)),
    3.5: ((111, 17323, 6645), (227, 20206, 9690), (242, 20656, 6130)),
    4.0: ((143, 18373, 4539), (181, 18077, 4557), (85, 22752, 7382)),
}
TABLE_5 = {"Maxwell": (281, 19910, 7535), "Kelvin–Voigt": (332, None, None)}


def frequency(problem: Problem, test: str) -> float:
    """Of a sine test, Hz."""
    return float(problem.measurements[problem.tests.index(test)].experiment.frequency or np.nan)


def fly(problem: Problem, test: str, seed: int) -> SearchResult:
    """One run of the paper's algorithm on one test."""
    one = problem.select([test])
    return effa_2016.search(one.objectives, one.gradients, 3, np.random.default_rng([seed, problem.tests.index(test)]))


def best_distinct(points: FloatArray, cost: FloatArray, most: int = 3) -> list[int]:
    """Rows of the best points that lie apart."""
    kept: list[int] = []
    for row in np.argsort(cost, kind="stable"):
        if all(np.linalg.norm(points[row] - points[other]) > DISTINCT for other in kept):
            kept.append(int(row))
    return kept[:most]


def triple(values: tuple | FloatArray) -> str:
    """d_y, c_M, d_M."""
    return ", ".join("–" if value is None else f"{value:,.0f}" for value in values)


def areas(
    problem: Problem, kelvin: FloatArray, seed: int
) -> tuple[list[str], dict[float, tuple[FloatArray, FloatArray]]]:
    """Table 3 and what Figure 9 shows: swarms and stored bests that beat Kelvin–Voigt."""
    shown, everything = {}, []
    for test in problem.tests:
        if frequency(problem, test) not in FIGURE_9:
            continue
        result, limit = fly(problem, test, seed), kelvin[problem.tests.index(test)]
        swarm, stored = (rows[result.cost[rows] < limit] for rows in (result.population, result.archived))
        shown[frequency(problem, test)] = tuple(problem.space.from_unit(result.points[r]) for r in (swarm, stored))
        everything.append(result.points[np.unique([*swarm, *stored])])
    points = np.concatenate(everything)
    groups = cluster(points)
    found = sorted(
        (
            (int(np.sum(groups.labels == k)), problem.space.from_unit(points[groups.labels == k]))
            for k in range(groups.count)
        ),
        key=lambda group: -group[0],
    )
    published = [[name, triple(values)] for name, values in TABLE_3.items()]
    ours = [[f"{count} points", triple(np.median(values, axis=0))] for count, values in found]
    blank = ["", ""]
    rows = [
        (published[k] if k < len(published) else blank) + (ours[k] if k < len(ours) else blank)
        for k in range(max(len(published), min(len(ours), 6)))
    ]
    text = table(("area", "published: d_y, c_M, d_M", "here, median of a cluster", "d_y, c_M, d_M"), rows)
    text += ["Standard deviation over mean, of the published areas and of all points here:", ""]
    spreads = {"published": np.array(list(TABLE_3.values()), dtype=float), "here": problem.space.from_unit(points)}
    text += table(
        ("", *NAMES),
        [[name, *(f"{100 * v:.0f} %" for v in a.std(axis=0) / a.mean(axis=0))] for name, a in spreads.items()],
    )
    return text, shown


def single_minima(
    problem: Problem, tree: xr.DataTree, kelvin: FloatArray, seed: int
) -> tuple[list[str], dict[str, FloatArray]]:
    """Table 4: three bests of two runs per frequency as the paper did, and the exact minimum; then all of them."""
    exact = tree["per_frequency"].to_dataset()
    rows, all_published, all_flown = [], [], []
    for test in problem.tests:
        runs = [fly(problem, test, seed + 1 + k) for k in range(2)]
        points = np.concatenate([run.archived_points for run in runs])
        cost = np.concatenate([run.archived_cost for run in runs])
        kept = best_distinct(points, cost)
        values = problem.space.from_unit(points[kept])
        own = exact.sel(test=test)
        for k in range(3):
            published = TABLE_4[frequency(problem, test)][k]
            first = k == 0
            rows.append(
                [
                    f"{frequency(problem, test):g}" if first else "",
                    triple(published),
                    triple(values[k]) if k < len(values) else "",
                    f"{100 * cost[kept[k]]:.3f}" if k < len(values) else "",
                    triple(own["value"].values[0]) if first else "",
                    "±" + triple(own["sd"].values[0]) if first else "",
                    f"{100 * float(own['nrmsd'][0]):.3f}" if first else "",
                    f"{100 * kelvin[problem.tests.index(test)]:.3f}" if first else "",
                ]
            )
            all_published.append((frequency(problem, test), *published))
            if k < len(values):
                all_flown.append((frequency(problem, test), *values[k]))
    head = ("f (Hz)", "published", "firefly", "NRMSD %", "exact minimum", "sd (Laplace)", "NRMSD %", "Kelvin–Voigt %")
    minima = {
        "published": np.array(all_published, dtype=float),
        "firefly": np.array(all_flown),
        "exact minimum": np.column_stack(
            [
                [frequency(problem, test) for test in problem.tests],
                exact["value"].values[:, 0],
                exact["sd"].values[:, 0],
            ]
        ),
    }
    return table(head, rows), minima


def trends(minima: dict[str, FloatArray]) -> list[str]:
    """Mean, scatter about it and change per decade of frequency, each parameter."""
    rows = []
    for name, values in minima.items():
        decade = np.log10(values[:, 0])
        for k, parameter in enumerate(NAMES):
            y = values[:, 1 + k]
            sd = values[:, 4 + k] if values.shape[1] > 4 else np.ones_like(y)
            design = np.column_stack([np.ones_like(decade), decade]) / sd[:, None]
            line, *_ = np.linalg.lstsq(design, y / sd, rcond=None)
            inverse = np.linalg.inv(design.T @ design)
            scale = 1.0 if values.shape[1] > 4 else np.sum((y / sd - design @ line) ** 2) / (len(y) - 2)
            slope, spread = line[1], np.sqrt(scale * inverse[1, 1])
            rows.append(
                [
                    name,
                    parameter,
                    f"{y.mean():,.0f}",
                    f"{100 * y.std(ddof=1) / y.mean():.0f} %",
                    f"{y.std(ddof=1):,.0f}",
                    f"{100 * slope / y.mean():+.0f} ± {100 * spread / y.mean():.0f} %",
                ]
            )
    head = ("minima", "parameter", "mean", "standard deviation", "in its unit", "change per decade of frequency")
    return table(head, rows)


def final(tree: xr.DataTree, minima: dict[str, FloatArray]) -> list[str]:
    """Table 5."""
    mode, baseline = tree["modes/m1"].to_dataset(), tree["baseline"].to_dataset()
    best, sd = (mode[key].sel(parameter=list(NAMES)).values for key in ("mean", "sd"))
    kelvin = float(baseline["value"].sel(parameter_baseline="d_y"))
    rows = [
        ["Maxwell, published", triple(TABLE_5["Maxwell"])],
        ["Maxwell, mean of the firefly minima above (the paper's way)", triple(minima["firefly"][:, 1:].mean(axis=0))],
        ["Maxwell, all frequencies jointly: mean", triple(best)],
        ["standard deviation", triple(sd)],
        ["Kelvin–Voigt, published", triple(TABLE_5["Kelvin–Voigt"])],
        ["Kelvin–Voigt, all frequencies jointly", triple((kelvin, None, None))],
    ]
    return table(("model", "d_y, c_M, d_M"), rows)


def comparison(problem: Problem, tree: xr.DataTree, mean: FloatArray) -> dict[str, FloatArray]:
    """NRMSD of every test and model, of which Figure 10 shows one test; ``mean`` is that of the firefly minima."""
    return {
        "Kelvin–Voigt": tree["baseline"]["nrmsd"].values,
        "Maxwell, mean of the firefly minima": problem.objectives(problem.space.to_unit(mean)[None])[0],
        "Maxwell, jointly": tree["modes/m1"]["nrmsd"].values,
    }
