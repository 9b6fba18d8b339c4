"""Profile likelihoods of the parameters in doubt."""

from __future__ import annotations

import numpy as np

from mofit.identifiability.comparison import Comparison, Entry
from mofit.identifiability.confirm import RISE
from mofit.identifiability.verdicts import IDENTIFIABLE
from mofit.report.display import math_symbol
from mofit.report.page import Figure, Section
from mofit.report.style import CLUSTER_COLOURS, FLOOR, MEASURED, image_of, panels

#: Most profiles that are drawn.
_DRAWN = 16
#: Drawn up to so many times the rise that bounds the interval.
_HEIGHT = 3.0


def profile_section(comparison: Comparison) -> Section | None:
    """A panel per parameter and procedure whose verdict is not plain."""
    doubtful = [
        (row.procedure.name, row.procedure.source, entry)
        for row in comparison.judged
        for entry in row.entries.values()
        if entry.limits is not None and entry.verdict != IDENTIFIABLE
    ][:_DRAWN]
    if not doubtful:
        return None
    canvas, axes, _ = panels(len(doubtful), 4, 1.8)
    for each, (name, source, entry) in zip(axes, doubtful, strict=True):
        value, rise, truth = _curve(comparison, source, entry)
        each.plot(value, rise, "-o", ms=3, color=CLUSTER_COLOURS[0])
        each.axhline(RISE, color=FLOOR, lw=1.0)
        each.axvline(truth, color=MEASURED, lw=0.8, ls=":")
        own = comparison.told[source].source.space[entry.parameter]
        each.set(ylim=(0, _HEIGHT * RISE), xlim=(own.lower, own.upper))
        if own.scale == "log":
            each.set_xscale("log")
        each.set_title(f"{math_symbol(entry.parameter)}, {name}")
        each.set_xlabel(own.unit)
    figure = Figure(
        image_of(canvas),
        "profile likelihoods",
        "Rise of the negative log likelihood (nats) of the data that are expected, without noise in them but with its "
        "width, with one parameter held over its whole box and all others refitted. Where the line is passed, a value "
        "is ruled out (95 %). Dotted: the value that the data were simulated with.",
        good="passes the line on both sides, close to the value.",
        bad="stays below it up to a bound: no limit on that side.",
    )
    return Section("profiles", "Profiles of the parameters in doubt", [figure])


def _curve(comparison: Comparison, source: int, entry: Entry) -> tuple[np.ndarray, np.ndarray, float]:
    assert entry.limits is not None
    told = comparison.told[source]
    place = told.source.space.index(entry.parameter)
    unit = np.repeat(told.unit[:1], len(entry.limits.grid), axis=0)
    unit[:, place] = entry.limits.grid
    return told.source.space.from_unit(unit)[:, place], entry.limits.rise, float(told.values[0, place])
