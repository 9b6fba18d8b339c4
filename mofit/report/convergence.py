"""Whether the numbers can be trusted: autocorrelation, effective samples, R-hat, acceptance, traces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes

from mofit.report.display import THIN, badge, count, math_symbol, number, symbol
from mofit.report.page import Block, Figure, Section, Table, Text, tabs
from mofit.report.run import Array, Cluster, Run, numbers, tab_title
from mofit.report.style import cluster_colour, few_ticks, image_of, legend_above, line_key, panels

R_HAT_LIMIT = 1.01
ESS_LIMIT = 1000.0
LENGTH_LIMIT = 100.0
"""The stop rule: R-hat below 1.01, 1,000 effective samples, 100 autocorrelation times."""

_TRACE_POINTS = 120


@dataclass(frozen=True)
class Traces:
    """Median and 5–95 % range of each ensemble over the steps, shape (chain, bin, parameter), SI units."""

    parameters: list[str]
    step: Array
    low: Array
    middle: Array
    high: Array


def extract_traces(cluster: Cluster) -> Traces | None:
    """Quantiles over the walkers of each ensemble in up to 120 bins of steps; None where nothing was sampled."""
    if cluster.draws is None:
        return None
    steps = numbers(cluster.node.children["sample_stats"], "step")
    kept = np.unique(steps)
    groups = np.array_split(kept, min(_TRACE_POINTS, kept.size))
    edges = np.array([*(group[0] for group in groups), kept[-1] + 1])
    order = np.argsort(steps, axis=1, kind="stable")
    chains, bins, d = len(steps), len(groups), cluster.draws.shape[-1]
    quantiles = np.full((3, chains, bins, d), np.nan)
    for chain in range(chains):
        draws = cluster.draws[chain][order[chain]]
        cuts = np.searchsorted(steps[chain][order[chain]], edges)
        for k in range(bins):
            part = np.sort(draws[cuts[k] : cuts[k + 1]], axis=0)
            if len(part):
                quantiles[:, chain, k] = part[np.round(np.array([0.05, 0.5, 0.95]) * (len(part) - 1)).astype(int)]
    return Traces(cluster.parameters, np.array([group.mean() for group in groups]), *quantiles)


def draw_trace(traces: Traces, k: int, axes: Axes) -> Axes:
    """Median of every ensemble over the steps as a line, its 5–95 % range as thin lines."""
    for chain in range(traces.middle.shape[0]):
        colour = cluster_colour(chain)
        axes.plot(traces.step, traces.middle[chain, :, k], color=colour, lw=1.3)
        axes.plot(traces.step, traces.low[chain, :, k], color=colour, lw=0.6, alpha=0.7)
        axes.plot(traces.step, traces.high[chain, :, k], color=colour, lw=0.6, alpha=0.7)
    axes.set_title(math_symbol(traces.parameters[k]))
    few_ticks(axes)
    return axes


def convergence_section(run: Run) -> Section | None:
    """Table and traces per cluster."""
    panes: dict[str, list[Block]] = {}
    data = {}
    for cluster in run.shown:
        traces = extract_traces(cluster)
        if traces is None:
            continue
        table = {name: cluster.array(name) for name in ("tau", "ess", "r_hat")}
        acceptance = np.atleast_1d(cluster.node.children["sample_stats"].attrs.get("acceptance", np.nan)).astype(float)
        data[cluster.name] = {"parameters": cluster.parameters, **table, "acceptance": acceptance, "traces": traces}
        panes[tab_title(cluster)] = [_table(cluster, table, traces, acceptance), _figure(traces, cluster)]
    if not panes:
        return None
    blocks: list[Block] = [
        Text(
            f"A chain is an independent ensemble of walkers, started anew. Wanted: R-hat below {R_HAT_LIMIT}, at "
            f"least "
            f"{ESS_LIMIT:.0f} effective samples, chains longer than {LENGTH_LIMIT:.0f} autocorrelation times τ, "
            f"and an acceptance "
            "between about 20 and 60 %."
        ),
        *tabs(panes),
    ]
    return Section("convergence", "Convergence", blocks, {"clusters": data})


def _table(cluster: Cluster, table: dict[str, Array], traces: Traces, acceptance: Array) -> Table:
    assert cluster.draws is not None
    steps = numbers(cluster.node.children["sample_stats"], "step")
    length = float(steps.max() - steps.min() + 1)
    rows = []
    for k, name in enumerate(traces.parameters):
        tau, ess, r_hat = table["tau"][k], table["ess"][k], table["r_hat"][k]
        lengths = length / tau if tau > 0 else np.nan
        verdict = badge("good", "good") if not lengths < LENGTH_LIMIT else badge("short chains", "fair")
        if not (r_hat < R_HAT_LIMIT and ess >= ESS_LIMIT):
            verdict = badge("not converged", "bad")
        rows.append(
            [
                symbol(name),
                number(tau),
                number(lengths),
                count(ess) if np.isfinite(ess) else "–",
                f"{r_hat:.3f}",
                verdict,
            ]
        )
    rates = ", ".join(f"{100 * rate:.0f}{THIN}%" for rate in acceptance)
    chains, draws, _ = cluster.draws.shape
    caption = f"{chains} ensembles, {count(draws)} draws each from {count(length)} steps; acceptance {rates}."
    return Table(["Parameter", "τ (steps)", "Length / τ", "Effective samples", "R-hat", "Verdict"], rows, caption)


def _figure(traces: Traces, cluster: Cluster) -> Figure:
    count_ = len(traces.parameters)
    canvas, axes, _ = panels(count_, 3, 1.5, margin=(0.75, 0.5, 0.15, 0.65), gap=(0.75, 0.6))
    for k, panel in enumerate(axes):
        draw_trace(traces, k, panel)
        if k >= count_ - 3:
            panel.set_xlabel("step")
    legend_above(canvas, [line_key(cluster_colour(k), f"ensemble {k + 1}") for k in range(traces.middle.shape[0])])
    return Figure(
        image_of(canvas),
        f"Traces of the ensembles of solution {cluster.name}",
        "Median (thick) and 5–95 % range (thin) of the walkers of each ensemble over the steps that were kept.",
        good="all ensembles lie on top of each other and run level from start to end.",
        bad="a colour that runs apart, drifts or jumps: the ensembles have not found the same distribution yet.",
    )
