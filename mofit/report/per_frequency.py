"""Minima of each test alone beside the joint estimate (Hackl et al. 2016, Table 4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.ticker import FixedLocator, LogLocator, NullLocator

from mofit.report.display import compact, math_symbol, number, percent, symbol, with_sd
from mofit.report.page import Block, Details, Figure, Section, Table, Text
from mofit.report.pull import extract_pull, pull_figure
from mofit.report.run import Array, Run, labels, numbers
from mofit.report.style import MEASURED, cluster_colour, few_ticks, image_of, legend_above, line_key, panels


@dataclass(frozen=True)
class PerTest:
    """Minima of single tests, shape (test, minimum, parameter), SI units, and the best cluster's joint estimate."""

    tests: list[str]
    frequency: Array
    parameters: list[str]
    value: Array
    sd: Array
    nrmsd: Array
    joint: Array
    joint_low: Array
    joint_high: Array


def extract_per_test(run: Run) -> PerTest | None:
    """The tests that were identified alone, or None where the run has none."""
    node = run.group("per_frequency")
    if node is None:
        return None
    value = numbers(node, "value")
    some = np.asarray(np.isfinite(value).any(axis=(1, 2)))
    if not some.any():
        return None
    names = labels(node, "parameter")
    sd = numbers(node, "sd") if "sd" in node.data_vars else np.full(value.shape, np.nan)
    best = run.clusters[0]
    joint = {
        name: column
        for name, *column in zip(
            best.parameters, best.array("value"), best.array("q05"), best.array("q95"), strict=True
        )
    }
    estimate = np.array([joint.get(name, [np.nan] * 3) for name in names])
    tests = labels(node, "test")
    frequency = dict(zip(run.tests, run.of_tests("frequency"), strict=True))
    return PerTest(
        tests=[test for test, there in zip(tests, some, strict=True) if there],
        frequency=np.array([frequency[test] for test, there in zip(tests, some, strict=True) if there]),
        parameters=names,
        value=value[some],
        sd=sd[some],
        nrmsd=numbers(node, "nrmsd")[some],
        joint=estimate[:, 0],
        joint_low=estimate[:, 1],
        joint_high=estimate[:, 2],
    )


def draw_per_test(found: PerTest, k: int, bounds: tuple[float, float], log: bool, axes: Axes) -> Axes:
    """One parameter over frequency (or test): best minimum filled, ± sd, others hollow, a band for the joint one."""
    frequency = found.frequency
    over_frequency = bool(np.isfinite(frequency).all() and len(set(frequency)) == frequency.size > 1)
    x = frequency if over_frequency else np.arange(len(found.tests), dtype=float)
    if np.isfinite(found.joint_low[k]):
        axes.axhspan(found.joint_low[k], found.joint_high[k], color=cluster_colour(0), alpha=0.2, lw=0)
    axes.axhline(found.joint[k], color=cluster_colour(0), lw=1.6)
    for rank in range(found.value.shape[1] - 1, -1, -1):
        value = found.value[:, rank, k]
        if rank == 0:
            low = np.maximum(value - found.sd[:, rank, k], bounds[0])
            high = np.minimum(value + found.sd[:, rank, k], bounds[1])
            axes.vlines(x, low, high, color=MEASURED, lw=1.0)
        axes.plot(x, value, ls="none", marker="o", ms=5, mfc=MEASURED if rank == 0 else "white", mec=MEASURED, mew=0.9)
    if over_frequency:
        axes.set_xscale("log")
        axes.xaxis.set_minor_locator(NullLocator())
        axes.xaxis.set_major_locator(FixedLocator(thinned(x)))
        axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
    else:
        axes.set_xticks(x, found.tests, rotation=35, ha="right")
    few_ticks(axes, None, 5)
    values = found.value[:, :, k]
    finite = values[np.isfinite(values)]
    if log and finite.size and finite.max() > 8 * finite.min():
        axes.set_yscale("log")
        axes.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axes.yaxis.set_minor_locator(NullLocator())
        axes.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
    return axes


def thinned(x: Array) -> list[float]:
    """Tick places at least a third of an octave apart."""
    kept: list[float] = []
    for value in sorted(x.tolist()):
        if not kept or value >= 1.26 * kept[-1]:
            kept.append(value)
    return kept


def per_frequency_section(run: Run) -> Section | None:
    """Figure and table of the minima of single tests."""
    found = extract_per_test(run)
    if found is None:
        return None
    blocks: list[Block] = [
        Text(
            "Each test identified on its own, with up to three minima. Where they scatter or drift with frequency "
            "while the "
            "joint estimate stays put, a single test can't tell the parameters, or the model isn't the same at all "
            "frequencies."
        ),
        _figure(run, found),
        Details("Table of the minima per test", [_table(run, found)]),
    ]
    pull = extract_pull(run)
    if pull is not None and len(pull.tests) > 1:
        blocks.append(pull_figure(run, pull))
    return Section("per_frequency", "Minima of single tests", blocks, {"per_frequency": found, "pull": pull})


def _figure(run: Run, found: PerTest) -> Figure:
    names = found.parameters
    lower, upper = run.of_parameters("lower", names), run.of_parameters("upper", names)
    log = run.is_log(names)
    canvas, axes, _ = panels(len(names), 3, 2.1, margin=(0.8, 0.55, 0.15, 0.6), gap=(0.8, 0.8))
    for k, panel in enumerate(axes):
        draw_per_test(found, k, (float(lower[k]), float(upper[k])), bool(log[k]), panel)
        unit = run.unit(names[k])
        panel.set_title(math_symbol(names[k]) + ("" if unit == "1" else f"  ({unit})"))
        if k >= len(names) - 3 and np.isfinite(found.frequency).all():
            panel.set_xlabel("frequency (Hz)")
    handles = [line_key(MEASURED, "best minimum of a test, ± sd", ls="none", marker="o", ms=5)]
    if np.isfinite(found.value[:, 1:]).any():
        handles.append(line_key(MEASURED, "its other minima", ls="none", marker="o", mfc="white", ms=5))
    handles.append(line_key(cluster_colour(0), f"all tests together, {run.clusters[0].name}, 5–95 %", lw=3, alpha=0.7))
    legend_above(canvas, handles)
    return Figure(
        image_of(canvas),
        "Parameters identified from each test alone, with the joint estimate",
        "A parameter per panel: minima found from one test alone, and the estimate from all tests together.",
        good="the points scatter around the line within their bars.",
        bad="the points drift with frequency beyond their bars: the parameter takes up an effect that the model lacks.",
    )


def _table(run: Run, found: PerTest) -> Table:
    units = [run.unit(name) for name in found.parameters]
    columns: list[Markup | str] = ["Test", "Frequency (Hz)"]
    columns += [
        symbol(name) + ("" if unit == "1" else f" ({unit})") for name, unit in zip(found.parameters, units, strict=True)
    ]
    rows = []
    for t, test in enumerate(found.tests):
        for m in range(found.value.shape[1]):
            if not np.isfinite(found.value[t, m]).any():
                continue
            cells = [
                with_sd(value, sd) + (f" ± {number(sd, 2)}" if np.isfinite(sd) else "")
                for value, sd in zip(found.value[t, m], found.sd[t, m], strict=True)
            ]
            first = [test, compact(found.frequency[t], 4)] if m == 0 else ["", ""]
            rows.append([*first, *cells, percent(found.nrmsd[t, m])])
    return Table(
        [*columns, "NRMSD"], rows, "Local minima of each test identified separately, best first (Table 4 of the paper)."
    )
