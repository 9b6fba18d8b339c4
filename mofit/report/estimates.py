"""The parameters: value, uncertainty, bounds and verdict, per mode."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from markupsafe import Markup

from mofit.report.run import Mode, Run, labels
from mofit.report.toolkit.blocks import (
    Block,
    Column,
    Section,
    Table,
    Text,
    badge,
    parameter_column,
    tabs,
    unit_column,
    words,
)
from mofit.report.toolkit.formatting import (
    compact,
    interval,
    number,
    percent,
    plus_minus,
    symbol,
    whole_percent,
    with_sd,
)
from mofit.results.reading import scoped_values

_NO_VERDICT = {"good": "identified", "bad": "not identified", "unknown": "not sampled"}


@dataclass(frozen=True)
class Estimate:
    """One parameter of one mode, SI units; `noise_sd` is the standard deviation if noise were the only error."""

    mode: str
    parameter: str
    unit: str
    value: float
    mean: float
    sd: float
    q05: float
    q50: float
    q95: float
    noise_sd: float
    contraction: float
    at_bound: int
    verdict: str
    grade: str


def extract_estimates(run: Run, mode: Mode) -> list[Estimate]:
    """The parameters of a mode as rows."""
    names = ("value", "mean", "sd", "q05", "q50", "q95", "noise_sd", "contraction")
    columns = {name: mode.array(name) for name in names}
    bounds = mode.array("at_bound")
    return [
        Estimate(
            mode=mode.name,
            parameter=parameter,
            unit=run.unit(parameter),
            **{name: float(column[k]) for name, column in columns.items()},
            at_bound=int(bounds[k]),
            verdict=mode.verdicts[k],
            grade=mode.grades[k],
        )
        for k, parameter in enumerate(mode.parameters)
    ]


def estimate_columns(run: Run, estimates: list[Estimate]) -> Mapping[str, Column]:
    """Every column that a table of estimates may have, by its head."""
    space = run.space([e.parameter for e in estimates])
    name = Markup('<span title="{}">{}</span>')
    columns = [
        Column("Parameter", [name.format(p.description, symbol(p.name)) for p in space.parameters]),
        Column("MAP", [with_sd(e.value, e.sd) for e in estimates]),
        Column("Mean", [with_sd(e.mean, e.sd) for e in estimates]),
        Column("sd", [number(e.sd, 2) for e in estimates]),
        Column("Mean ± sd", [plus_minus(e.mean, e.sd) for e in estimates]),
        Column("90 % interval", [interval(e.q05, e.q95, e.sd) for e in estimates]),
        Column("Noise alone, sd", [number(e.noise_sd, 2) for e in estimates]),
        unit_column(e.unit for e in estimates),
        Column("Prior box", [f"{compact(p.lower)} … {compact(p.upper)}" for p in space.parameters]),
        Column("At bound", [{-1: "lower", 0: "–", 1: "upper"}[e.at_bound] for e in estimates]),
        Column("Contraction", [whole_percent(e.contraction, 1) for e in estimates]),
        words("Verdict", [badge(e.verdict or _NO_VERDICT.get(e.grade, e.grade), e.grade) for e in estimates]),
    ]
    return {str(column.head): column for column in columns}


def estimates_section(run: Run) -> Section:
    """A table per mode, and one of the parameters that were fixed or estimated beforehand."""
    estimates = {mode.name: extract_estimates(run, mode) for mode in run.modes}
    panes: dict[str, list[Block]] = {
        mode.title: [_table(run, mode, estimates[mode.name]), *_scoped(mode)] for mode in run.modes
    }
    text = Text(
        "MAP is the refined maximum of the posterior. Mean, standard deviation (sd) and interval describe the "
        "posterior. Contraction is how much narrower the posterior is than the prior box: 100 % is a point; at 0 % the "
        "data do not inform the parameter."
    )
    blocks: list[Block] = [text, *tabs(panes)]
    others = [name for name in run.parameters if name not in run.best.parameters]
    if others:
        blocks.append(_others(run, others))
    return Section("parameters", "Parameters", blocks, {"modes": estimates})


def _table(run: Run, mode: Mode, estimates: list[Estimate]) -> Table:
    columns = estimate_columns(run, estimates)
    left_out = ("Mean ± sd", "Noise alone, sd")
    evidence = f"{float(mode.node.attrs['log_evidence']):.2f}".replace("-", "−")
    caption = f"Mode {mode.name}: posterior probability {percent(mode.probability)}, log evidence {evidence}"
    return Table([column for head, column in columns.items() if head not in left_out], caption + unconverged(mode))


def _scoped(mode: Mode) -> list[Block]:
    """A table of the parameters with a value per test or condition, one row per value."""
    rows = [
        (name, label, own, entry["unit"])
        for name, entry in scoped_values(mode.node).get("scoped", {}).items()
        for label, own in entry["values"].items()
    ]
    if not rows:
        return []
    sides = {-1: "lower end of its range", 0: "–", 1: "upper end of its range"}
    columns = [
        parameter_column([name for name, *_ in rows]),
        words("Of", [label for _, label, *_ in rows]),
        Column("Estimate", [plus_minus(own["value"], own["sd"]) for *_, own, _ in rows]),
        unit_column(unit for *_, unit in rows),
        words("At bound", [sides[own["at_bound"]] for *_, own, _ in rows]),
    ]
    caption = "Parameters with a value of their own per test or condition: at the mode, ± standard deviation (Laplace)."
    return [Table(columns, caption)]


def unconverged(mode: Mode) -> str:
    """The end of a caption: a full stop, or that the chains did not converge."""
    return "." if mode.converged else "; its chains did not converge."


def _others(run: Run, names: list[str]) -> Table:
    space, table = run.space(names), run.tree.children["parameters"]
    roles = dict(zip(labels(table, "parameter"), labels(table, "role"), strict=True))
    return Table(
        [
            parameter_column(names),
            Column("Value", [compact(value) for value in space.nominal]),
            unit_column(space.units),
            words("Role", [roles[name] for name in names]),
            words("Description", [parameter.description for parameter in space.parameters]),
        ],
        "Parameters that were not searched: estimated in a calibration stage, or fixed.",
    )
