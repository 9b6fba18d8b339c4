"""Axes as all figures have them: few round ticks, plain numbers on logarithmic axes, tests by name or frequency."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.image import AxesImage
from matplotlib.ticker import FixedLocator, LogLocator, MaxNLocator, NullLocator

from mofit._typing import FloatArray
from mofit.report.toolkit.description import keyed, test_of
from mofit.report.toolkit.figures import WIDTH

_STEPS = (1, 2, 2.5, 5, 10)
_CROWDED = 5.8
"""Letters of all names per inch of axis from which they are turned."""
_APART = 0.33
"""Inches between ticks that can both be read."""


def few_ticks(axes: Axes, x: int | None = 5, y: int | None = 4) -> None:
    """At most this many intervals between the ticks of each linear axis (None leaves it as it is)."""
    if x is not None:
        axes.xaxis.set_major_locator(MaxNLocator(x, steps=_STEPS))
    if y is not None:
        axes.yaxis.set_major_locator(MaxNLocator(y, steps=_STEPS))


def log_axis(axes: Axes, which: Literal["x", "y"], ticks: Sequence[float] | None = None) -> None:
    """A logarithmic axis with plain numbers at these ticks (1, 2 and 5 of every decade by default) and none between."""
    axis = axes.xaxis if which == "x" else axes.yaxis
    axes.set(**{f"{which}scale": "log"})
    axis.set_major_locator(LogLocator(subs=(1, 2, 5)) if ticks is None else FixedLocator(list(ticks)))
    axis.set_minor_locator(NullLocator())
    axis.set_major_formatter(lambda value, _: f"{value:g}")


def log_if_wide(axes: Axes, values: FloatArray, ratio: float = 12.0) -> bool:
    """A logarithmic ordinate where positive values differ by more than `ratio`, else one from zero; which it is."""
    some = values[np.isfinite(values) & (values > 0)]
    if some.size and some.max() > ratio * some.min():
        log_axis(axes, "y")
        axes.set_ylim(0.5 * some.min(), 1.5 * some.max())
        return True
    axes.set_ylim(bottom=0)
    few_ticks(axes, None, 5)
    return False


def all_differ(frequency: FloatArray) -> bool:
    """Whether several tests can be drawn over their frequency: each has one of its own."""
    return bool(np.isfinite(frequency).all() and len(set(frequency.tolist())) == frequency.size > 1)


def axis_of_frequencies(axes: Axes, frequency: FloatArray) -> None:
    """A logarithmic abscissa with a tick at each frequency (Hz), as far as they stand apart."""
    width = axes.get_position().width * WIDTH
    room = (np.log(frequency.max()) - np.log(frequency.min())) * _APART / width
    kept: list[float] = []
    for value in sorted(set(frequency.tolist())):
        if not kept or np.log(value / kept[-1]) >= room:
            kept.append(value)
    log_axis(axes, "x", kept)


def axis_of_tests(axes: Axes, tests: Sequence[str]) -> FloatArray:
    """A place for each test by its name, turned where they would touch; the places."""
    x = np.arange(len(tests), dtype=float)
    keyed(axes.xaxis, test=[test_of(name) for name in tests])
    crowded = len(tests) * max(map(len, tests), default=0) > _CROWDED * axes.get_position().width * WIDTH
    axes.set_xticks(x, list(tests), rotation=35 if crowded else 0, ha="right" if crowded else "center")
    axes.set_xlim(-0.6, len(tests) - 0.4)
    axes.grid(visible=False, axis="x")
    return x


def without_ordinate(axes: Axes) -> None:
    """For densities, of which only the shape counts."""
    axes.set_yticks([])
    axes.spines["left"].set_visible(False)


def heat_map(
    axes: Axes, values: FloatArray, rows: Sequence[str], columns: Sequence[str], *, turned: bool = False, **style: Any
) -> AxesImage:
    """A coloured cell per row and column, shape (row, column); `style` goes to ``imshow``."""
    image = axes.imshow(values, aspect="auto", **style)
    axes.set_xticks(range(len(columns)), list(columns), rotation=90 if turned else 0)
    axes.set_yticks(range(len(rows)), list(rows))
    axes.grid(visible=False)
    axes.tick_params(length=0)
    return image
