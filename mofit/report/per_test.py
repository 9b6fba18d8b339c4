"""Minima of each test alone beside the joint estimate (Hackl et al. 2016, Table 4), and the leverage of each test."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from mofit._typing import FloatArray
from mofit.report.run import Run, labels, numbers
from mofit.report.toolkit.axes import all_differ, axis_of_frequencies, axis_of_tests, few_ticks, heat_map, log_axis
from mofit.report.toolkit.blocks import Block, Column, Details, Figure, Section, Table, Text
from mofit.report.toolkit.description import keyed, test_of
from mofit.report.toolkit.figures import MEASURED, Panels, dot_key, line_key, mode_colour
from mofit.report.toolkit.formatting import (
    compact,
    math_symbol,
    number,
    parameter_head,
    parameter_label,
    percent,
    plus_minus,
    symbol,
)

_LOG_FROM = 8.0
"""Ratio of the largest to the smallest estimate from which the axis of a log-scaled parameter is logarithmic."""

_NOTABLE = 0.005
"""Change of a test's error, by a standard deviation of the parameter, that is written into its cell."""


@dataclass(frozen=True)
class PerTest:
    """Minima of single tests, shape (test, minimum, parameter), SI units, and the best mode's joint estimate.

    `nrmsd` has shape (test, minimum), of several outputs (test, minimum, output). `joint` are value, 5 and 95 %
    quantile, shape (parameter, 3).
    """

    tests: list[str]
    frequency: FloatArray
    parameters: list[str]
    value: FloatArray
    sd: FloatArray
    nrmsd: FloatArray
    joint: FloatArray


@dataclass(frozen=True)
class Leverage:
    """Relative change of each test's NRMSD per standard deviation of each parameter, shape (test, parameter)."""

    tests: list[str]
    parameters: list[str]
    change: FloatArray


def extract_per_test(run: Run) -> PerTest | None:
    """The tests that were identified alone, or None where the run has none."""
    node = run.group("per_frequency")
    if node is None:
        return None
    value = numbers(node, "value")
    some = np.asarray(np.isfinite(value).any(axis=(1, 2)))
    if not some.any():
        return None
    names, best = labels(node, "parameter"), run.best
    rows = np.stack([best.array(name) for name in ("value", "q05", "q95")], axis=1)
    joint = dict(zip(best.parameters, rows, strict=True))
    tests = [test for test, there in zip(labels(node, "test"), some, strict=True) if there]
    return PerTest(
        tests=tests,
        frequency=np.array([run.of_tests("frequency")[run.tests.index(test)] for test in tests]),
        parameters=names,
        value=value[some],
        sd=numbers(node, "sd")[some] if "sd" in node.data_vars else np.full(value[some].shape, np.nan),
        nrmsd=numbers(node, "nrmsd")[some],
        joint=np.array([joint.get(name, np.full(3, np.nan)) for name in names]),
    )


def extract_leverage(run: Run) -> Leverage | None:
    """Of the best mode, or None where the run has none."""
    best = run.best
    if "leverage" not in best.node.data_vars:
        return None
    return Leverage(run.objective_names, best.parameters, run.of_objectives("leverage", best.node))


def _draw_per_test(run: Run, found: PerTest, k: int, axes: Axes) -> Axes:
    """One parameter over frequency (or test): best minimum filled, ± sd, others hollow, a band for the joint one."""
    own = run.space(found.parameters).parameters[k]
    value, low, high = found.joint[k]
    if np.isfinite(low):
        axes.axhspan(low, high, color=mode_colour(0), alpha=0.2, lw=0)
    axes.axhline(value, color=mode_colour(0), lw=1.6)
    if all_differ(found.frequency):
        x = found.frequency
        axis_of_frequencies(axes, x)
    else:
        x = axis_of_tests(axes, found.tests)
    first, sd = found.value[:, 0, k], found.sd[:, 0, k]
    bars = np.maximum(first - sd, own.lower), np.minimum(first + sd, own.upper)
    for rank in range(found.value.shape[1] - 1, 0, -1):
        axes.plot(x, found.value[:, rank, k], ls="none", marker="o", ms=5, mfc="white", mec=MEASURED, mew=0.9)
    axes.vlines(x, *bars, color=MEASURED, lw=1.0)
    (dots,) = axes.plot(x, first, ls="none", marker="o", ms=5, mfc=MEASURED, mec=MEASURED, mew=0.9)
    keyed(dots, test=found.tests)
    few_ticks(axes, None, 5)
    values = found.value[:, :, k]
    finite = values[np.isfinite(values)]
    if own.scale == "log" and finite.size and finite.max() > _LOG_FROM * finite.min():
        log_axis(axes, "y")
    axes.set_title(parameter_label(own.name, own.unit))
    return axes


def draw_leverage(found: Leverage, axes: Axes) -> Axes:
    """Tests over parameters; purple: the test prefers more of the parameter, orange: less."""
    limit = max(float(np.nanmax(np.abs(found.change))), _NOTABLE)
    symbols = [math_symbol(name) for name in found.parameters]
    heat_map(axes, -found.change.T, symbols, found.tests, cmap="PuOr", vmin=-limit, vmax=limit)
    keyed(axes.xaxis, test=[test_of(name) for name in found.tests])
    axes.tick_params(axis="x", rotation=35 if len(found.tests) > 10 else 0)
    for (t, k), change in np.ndenumerate(found.change):
        if np.isfinite(change) and abs(change) >= _NOTABLE:
            text = f"{'↑' if change < 0 else '↓'} {percent(abs(change))}"
            colour = "white" if abs(change) > 0.6 * limit else MEASURED
            axes.text(t, k, text, ha="center", va="center", fontsize=7.5, color=colour)
    return axes


def per_test_panels(run: Run, found: PerTest, best: str, others: str) -> Panels:
    """A panel per parameter; `best` and `others` name the filled and the hollow points."""
    legend: list[Line2D] = [dot_key(MEASURED, best)]
    if np.isfinite(found.value[:, 1:]).any():
        legend.append(dot_key(MEASURED, others, hollow=True))
    legend.append(line_key(mode_colour(0), f"all tests together, {run.best.name}, 5–95 %", lw=3, alpha=0.7))
    panels = Panels(len(found.parameters), 3, 2.1, legend=legend, margin=(0.8, 0.55, 0.15), gap=(0.8, 0.8))
    for k, axes in enumerate(panels.axes):
        _draw_per_test(run, found, k, axes)
    panels.label("frequency (Hz)" if all_differ(found.frequency) else "")
    return panels


def farthest(found: PerTest) -> Markup:
    """The estimate of a single test that is farthest from the joint one, in its own standard deviations."""
    with np.errstate(divide="ignore", invalid="ignore"):
        away = np.abs(found.value[:, 0] - found.joint[:, 0]) / found.sd[:, 0]
    away = np.where(np.isfinite(away), away, 0.0)
    t, k = np.unravel_index(np.argmax(away), away.shape)
    if not away[t, k]:
        return Markup("No single test has a standard deviation to compare by.")
    return Markup("{} is farthest from the joint estimate in {}: {} of its standard deviations.").format(
        symbol(found.parameters[k]), found.tests[t], number(float(away[t, k]), 2)
    )


def per_test_section(run: Run) -> Section | None:
    """Figure and table of the minima of single tests, and the leverage of each test."""
    found = extract_per_test(run)
    if found is None:
        return None
    figure = per_test_panels(run, found, "best minimum of a test, ± sd", "its other minima").figure(
        "Parameters identified from each test alone, with the joint estimate",
        "A parameter per panel: minima found from one test alone, and the estimate from all tests together.",
        good="the points scatter around the line within their bars.",
        bad="the points drift with frequency beyond their bars: the parameter compensates for an effect that the "
        "model lacks.",
        finding=farthest(found),
    )
    blocks: list[Block] = [
        Text(
            "Each test is identified alone, with up to three minima. They may scatter or drift with frequency while "
            "the joint estimate does not. Then a single test does not identify the parameters, or the model is not the "
            "same at all frequencies."
        ),
        figure,
        Details("Table of the minima per test", [_table(run, found)]),
    ]
    leverage = extract_leverage(run)
    if leverage is not None and len(leverage.tests) > 1:
        blocks.append(_leverage_figure(run, leverage))
    return Section("per_test", "Minima of single tests", blocks, {"per_test": found, "leverage": leverage})


def _table(run: Run, found: PerTest) -> Table:
    rows = [(t, m) for t, m in np.ndindex(*found.nrmsd.shape[:2]) if np.isfinite(found.value[t, m]).any()]

    errors = (
        {"NRMSD": found.nrmsd}
        if found.nrmsd.ndim == 2
        else {
            f"NRMSD of {name.replace('_', ' ')}": found.nrmsd[..., k]
            for k, name in enumerate(labels(run.tree, "output"))
        }
    )

    def once(cells: Sequence[str]) -> list[str]:
        return [cells[t] if m == 0 else "" for t, m in rows]

    return Table(
        [
            Column("Test", once(found.tests)),
            Column("Frequency (Hz)", once([compact(hertz, 4) for hertz in found.frequency])),
            *(
                Column(
                    parameter_head(name, run.unit(name)),
                    [plus_minus(found.value[t, m, k], found.sd[t, m, k]) for t, m in rows],
                )
                for k, name in enumerate(found.parameters)
            ),
            *(Column(head, [percent(float(nrmsd[t, m])) for t, m in rows]) for head, nrmsd in errors.items()),
        ],
        "Local minima of each test identified separately, best first (Table 4 of the paper).",
    )


def _strongest(found: Leverage) -> Markup:
    t, k = np.unravel_index(np.nanargmax(np.abs(np.nan_to_num(found.change))), found.change.shape)
    way = "larger" if found.change[t, k] < 0 else "smaller"
    return Markup("{} asks most: a {} {} by one standard deviation would lessen its error by {}.").format(
        found.tests[t], way, symbol(found.parameters[k]), percent(abs(float(found.change[t, k])))
    )


def _leverage_figure(run: Run, found: Leverage) -> Figure:
    """Heat map with a cell per test and parameter."""
    panels = Panels(1, 1, 0.3 * len(found.parameters) + 0.2, margin=(0.75, 0.45, 0.15), top=0.15)
    draw_leverage(found, panels.axes[0])
    return panels.figure(
        "How the error of each test changes with each parameter at the joint estimate",
        f"Leverage at {run.best.name}: the share by which the error of a test falls if a parameter is one standard "
        f"deviation larger (↑) or smaller (↓). Cells below {percent(_NOTABLE)} have no number.",
        good="small numbers without a pattern: the tests agree on the parameter.",
        bad="one end of the frequency range prefers a larger value, the other a smaller one: the joint value is a "
        "compromise, and the model lacks what changes between them.",
        finding=_strongest(found),
    )
