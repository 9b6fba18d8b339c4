"""Sensitivity over frequency: where in the spectrum of the tests a parameter can be seen."""

from __future__ import annotations

import numpy as np
from matplotlib.ticker import LogLocator
from numpy.typing import NDArray

from mofit.identifiability.comparison import Comparison
from mofit.identifiability.criteria import scales
from mofit.identifiability.telling import Told
from mofit.identifiability.verdicts import BOX_PRECISION
from mofit.report.display import math_symbol
from mofit.report.page import Block, Figure, Section, tabs
from mofit.report.style import CLUSTER_COLOURS, image_of, legend_above, line_key, panels

Array = NDArray[np.float64]

#: Frequencies of tests that do not repeat are gathered in so many classes per decade, others by harmonics.
_CLASSES = 24
#: Classes with less than this share of the most are not drawn.
_LEAST = 1e-4


def frequency_section(comparison: Comparison) -> Section | None:
    """Per source: information on every parameter over frequency."""
    panes: dict[str, list[Block]] = {}
    for told in comparison.told:
        if told.shown and np.isfinite(told.information[:, 0]).all():
            panes[told.source.name] = [_figure(told, comparison.parameters)]
    return Section("frequency", "Sensitivity over frequency", tabs(panes)) if panes else None


def information_over_frequency(told: Told, name: str) -> tuple[Array, Array, Array]:
    """Frequencies [Hz], and information per second on a relative change of a parameter there [1/s], over all tests.

    The first with all other parameters known, the second with them estimated along, from all tests together: what they
    can explain is taken out.
    """
    source = told.source
    place = source.space.index(name)
    tests = [test.name for test in source.main]
    total = told.bound(tests)[0] + BOX_PRECISION * np.eye(len(source.space))
    column = np.linalg.inv(total)[:, place] * told.stretch[0]
    size = scales(source.space, told.values[:1])[0, place]
    found = []
    for test, own in zip(source.main, told.shown, strict=True):
        for output in range(len(own.slopes)):
            frequency, lines = own.lines(output)
            repeats = test.procedure.frequency
            classes = (
                np.round(frequency / repeats)
                if repeats
                else np.round(_CLASSES * np.log10(np.maximum(frequency, frequency[1] / 2)))
            )
            for each in np.unique(classes):
                chosen = classes == each
                alone = np.sum(np.abs(lines[chosen, place]) ** 2) * size**2 / test.seconds
                along = np.sum(np.abs(lines[chosen] @ (column / column[place])) ** 2) * size**2 / test.seconds
                weights = np.abs(lines[chosen, place]) ** 2 + np.finfo(float).tiny
                found.append((np.average(frequency[chosen], weights=weights), alone, along))
    frequencies, alone, along = np.array(found).T
    return frequencies, alone, along


def _figure(told: Told, names: tuple[str, ...]) -> Figure:
    canvas, axes, _ = panels(len(names), 3, 2.4, margin=(0.65, 0.5, 0.1, 0.75))
    for each, name in zip(axes, names, strict=True):
        frequency, alone, along = information_over_frequency(told, name)
        each.set_title(math_symbol(name))
        seen = (alone > _LEAST * alone.max()) & (frequency > 0)
        if not seen.any():
            each.text(0.5, 0.5, "only in the mean", ha="center", transform=each.transAxes)
            each.set(xticks=[], yticks=[])
            continue
        each.loglog(frequency[seen], alone[seen], "o", ms=5, mfc="none", color=CLUSTER_COLOURS[0])
        each.loglog(frequency[seen], np.maximum(along[seen], 1e-300), "o", ms=5, color=CLUSTER_COLOURS[1])
        top = 3 * alone[seen].max()
        each.set(xlabel="frequency (Hz)", ylim=(_LEAST * top, top))
        each.yaxis.set_major_locator(LogLocator(numticks=7))
    axes[0].set_ylabel("information per second (1/s)")
    marks = {"ls": "", "marker": "o", "ms": 5}
    legend_above(canvas, [
        line_key(CLUSTER_COLOURS[0], "other parameters known", mfc="none", **marks),
        line_key(CLUSTER_COLOURS[1], "other parameters estimated along, from all tests", **marks),
    ])  # fmt: skip
    return Figure(
        image_of(canvas),
        "information on every parameter over frequency",
        "Fisher information on a relative change of each parameter that the tests give per second, over frequency: "
        "1/s stands for a standard deviation of 100 % after a second, 10 000 1/s for 1 %. Sines show at their "
        "fundamental and its harmonics.",
        good="filled circles close below the open ones: nothing else explains the same change.",
        bad="filled circles far below the open ones: other parameters make up for most of it.",
    )
