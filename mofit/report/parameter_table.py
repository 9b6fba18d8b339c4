"""The parameters: value, uncertainty, bounds hit and verdict, per solution."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from markupsafe import Markup

from mofit.report.display import THIN, badge, compact, number, percent, symbol, with_sd
from mofit.report.page import Block, Section, Table, Text, tabs
from mofit.report.run import Cluster, Run, tab_title


@dataclass(frozen=True)
class Estimate:
    """One parameter of one cluster, SI units."""

    cluster: str
    parameter: str
    unit: str
    value: float
    mean: float
    sd: float
    q05: float
    q50: float
    q95: float
    contraction: float
    at_bound: int
    verdict: str
    grade: str


def extract_estimates(run: Run, cluster: Cluster) -> list[Estimate]:
    """The parameters of a cluster as rows."""
    columns = {name: cluster.array(name) for name in ("value", "mean", "sd", "q05", "q50", "q95", "contraction")}
    bounds = cluster.array("at_bound")
    return [
        Estimate(
            cluster=cluster.name,
            parameter=parameter,
            unit=run.unit(parameter),
            **{name: float(column[k]) for name, column in columns.items()},
            at_bound=int(bounds[k]),
            verdict=cluster.verdicts[k],
            grade=cluster.grades[k],
        )
        for k, parameter in enumerate(cluster.parameters)
    ]


def parameter_section(run: Run) -> Section:
    """A table per cluster, and one of what was held fixed or calibrated before."""
    estimates = {cluster.name: extract_estimates(run, cluster) for cluster in run.clusters}
    panes: dict[str, list[Block]] = {tab_title(c): [_table(run, estimates[c.name], c)] for c in run.clusters}
    blocks: list[Block] = [
        Text(
            "Value is the refined minimum; mean, standard deviation (sd) and interval describe the posterior. "
            "“Learned” says how "
            "much narrower the posterior is than the prior box: 100 % is a point, 0 % means that the data said "
            "nothing."
        ),
        *tabs(panes),
    ]
    others = [name for name in run.parameters if name not in run.clusters[0].parameters]
    if others:
        blocks.append(_others(run, others))
    return Section("parameters", "Parameters", blocks, {"clusters": estimates})


def _table(run: Run, estimates: list[Estimate], cluster: Cluster) -> Table:
    names = [estimate.parameter for estimate in estimates]
    lower, upper = run.of_parameters("lower", names), run.of_parameters("upper", names)
    description = run.of_parameters("description", names)
    rows = []
    for k, e in enumerate(estimates):
        bound = {-1: "lower", 0: "–", 1: "upper"}[e.at_bound]
        interval = f"{with_sd(e.q05, e.sd)} … {with_sd(e.q95, e.sd)}" if np.isfinite(e.q05) else "–"
        rows.append(
            [
                Markup('<span title="{}">{}</span>').format(description[k], symbol(e.parameter)),
                with_sd(e.value, e.sd),
                with_sd(e.mean, e.sd),
                number(e.sd, 2),
                interval,
                "" if e.unit == "1" else e.unit,
                f"{compact(float(lower[k]))} … {compact(float(upper[k]))}",
                bound,
                "–" if np.isnan(e.contraction) else f"{100 * e.contraction:.0f}{THIN}%",
                badge(
                    e.verdict
                    or {"good": "identified", "bad": "not pinned", "unknown": "not sampled"}.get(e.grade, e.grade),
                    e.grade,
                ),
            ]
        )
    columns = [
        "Parameter",
        "Value",
        "Mean",
        "sd",
        "5–95 % interval",
        "Unit",
        "Search box",
        "At bound",
        "Learned",
        "Verdict",
    ]
    evidence = f"{float(cluster.node.attrs['log_evidence']):.2f}".replace("-", "−")
    caption = f"Solution {cluster.name}: posterior weight {percent(cluster.weight)}, log evidence {evidence}"
    return Table(columns, rows, caption + ("." if cluster.converged else "; its chains did not converge."))


def _others(run: Run, names: list[str]) -> Table:
    table = [run.of_parameters(key, names) for key in ("nominal", "unit", "role", "description")]
    rows = [
        [symbol(name), compact(float(nominal)), "" if unit == "1" else str(unit), str(role), str(description)]
        for name, nominal, unit, role, description in zip(names, *table, strict=True)
    ]
    return Table(
        ["Parameter", "Value", "Unit", "Role", "Description"],
        rows,
        "Parameters that were not searched: found in an earlier calibration stage, or held fixed.",
        left=[2, 3, 4],
    )
