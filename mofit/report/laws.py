"""The laws of parameters over conditions: how they were chosen, and curves and maps with their bands."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from scipy.special import chdtrc

from mofit._typing import FloatArray
from mofit.quantities import title_of
from mofit.report.run import Run
from mofit.report.toolkit.axes import few_ticks
from mofit.report.toolkit.blocks import (
    Block,
    Column,
    Figure,
    Section,
    Table,
    Text,
    parameter_column,
    unit_column,
    words,
)
from mofit.report.toolkit.figures import MEASURED, Panels, band_key, dot_key, line_key, mode_colour
from mofit.report.toolkit.formatting import (
    Unit,
    display_unit,
    number,
    p_value,
    parameter_head,
    parameter_label,
    plus_minus,
)
from mofit.results import laws_summary

#: Standard deviations of a 90 % interval on either side.
_SIGMAS = 1.645
#: Combinations of conditions in the table; the file holds all.
_MOST = 60


@dataclass(frozen=True)
class Curve:
    """A parameter over a condition, SI units, and the estimates of the combinations alone."""

    parameter: str
    condition: str
    title: str
    units: tuple[str, str]
    """Of condition and parameter."""
    at: FloatArray
    low: FloatArray
    median: FloatArray
    high: FloatArray
    alone_at: FloatArray
    alone: FloatArray
    """Moved along the other conditions' laws to the middle of their ranges."""
    alone_sd: FloatArray


def extract_curves(tree: xr.DataTree) -> list[Curve]:
    """The curve of every law."""
    node = tree.children["laws"]
    if "curves" not in node.children:
        return []
    cells = node.children["cells"].to_dataset(inherit=False)
    found = []
    for parameter, over in node.children["curves"].children.items():
        for condition, child in over.children.items():
            own = child.to_dataset(inherit=False)
            values, at = cells.sel(parameter=parameter), np.asarray(cells[condition].values, dtype=float)
            here = np.interp(at, own["at"].values, own["median"].values)
            # what the laws over other conditions change is taken out: the dots lie about the curve
            moved = here - np.asarray(values["law_median"].values, dtype=float)
            found.append(
                Curve(
                    parameter=parameter,
                    condition=condition,
                    title=str(child.attrs["title"]),
                    units=(str(own["at"].attrs["units"]), str(own["median"].attrs["units"])),
                    at=own["at"].values,
                    low=own["low"].values,
                    median=own["median"].values,
                    high=own["high"].values,
                    alone_at=at,
                    alone=np.asarray(values["value"].values, dtype=float) + moved,
                    alone_sd=np.asarray(values["sd"].values, dtype=float),
                )
            )
    return found


def laws_section(run: Run) -> Section | None:
    """Table of the laws, their curves, and the estimates of the combinations; None without conditions."""
    found = laws_summary(run.tree)
    if found is None:
        return None
    curves = extract_curves(run.tree)
    over = " and ".join(title_of(name) for name in found["conditions"])
    blocks: list[Block] = [
        Text(
            f"Every combination of {over} was identified alone. From these estimates and their covariance the laws "
            "with the most evidence were chosen. All tests together gave their coefficients, which stand among the "
            "parameters. " + _verdict(found)
        ),
        _choice(found),
    ]
    blocks += [_figure(curves)] if curves else []
    maps = run.tree.children["laws"].children.get("maps")
    blocks += [_maps(maps)] if maps is not None else []
    blocks += [_populations(found)] if "populations" in found else []
    blocks.append(_alone(found))
    return Section("laws", "Parameters over conditions", blocks, {"laws": found["laws"]})


def _verdict(found: dict[str, Any]) -> str:
    """Whether the laws hold."""
    if found["freedom"] < 1:
        return "As many coefficients as estimates: nothing is left to test the laws."
    p = float(chdtrc(found["freedom"], found["chi_square"]))
    text = f"The {found['freedom']} estimates to spare scatter about them with chi square {found['chi_square']:.4g}"
    return f"{text} (p = {p_value(p)})" + (": no more than they may." if p > 0.01 else ": more than they may.")


def _choice(found: dict[str, Any]) -> Table:
    laws = found["laws"]
    names = list(dict.fromkeys(name for law in laws for name in law["log_evidence"]))

    def cell(law: dict[str, Any], name: str) -> str:
        value = law["log_evidence"].get(name)
        return "–" if value is None else number(value, 3)

    return Table(
        [
            parameter_column([law["parameter"] for law in laws]),
            words("Over", [title_of(law["condition"]) for law in laws]),
            words("Law", [law["law"] for law in laws]),
            *(Column(name, [cell(law, name) for law in laws]) for name in names),
        ],
        "Log evidence of every candidate relative to that of the law, the other laws unchanged; a dash: not tried.",
    )


def _figure(curves: Sequence[Curve]) -> Figure:
    colour = mode_colour(0)
    legend = [
        line_key(colour, "law"),
        band_key(colour, "5–95 %"),
        dot_key(MEASURED, "combination alone, 90 % interval", size=4.0),
    ]
    panels = Panels(len(curves), 3, 1.9, legend=legend, margin=(0.85, 0.5, 0.15), gap=(0.95, 0.95))
    for curve, axes in zip(curves, panels.axes, strict=True):
        _draw(curve, axes)
    return panels.figure(
        "Every parameter over every condition that it follows, with its band and the estimates of the combinations",
        "Other conditions are in the middle of their ranges; the estimates of the combinations are moved there "
        "along the laws.",
        good="nine of ten intervals of the combinations meet the band.",
        bad="the dots bend away from the curve: try another law (--law), or free.",
    )


def _draw(curve: Curve, axes: Axes) -> None:
    colour = mode_colour(0)
    x, y = _units(curve)
    axes.fill_between(x.factor * curve.at, y.factor * curve.low, y.factor * curve.high, color=colour, alpha=0.35, lw=0)
    axes.plot(x.factor * curve.at, y.factor * curve.median, color=colour)
    axes.errorbar(
        x.factor * curve.alone_at, y.factor * curve.alone, _SIGMAS * y.factor * curve.alone_sd,
        fmt="o", color=MEASURED, ms=3.0, lw=0.8,
    )  # fmt: skip
    axes.set_title(curve.title)
    axes.set_xlabel(x.label(title_of(curve.condition)))
    axes.set_ylabel(parameter_label(curve.parameter, y.name))
    few_ticks(axes)


def _maps(node: xr.DataTree) -> Figure:
    panels = Panels(len(node.children), 3, 2.0, margin=(0.85, 0.5, 0.15), gap=(0.95, 0.95))
    for axes, (name, child) in zip(panels.axes, node.children.items(), strict=True):
        own = child.to_dataset(inherit=False)
        x, y, median = (np.asarray(own[key].values, dtype=float) for key in ("x", "y", "median"))
        units = [display_unit(str(own[key].attrs["units"]), values) for key, values in (("x", x), ("y", y))]
        half = (own["high"].values - own["low"].values) / 2
        lines = axes.contour(units[0].factor * x, units[1].factor * y, median, levels=6, colors=mode_colour(0))
        axes.clabel(lines, fmt=lambda value: number(value, 3), fontsize=7)
        axes.set_title(f"{name}: band ±{number(float(half.min()), 2)} to {number(float(half.max()), 2)}")
        for set_label, unit, key in ((axes.set_xlabel, units[0], "x"), (axes.set_ylabel, units[1], "y")):
            set_label(unit.label(title_of(str(child.attrs[key]))))
        few_ticks(axes)
    return panels.figure(
        "Contours of every parameter over two conditions",
        "Median of the parameter (SI units) over two conditions; the title says how wide its 5–95 % band is.",
    )


def _units(curve: Curve) -> tuple[Unit, Unit]:
    unit = curve.units[1]
    return display_unit(curve.units[0], curve.at), Unit(unit, 1.0)


def _populations(found: dict[str, Any]) -> Table:
    rows = list(found["populations"].values())
    far: dict[str, list[str]] = {}
    for one in found["outliers"]:
        far.setdefault(one["parameter"], []).append(one["specimen"])
    return Table(
        [
            parameter_column(found["populations"]),
            Column("Mean", [number(one["mean"], 4) for one in rows]),
            Column("Mean, 5–95 %", [f"{number(one['mean_low'], 4)} … {number(one['mean_high'], 4)}" for one in rows]),
            Column("Spread", [number(one["spread"]) for one in rows]),
            Column("Spread, 5–95 %", [f"{number(one['spread_low'])} … {number(one['spread_high'])}" for one in rows]),
            unit_column(one["unit"] for one in rows),
            words("Spread of", ["logarithm" if one["of_logarithm"] else "value" for one in rows]),
            words("Stands out", [", ".join(far.get(name, ["–"])) for name in found["populations"]]),
        ],
        "The specimens as a normal population, from the estimates of each alone. A specimen stands out where the "
        "others predict its value with a probability below 1 %, all comparisons together.",
    )


def _alone(found: dict[str, Any]) -> Table:
    shown = found["combinations"][:_MOST]
    conditions, parameters = found["conditions"], list(shown[0]["parameters"])
    columns = [Column(title_of(name), [f"{one['conditions'][name]:g}" for one in shown]) for name in conditions]
    for name in parameters:
        own = [one["parameters"][name] for one in shown]
        columns.append(Column(parameter_head(name, own[0]["unit"]), [plus_minus(e["value"], e["sd"]) for e in own]))
    more = len(found["combinations"]) - len(shown)
    return Table(
        columns, "Every combination of conditions alone, ± standard deviation." + f" {more} more." * (more > 0)
    )
