"""Marginal posteriors: of each mode beside prior and profile likelihood, and of all modes together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes

from mofit._typing import FloatArray
from mofit.report.calibration import calibrated
from mofit.report.marginals import Marginal, draw_marginal, extract_marginal, parameter_axis, widest
from mofit.report.overlay import NINETY
from mofit.report.run import Mode, Run, labels, numbers
from mofit.report.toolkit.blocks import (
    Block,
    Column,
    Details,
    Figure,
    Section,
    Table,
    Text,
    parameter_column,
    tabs,
    unit_column,
)
from mofit.report.toolkit.figures import FLOOR, MEASURED, Panels, band_key, line_key
from mofit.report.toolkit.formatting import interval, parameter_label, percent, plus_minus, with_sd

PROFILE_RISE = 1.3528
"""Rise of the negative log posterior that bounds a 90 % profile interval: half the 90 % quantile of chi², 1 degree."""


@dataclass(frozen=True)
class Comparison:
    """The marginal of one parameter of one mode, and what it is compared with, in the parameter's unit.

    `laplace` is the interval by the curvature; `profile_value` and `profile_nll` are empty where the run holds no
    profile; `calibrated` is estimate and sd of a calibration stage alone, nan where there is none.
    """

    marginal: Marginal
    estimate: float
    draws: tuple[float, float]
    laplace: tuple[float, float]
    profile_value: FloatArray
    profile_nll: FloatArray
    profile: tuple[float, float]
    calibrated: tuple[float, float]


def extract_comparisons(run: Run, mode: Mode) -> list[Comparison]:
    """All parameters of a sampled mode."""
    profiles, stages = _profiles(mode), calibrated(run)
    found = []
    for k, name in enumerate(mode.parameters):
        value, nll = profiles.get(name, (np.empty(0), np.empty(0)))
        estimate, reach = float(mode.array("value")[k]), NINETY * float(mode.array("laplace_sd")[k])
        found.append(
            Comparison(
                marginal=extract_marginal(run.space([name]), {mode.name: mode.flat_draws[:, k]}, value),
                estimate=estimate,
                draws=(float(mode.array("q05")[k]), float(mode.array("q95")[k])),
                laplace=(estimate - reach, estimate + reach),
                profile_value=value,
                profile_nll=nll,
                profile=profile_interval(value, nll),
                calibrated=stages.get(name, (np.nan, np.nan)),
            )
        )
    return found


def _profiles(mode: Mode) -> dict[str, tuple[FloatArray, FloatArray]]:
    """Fixed values and negative log posterior by parameter, only where the profile is finite."""
    node = mode.node.children.get("profile")
    if node is None:
        return {}
    rows = zip(labels(node, "parameter"), numbers(node, "value"), numbers(node, "neg_log_posterior"), strict=True)
    return {name: (value[np.isfinite(nll)], nll[np.isfinite(nll)]) for name, value, nll in rows}


def profile_interval(value: FloatArray, nll: FloatArray) -> tuple[float, float]:
    """Where a profile rises by `PROFILE_RISE`, between grid points by the root of the rise, which is nearly straight.

    Infinite on a side where the grid ends before that; nan without a profile.
    """
    if value.size < 2:
        return np.nan, np.nan
    least = int(np.argmin(nll))
    root = np.sqrt(np.maximum(nll - nll[least], 0.0))
    low = _crossing(value[least::-1], root[least::-1], -np.inf)
    return low, _crossing(value[least:], root[least:], np.inf)


def _crossing(value: FloatArray, root: FloatArray, open_end: float) -> float:
    target = np.sqrt(PROFILE_RISE)
    above = np.flatnonzero(root >= target)
    if above.size == 0:
        return open_end
    k = int(above[0])
    share = (target - root[k - 1]) / (root[k] - root[k - 1])
    return float(value[k - 1] + share * (value[k] - value[k - 1]))


def draw_comparison(found: Comparison, mode: Mode, axes: Axes) -> Axes:
    """Histogram scaled to peak 1 with its 90 % interval darker, the prior on the same scale, profile, MAP estimate."""
    marginal = found.marginal
    draw_marginal(marginal, {mode.name: mode.colour}, axes)
    density, edges = marginal.density[mode.name], marginal.edges
    peak = max(float(density.max()), np.finfo(float).tiny)
    inside = (edges[1:] > found.draws[0]) & (edges[:-1] < found.draws[1])
    axes.stairs(np.where(inside, density / peak, 0.0), edges, fill=True, color=mode.colour, alpha=0.3, lw=0)
    axes.axhline(1 / peak, color=MEASURED, lw=1.0, ls=":")
    mean, sd = found.calibrated
    if sd > 0:
        x = np.linspace(edges[0], edges[-1], 200)
        axes.plot(x, np.exp(-0.5 * ((x - mean) / sd) ** 2), color=MEASURED, lw=1.0, ls="--")
    if found.profile_value.size:
        axes.plot(found.profile_value, np.exp(-found.profile_nll), color=FLOOR, marker="o", ms=3.2, zorder=3)
    axes.axvline(found.estimate, color=MEASURED, lw=0.9)
    axes.set_ylim(0, 1.12)
    return axes


def marginals_section(run: Run) -> Section | None:
    """Figure and table of intervals, per mode."""
    panes: dict[str, list[Block]] = {}
    data = {}
    for mode in run.sampled:
        data[mode.name] = found = extract_comparisons(run, mode)
        table = Details("Table of the 90 % intervals by draws, profile and curvature", [_table(run, found)])
        panes[mode.title] = [_figure(found, mode), table]
    return Section("marginals", "Each parameter alone", tabs(panes), {"modes": data}) if panes else None


def _figure(found: list[Comparison], mode: Mode) -> Figure:
    legend = [
        band_key(mode.colour, "draws, 90 % darker", 0.45),
        line_key(MEASURED, "MAP estimate", lw=0.9),
        line_key(MEASURED, "prior", lw=1.0, ls=":"),
    ]
    caption = (
        "Marginal posterior of each parameter, scaled to peak 1, and the prior on the same scale. The prior lies at "
        "the bottom where the data inform the parameter. Parameters searched by their logarithm have a logarithmic "
        "axis."
    )
    if any(one.profile_value.size for one in found):
        caption += " The profile is the best fit with the parameter fixed there and all others free."
        legend.append(line_key(FLOOR, "profile likelihood", marker="o", ms=3.2))
    if any(one.calibrated[1] > 0 for one in found):
        legend.append(line_key(MEASURED, "calibration stage alone", lw=1.0, ls="--"))
    panels = Panels(len(found), 4, 1.5, legend=legend, margin=(0.3, 0.4, 0.3), gap=(0.35, 0.65))
    for one, axes in zip(found, panels.axes, strict=True):
        draw_comparison(one, mode, axes)
        axes.set_title(parameter_label(one.marginal.parameter, one.marginal.unit))
    return panels.figure(
        f"Marginal posterior of each parameter of mode {mode.name}, with prior and profile likelihood",
        caption,
        good="a narrow peak around the MAP estimate; the profile runs along its outline.",
        bad="a peak no higher than the prior, truncated by a bound, or beside the MAP estimate or the profile: then "
        "the posterior is skewed, or a prior shifts it.",
        finding=widest([one.marginal for one in found]),
    )


def _table(run: Run, found: list[Comparison]) -> Table:
    names = [one.marginal.parameter for one in found]
    space = run.space(names)
    sds = [(one.draws[1] - one.draws[0]) / (2 * NINETY) for one in found]

    def texts(field: str) -> list[str]:
        return [
            "–" if np.isnan(getattr(one, field)[0]) else " … ".join(_end(end, sd, box) for end in getattr(one, field))
            for one, sd, *box in zip(found, sds, space.lower, space.upper, strict=True)
        ]

    return Table(
        [
            parameter_column(names),
            Column("MAP", [with_sd(one.estimate, sd) for one, sd in zip(found, sds, strict=True)]),
            Column("Draws", texts("draws")),
            Column("Profile", texts("profile")),
            Column("Curvature (Laplace)", texts("laplace")),
            unit_column(space.units),
        ],
        "90 % intervals. If all three agree, the posterior is close to Gaussian. An end with * is the bound.",
    )


def _end(value: float, sd: float, box: list[float]) -> str:
    """An end of an interval inside the prior box, with a mark where it is the bound."""
    end = min(max(value, box[0]), box[1])
    return with_sd(end, sd) + ("*" if end in box else "")


def mixture_section(run: Run) -> Section | None:
    """Table and figure; None where the run has one mode only."""
    node = run.group("mixture")
    if node is None:
        return None
    names = labels(node, "parameter")
    data = {name: numbers(node, name) for name in ("mean", "sd", "q05", "q50", "q95")}
    text = Text(
        "Until a test distinguishes the modes, each counts by its probability. An interval below may span a region "
        "between them that is not plausible: see the figure."
    )
    table = Table(
        [
            parameter_column(names),
            Column("Mean ± sd", [plus_minus(*row) for row in zip(data["mean"], data["sd"], strict=True)]),
            Column("90 % interval", [interval(*row) for row in zip(data["q05"], data["q95"], data["sd"], strict=True)]),
            unit_column(run.unit(name) for name in names),
        ],
        "All modes together.",
    )
    return Section(
        "mixture", "All modes together", [text, table, _stacked_figure(run, names)], {"parameter": names, **data}
    )


def _stacked_figure(run: Run, names: list[str]) -> Figure:
    node = run.tree["mixture"].children
    mode_of = numbers(node["sample_stats"], "mode").ravel().astype(int) - 1
    found = [mode for mode in run.modes if (mode_of == mode.index).any()]
    shares = {mode.name: float(np.mean(mode_of == mode.index)) for mode in found}
    legend = [band_key(mode.colour, mode.title, 1.0) for mode in run.modes]
    panels = Panels(len(names), 4, 1.5, legend=legend, margin=(0.3, 0.4, 0.3), gap=(0.35, 0.65))
    for name, axes in zip(names, panels.axes, strict=True):
        values = numbers(node["posterior"], name).ravel()
        marginal = extract_marginal(run.space([name]), {mode.name: values[mode_of == mode.index] for mode in found})
        _draw_stacked(marginal, shares, {mode.name: mode.colour for mode in found}, axes)
        axes.set_title(parameter_label(name, run.unit(name)))
    return panels.figure(
        "Posterior of each parameter, stacked by mode",
        "Posterior of each parameter, the modes stacked on each other by their probability.",
        good="one peak: the modes agree on this parameter.",
        bad="separate peaks in different colours: which value is right depends on the mode.",
        finding=", ".join(f"{mode.name} holds {percent(shares[mode.name])}" for mode in found) + " of the posterior.",
    )


def _draw_stacked(marginal: Marginal, shares: dict[str, float], colours: dict[str, str], axes: Axes) -> None:
    below = np.zeros(len(marginal.edges) - 1)
    for name, density in marginal.density.items():
        above = below + shares[name] * density
        axes.stairs(above, marginal.edges, baseline=below, fill=True, color=colours[name])
        below = above
    parameter_axis(marginal, axes)
