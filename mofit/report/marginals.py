"""Marginal posterior of each parameter: its density over the values, its interval inside the prior box."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.ticker import FixedLocator, LogLocator, MaxNLocator, NullLocator

from mofit._typing import FloatArray
from mofit.parameters import ParameterSpace
from mofit.report.run import Run
from mofit.report.toolkit.axes import few_ticks, without_ordinate
from mofit.report.toolkit.blocks import Figure
from mofit.report.toolkit.figures import Panels, band_key
from mofit.report.toolkit.formatting import compact, parameter_label, percent, symbol

_BINS = 48
_TAIL = 0.001
"""Share of the draws that may lie beyond either end of the axis."""


@dataclass(frozen=True)
class Marginal:
    """Posterior of one parameter in its SI unit, by mode.

    `density` over `edges` is relative to the prior's (uniform in the scale of the search); `interval` are the 5 and
    95 % quantiles, `place` is their place in the prior box (0 to 1).
    """

    parameter: str
    unit: str
    log: bool
    edges: FloatArray
    density: dict[str, FloatArray]
    interval: dict[str, tuple[float, float]]
    place: dict[str, tuple[float, float]]


def extract_marginal(
    space: ParameterSpace, draws: Mapping[str, FloatArray], reach: FloatArray | None = None
) -> Marginal:
    """Histograms over common bins, equally wide in the scale of the search.

    Parameters
    ----------
    space
        The parameter alone.
    draws
        Values by mode, shape (n,) each.
    reach
        Values that the axis must hold too.
    """
    (own,) = space.parameters
    places = {name: space.to_unit(values[:, None])[:, 0] for name, values in draws.items()}
    ends = [np.quantile(place, [_TAIL, 1 - _TAIL]) for place in places.values()]
    if reach is not None and reach.size:
        ends.append(space.to_unit(reach[[0, -1], None])[:, 0])
    low, high = float(np.min(ends)), float(np.max(ends))
    pad = 0.04 * (high - low) or 1e-3
    bins = np.linspace(max(low - pad, 0.0), min(high + pad, 1.0), _BINS + 1)

    def quantiles(values: FloatArray) -> tuple[float, float]:
        return float(np.quantile(values, 0.05)), float(np.quantile(values, 0.95))

    return Marginal(
        parameter=own.name,
        unit=own.unit,
        log=own.scale == "log",
        edges=space.from_unit(bins[:, None])[:, 0],
        density={k: np.histogram(place, bins)[0] / (place.size * (bins[1] - bins[0])) for k, place in places.items()},
        interval={name: quantiles(values) for name, values in draws.items()},
        place={name: quantiles(place) for name, place in places.items()},
    )


def extract_marginals(run: Run) -> list[Marginal]:
    """Of every parameter that was sampled, over the modes that get figures."""
    names = run.sampled[0].parameters if run.sampled else []
    return [
        extract_marginal(
            run.space([name]), {m.name: m.flat_draws[:, m.parameters.index(name)] for m in run.sampled}
        )
        for name in names
    ]  # fmt: skip


def draw_marginal(marginal: Marginal, colours: Mapping[str, str], axes: Axes) -> Axes:
    """A histogram per mode, each scaled to peak 1."""
    for name, density in reversed(marginal.density.items()):
        heights = density / max(float(density.max()), np.finfo(float).tiny)
        axes.stairs(heights, marginal.edges, color=colours[name], lw=1.3)
        axes.stairs(heights, marginal.edges, color=colours[name], fill=True, alpha=0.17, lw=0)
    axes.set_ylim(0, 1.05)
    parameter_axis(marginal, axes)
    return axes


def draw_place(marginal: Marginal, colours: Mapping[str, str], axes: Axes) -> Axes:
    """Above a panel, a strip that is the whole prior box, with the 5–95 % interval of each mode in it."""
    strip = axes.inset_axes((0.0, 1.05, 1.0, 0.05 + 0.035 * len(marginal.place)))
    strip.set(xlim=(0, 1), ylim=(-0.6, len(marginal.place) - 0.4), xticks=[], yticks=[], facecolor="#eef1f4")
    for spine in strip.spines.values():
        spine.set_visible(False)
    for k, (name, (low, high)) in enumerate(reversed(marginal.place.items())):
        middle, half = (low + high) / 2, max((high - low) / 2, 0.006)
        strip.barh(k, 2 * half, left=middle - half, height=0.8, color=colours[name])
    return strip


def parameter_axis(marginal: Marginal, axes: Axes) -> None:
    """Values of the parameter along the abscissa, in its scale, with few ticks; densities have no ordinate."""
    low, high = float(marginal.edges[0]), float(marginal.edges[-1])
    if marginal.log:
        axes.set_xscale("log")
        axes.xaxis.set_minor_locator(NullLocator())
        axes.xaxis.set_major_locator(_log_ticks(low, high))
    else:
        few_ticks(axes, 3, None)
    axes.xaxis.set_major_formatter(lambda value, _: compact(value))
    axes.set_xlim(low, high)
    without_ordinate(axes)


def _log_ticks(low: float, high: float) -> FixedLocator | LogLocator:
    """Powers of ten where there is room for two, else round numbers, which a short log axis spaces nearly evenly."""
    if high > 100 * low:
        return LogLocator(numticks=5)
    if high > 5 * low:
        return LogLocator(subs=(1, 2, 5), numticks=8)
    ticks = MaxNLocator(3, steps=(1, 2, 2.5, 5, 10)).tick_values(low, high)
    return FixedLocator([float(tick) for tick in ticks if low <= tick <= high])


def widest(marginals: list[Marginal]) -> Markup:
    """The parameter of which the 90 % interval fills most of the prior box."""
    shares = [high - low for low, high in (next(iter(marginal.place.values())) for marginal in marginals)]
    k = int(np.argmax(shares))
    return Markup("The widest is {}: its 90 % interval fills {} of the prior box.").format(
        symbol(marginals[k].parameter), percent(shares[k])
    )


def marginals_figure(run: Run, marginals: list[Marginal]) -> Figure:
    """A panel per parameter with its strip."""
    colours = {mode.name: mode.colour for mode in run.shown}
    legend = [band_key(colours[name], f"mode {name}", 0.7) for name in marginals[0].density]
    panels = Panels(len(marginals), 4, 1.5, legend=legend, margin=(0.3, 0.4, 0.3), gap=(0.35, 1.05), top=1.05)
    for marginal, axes in zip(marginals, panels.axes, strict=True):
        draw_marginal(marginal, colours, axes)
        draw_place(marginal, colours, axes)
        axes.set_title(parameter_label(marginal.parameter, marginal.unit), pad=10 + 6 * len(marginal.density))
    return panels.figure(
        "Marginal posterior of each parameter",
        "Marginal posterior of each parameter, scaled to equal height (the tables give the probability of each mode). "
        "The strip above each panel is the whole prior box, with the 5–95 % interval in it.",
        good="narrow peaks that cover a small part of the strip.",
        bad="a flat shape over the whole strip (the data do not identify the parameter), or a peak that a bound "
        "truncates.",
        finding=widest(marginals),
    )
