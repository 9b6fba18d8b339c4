"""Convergence of the sampling: autocorrelation, effective samples, R-hat, acceptance, traces."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes

from mofit._typing import FloatArray
from mofit.report.run import Mode, Run, numbers
from mofit.report.toolkit.axes import few_ticks
from mofit.report.toolkit.blocks import Block, Column, Figure, Section, Table, Text, badge, parameter_column, tabs
from mofit.report.toolkit.figures import Panels, line_key, mode_colour
from mofit.report.toolkit.formatting import count, math_symbol, number, symbol, whole_percent

R_HAT_LIMIT = 1.01
ESS_LIMIT = 1000.0
LENGTH_LIMIT = 100.0
"""The stop rule: R-hat below 1.01, 1,000 effective samples, 100 autocorrelation times."""

_TRACE_POINTS = 120


@dataclass(frozen=True)
class Traces:
    """Median and 5–95 % range of each ensemble over the steps, shape (chain, bin, parameter), SI units."""

    parameters: list[str]
    step: FloatArray
    low: FloatArray
    middle: FloatArray
    high: FloatArray


def extract_traces(mode: Mode) -> Traces:
    """Quantiles over the walkers of each ensemble in up to 120 bins of steps."""
    steps = numbers(mode.node.children["sample_stats"], "step")
    kept = np.unique(steps)
    groups = np.array_split(kept, min(_TRACE_POINTS, kept.size))
    edges = np.array([*(group[0] for group in groups), kept[-1] + 1])
    order = np.argsort(steps, axis=1, kind="stable")
    quantiles = np.full((3, len(steps), len(groups), len(mode.parameters)), np.nan)
    for chain in range(len(steps)):
        draws = mode.draws[chain][order[chain]]
        cuts = np.searchsorted(steps[chain][order[chain]], edges)
        for k in range(len(groups)):
            part = np.sort(draws[cuts[k] : cuts[k + 1]], axis=0)
            if len(part):
                quantiles[:, chain, k] = part[np.round(np.array([0.05, 0.5, 0.95]) * (len(part) - 1)).astype(int)]
    return Traces(mode.parameters, np.array([group.mean() for group in groups]), *quantiles)


def draw_trace(traces: Traces, k: int, axes: Axes) -> Axes:
    """Median of every ensemble over the steps as a line, its 5–95 % range as thin lines."""
    for chain in range(traces.middle.shape[0]):
        colour = mode_colour(chain)
        axes.plot(traces.step, traces.middle[chain, :, k], color=colour, lw=1.3)
        for edge in (traces.low, traces.high):
            axes.plot(traces.step, edge[chain, :, k], color=colour, lw=0.6, alpha=0.7)
    axes.set_title(math_symbol(traces.parameters[k]))
    few_ticks(axes)
    return axes


def convergence_section(run: Run) -> Section | None:
    """Table and traces per mode."""
    panes: dict[str, list[Block]] = {}
    data = {}
    for mode in run.sampled:
        found = {name: mode.array(name) for name in ("tau", "ess", "r_hat")}
        acceptance = np.atleast_1d(mode.node.children["sample_stats"].attrs.get("acceptance", np.nan)).astype(float)
        traces = extract_traces(mode)
        data[mode.name] = {"parameters": mode.parameters, **found, "acceptance": acceptance, "traces": traces}
        panes[mode.title] = [_table(mode, acceptance, **found), _figure(traces, mode)]
    if not panes:
        return None
    text = (
        f"A chain is an independent ensemble of walkers with its own start. Required: R-hat below {R_HAT_LIMIT}, "
        f"at least {count(ESS_LIMIT)} effective samples, chains longer than {count(LENGTH_LIMIT)} autocorrelation "
        "times τ, and an acceptance between about 20 and 60 %."
    )
    return Section("convergence", "Convergence", [Text(text), *tabs(panes)], {"modes": data})


def _table(mode: Mode, acceptance: FloatArray, tau: FloatArray, ess: FloatArray, r_hat: FloatArray) -> Table:
    steps = numbers(mode.node.children["sample_stats"], "step")
    length = float(steps.max() - steps.min() + 1)
    lengths = length / np.where(tau > 0, tau, np.nan)
    chains, draws, _ = mode.draws.shape
    rates = ", ".join(whole_percent(rate) for rate in acceptance)
    return Table(
        [
            parameter_column(mode.parameters),
            Column("τ (steps)", [number(value) for value in tau]),
            Column("Length / τ", [number(value) for value in lengths]),
            Column("Effective samples", [count(value) if np.isfinite(value) else "–" for value in ess]),
            Column("R-hat", [f"{value:.3f}" for value in r_hat]),
            Column("Verdict", [_verdict(*row) for row in zip(lengths, ess, r_hat, strict=True)]),
        ],
        f"{chains} ensembles, {count(draws)} draws each from {count(length)} steps; acceptance {rates}.",
    )


def _verdict(length: float, ess: float, r_hat: float) -> Markup:
    if not (r_hat < R_HAT_LIMIT and ess >= ESS_LIMIT):
        return badge("not converged", "bad")
    return badge("short chains", "fair") if length < LENGTH_LIMIT else badge("good", "good")


def _least_alike(traces: Traces, mode: Mode) -> Markup:
    """The parameter of the largest R-hat."""
    r_hat = mode.array("r_hat")
    if not np.isfinite(r_hat).any():
        return Markup("")
    k = int(np.nanargmax(r_hat))
    return Markup("The ensembles agree least about {}: R-hat {}.").format(
        symbol(traces.parameters[k]), number(float(r_hat[k]), 4)
    )


def _figure(traces: Traces, mode: Mode) -> Figure:
    legend: list[Any] = [line_key(mode_colour(k), f"ensemble {k + 1}") for k in range(traces.middle.shape[0])]
    panels = Panels(len(traces.parameters), 3, 1.5, legend=legend, gap=(0.75, 0.6))
    for k, axes in enumerate(panels.axes):
        draw_trace(traces, k, axes)
    panels.label("step")
    return panels.figure(
        f"Traces of the ensembles of mode {mode.name}",
        "Median (thick) and 5–95 % range (thin) of the walkers of each ensemble over the steps that were kept.",
        good="all ensembles overlap and run level from start to end.",
        bad="a colour that runs apart, drifts or jumps: the ensembles do not sample the same distribution yet.",
        finding=_least_alike(traces, mode),
    )
