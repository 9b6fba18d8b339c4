"""NRMSD per test: the model beside its baseline and the noise floor (Hackl et al. 2016, Figure 10)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.ticker import FixedLocator, LogLocator, NullFormatter, NullLocator

from mofit.report.display import compact, display_unit, key, number, percent
from mofit.report.page import Block, Figure, Section, Table
from mofit.report.run import Array, Run, numbers
from mofit.report.style import (
    BASELINE,
    FLOOR,
    cluster_colour,
    few_ticks,
    image_of,
    legend_above,
    legend_height,
    line_key,
    panels,
)

_LOG_FROM = 12.0
"""Ratio of the largest to the smallest error from which the axis is logarithmic."""


@dataclass(frozen=True)
class Errors:
    """NRMSD (fractions of the output's range) per test; NaN where a test was not predicted."""

    tests: list[str]
    frequency: Array
    noise_floor: Array
    models: dict[str, Array]
    baseline_title: str
    baseline: Array


def extract_errors(run: Run) -> Errors:
    """NRMSD of every cluster, the baseline and the noise, in the order of the tests."""
    return Errors(
        tests=run.tests,
        frequency=run.of_tests("frequency"),
        noise_floor=run.of_tests("noise_floor"),
        models={c.name: numbers(c.node, "nrmsd") for c in run.clusters},
        baseline_title=run.baseline_title,
        baseline=run.baseline_nrmsd,
    )


def draw_errors(errors: Errors, chosen: np.ndarray, over_frequency: bool, axes: Axes) -> Axes:
    """NRMSD in % of the chosen tests, over frequency or one place per test."""
    order = np.flatnonzero(chosen)
    if over_frequency:
        order = order[np.argsort(errors.frequency[order], kind="stable")]
        x, line = errors.frequency[order], "-"
        axes.set_xscale("log")
        axes.set_xlabel("frequency (Hz)")
        axes.xaxis.set_major_locator(FixedLocator(_spread(x)))
        axes.xaxis.set_minor_locator(NullLocator())
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
    else:
        x, line = np.arange(order.size, dtype=float), "none"
        names = [errors.tests[k] for k in order]
        crowded = max(map(len, names)) * len(names) > 60
        axes.set_xticks(x, names, rotation=30 if crowded else 0, ha="right" if crowded else "center")
        axes.set_xlim(-0.6, order.size - 0.4)
        axes.grid(visible=False, axis="x")
    floor = 100 * errors.noise_floor[order]
    if over_frequency:
        axes.fill_between(x, 1e-9, floor, color=FLOOR, alpha=0.22, lw=0)
        axes.plot(x, floor, color=FLOOR, lw=1.2)
    else:
        axes.bar(x, floor, width=0.8, color=FLOOR, alpha=0.3, lw=0)
    if np.isfinite(errors.baseline[order]).any():
        axes.plot(x, 100 * errors.baseline[order], color=BASELINE, ls="--" if line == "-" else "none", marker="s", ms=5)
    for index, nrmsd in reversed([*enumerate(errors.models.values())]):
        axes.plot(
            x, 100 * nrmsd[order], color=cluster_colour(index), ls=line, marker="o", ms=5.5 if index == 0 else 4,
            lw=1.8 if index == 0 else 1.0,
        )  # fmt: skip
    values = np.concatenate([floor, *(100 * e[order] for e in (*errors.models.values(), errors.baseline))])
    values = values[np.isfinite(values) & (values > 0)]
    if values.size and values.max() > _LOG_FROM * values.min():
        axes.set_yscale("log")
        axes.set_ylim(0.5 * values.min(), 1.5 * values.max())
        axes.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axes.yaxis.set_minor_locator(NullLocator())
        axes.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
    else:
        axes.set_ylim(bottom=0)
        few_ticks(axes, None, 5)
    axes.set_ylabel("NRMSD (%)")
    return axes


def _spread(x: Array) -> list[float]:
    """Tick places on a log axis that stand apart enough to be read."""
    kept: list[float] = []
    room = 0.045 * (np.log(x.max()) - np.log(x.min()))
    for value in sorted(set(x.tolist())):
        if not kept or np.log(value) - np.log(kept[-1]) >= room:
            kept.append(value)
    return kept


def error_section(run: Run) -> Section:
    """Figure and table of the errors."""
    errors = extract_errors(run)
    blocks: list[Block] = [_figure(errors), _table(run, errors)]
    return Section("errors", "Error per test", blocks, {"errors": errors})


def _figure(errors: Errors) -> Figure:
    periodic = np.isfinite(errors.frequency)
    distinct = len(set(errors.frequency[periodic])) == periodic.sum() > 1
    groups = [(periodic, True), (~periodic, False)] if distinct else [(np.ones_like(periodic), False)]
    groups = [group for group in groups if group[0].any()]
    handles = [line_key(cluster_colour(k), f"model, {name}", marker="o") for k, name in enumerate(errors.models)]
    if errors.baseline_title:
        handles.append(line_key(BASELINE, errors.baseline_title, marker="s", ls="--"))
    handles.append(line_key(FLOOR, "noise floor", lw=5, alpha=0.5))
    canvas, axes, _ = panels(len(groups), len(groups), 2.7, margin=(0.65, 0.75, 0.15, legend_height(len(handles))))
    for (chosen, over_frequency), panel in zip(groups, axes, strict=True):
        draw_errors(errors, chosen, over_frequency, panel)
    legend_above(canvas, handles)
    return Figure(
        image_of(canvas),
        "NRMSD of the model, the baseline and the noise per test",
        "Root mean square of measured − simulated, divided by the measured peak-to-peak range, per test. The "
        "shaded area is the "
        "noise floor: what remains if the model is exactly right.",
        good="the model lies on the edge of the shaded area at every test, well below the baseline.",
        bad="the curve climbs away from the noise floor at one end: an effect that matters there is missing in the "
        "model.",
    )


def _table(run: Run, errors: Errors) -> Table:
    amplitude, periods = run.of_tests("amplitude"), run.of_tests("periods")
    columns: list[Markup | str] = ["Test", "Kind", "Frequency (Hz)", "Amplitude", "Periods", "Noise floor"]
    if errors.baseline_title:
        columns.append(errors.baseline_title)
    columns += [key(cluster_colour(k), name) for k, name in enumerate(errors.models)] + ["Model / floor"]
    best = next(iter(errors.models.values()))
    rows = []
    for k, test in enumerate(errors.tests):
        row: list[Markup | str] = [
            test,
            run.kinds[k].replace("_", " "),
            compact(errors.frequency[k], 4),
            _amplitude(run, test, float(amplitude[k])),
            compact(periods[k], 4) if periods[k] > 0 else "–",
            percent(errors.noise_floor[k]),
        ]
        if errors.baseline_title:
            row.append(percent(errors.baseline[k]))
        row += [percent(nrmsd[k]) for nrmsd in errors.models.values()]
        floor = errors.noise_floor[k]
        row.append(f"{number(best[k] / floor)}×" if floor > 0 and np.isfinite(best[k]) else "–")
        rows.append(row)
    return Table(columns, rows, "NRMSD per test. “Model / floor” compares the best solution with the noise.", left=[1])


def _amplitude(run: Run, test: str, value: float) -> str:
    """Amplitude of the input in its display unit: tests of one campaign may drive different channels."""
    driver = run.input_of(test)
    units = driver.attrs["units"] if driver is not None else run.tree.dataset["amplitude"].attrs["units"]
    unit = display_unit(str(units), value)
    return f"{compact(unit.factor * value, 4)} {unit.name}" if np.isfinite(value) else "–"
