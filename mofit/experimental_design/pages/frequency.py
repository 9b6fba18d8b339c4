"""Information over frequency, and where the loss of a Maxwell branch peaks."""

from __future__ import annotations

import numpy as np
from markupsafe import Markup
from matplotlib.ticker import LogLocator

from mofit._typing import FloatArray
from mofit.experimental_design.comparison_result import Comparison
from mofit.experimental_design.criteria import scales
from mofit.experimental_design.identifiability import BOX_PRECISION
from mofit.experimental_design.information import SourceInformation
from mofit.models import MaxwellBranch
from mofit.report.toolkit.blocks import Block, Figure, Section, Text, tabs
from mofit.report.toolkit.figures import BASELINE, FLOOR, Panels, dot_key, line_key, mode_colour
from mofit.report.toolkit.formatting import listed, math_symbol, number, symbol

#: Frequencies of tests that do not repeat are gathered in so many classes per decade, others by harmonics.
_CLASSES = 24
#: Classes with less than this share of the largest are not drawn.
_LEAST = 1e-4
#: The branch is drawn so far beyond the tests and the peak.
_BEYOND = 4.0


def frequency_section(comparison: Comparison) -> Section | None:
    """Per source: information on every parameter over frequency."""
    panes: dict[str, list[Block]] = {
        known.source.name: [_information_figure(known, comparison.parameters)]
        for known in comparison.sources
        if known.tests.main and np.isfinite(known.tests.fisher[:, 0]).all()
    }
    return Section("frequency", "Information over frequency", tabs(panes)) if panes else None


def information_over_frequency(known: SourceInformation, name: str) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Frequencies [Hz], and information per second on a relative change of a parameter there [1/s], over all tests.

    The first has all other parameters known, the second has them estimated along from all tests together: without
    what they can explain.
    """
    source = known.source
    place = source.space.index(name)
    total = known.fisher([test.name for test in source.main])[0] + BOX_PRECISION * np.eye(len(source.space))
    column = np.linalg.inv(total)[:, place] * known.derivative[0]
    size = scales(source.space, known.samples[:1])[0, place]
    found = []
    for test, own in zip(source.main, known.tests.main, strict=True):
        for output in range(len(own.jacobians)):
            frequency, lines = own.spectrum(output)
            fundamental = test.experiment.frequency
            classes = (
                np.round(frequency / fundamental)
                if fundamental
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


def _information_figure(known: SourceInformation, names: tuple[str, ...]) -> Figure:
    panels = Panels(
        len(names), 3, 2.4,
        legend=[
            dot_key(mode_colour(0), "other parameters known", hollow=True),
            dot_key(mode_colour(1), "other parameters estimated along, from all tests"),
        ],
    )  # fmt: skip
    for axes, name in zip(panels.axes, names, strict=True):
        frequency, alone, along = information_over_frequency(known, name)
        axes.set_title(math_symbol(name))
        seen = (alone > _LEAST * alone.max()) & (frequency > 0)
        if not seen.any():
            axes.text(0.5, 0.5, "only in the mean", ha="center", transform=axes.transAxes)
            axes.set(xticks=[], yticks=[])
            continue
        axes.loglog(frequency[seen], alone[seen], "o", ms=5, mfc="none", color=mode_colour(0))
        axes.loglog(frequency[seen], np.maximum(along[seen], 1e-300), "o", ms=5, color=mode_colour(1))
        top = 3 * alone[seen].max()
        axes.set(ylim=(_LEAST * top, top))
        axes.yaxis.set_major_locator(LogLocator(numticks=7))
    panels.label("frequency (Hz)", "information per second (1/s)")
    return panels.figure(
        "information on every parameter over frequency",
        "Fisher information on a relative change of each parameter that the tests give per second, over frequency: "
        "1/s is a standard deviation of 100 % after a second, 10 000 1/s is 1 %. Sines show at their fundamental and "
        "its harmonics.",
        good="filled circles close below the open ones: nothing else explains the same change.",
        bad="filled circles far below the open ones: other parameters compensate for most of it.",
        finding=_peaks(known, names),
    )


def _peaks(known: SourceInformation, names: tuple[str, ...]) -> Markup:
    """The frequency at which the tests inform most about each parameter."""
    parts = []
    for name in names:
        frequency, alone, _ = information_over_frequency(known, name)
        parts.append(Markup("{} at {} Hz").format(symbol(name), number(float(frequency[np.argmax(alone)]))))
    return Markup("Most information comes on {}.").format(listed(parts))


def loss_peak(stiffness: float, damping: float) -> float:
    r"""Frequency [Hz] of a Maxwell branch's largest loss, :math:`c / (2 \pi d)`."""
    return stiffness / (2 * np.pi * damping)


def branch_section(comparison: Comparison) -> Section | None:
    """Stiffness and loss factor of the Maxwell branches that the models declare, beside the tests."""
    panes: dict[str, list[Block]] = {}
    for known in comparison.sources:
        for branch in known.source.model.branches:
            if {branch.stiffness, branch.damping} <= set(known.source.space.names) and known.source.main:
                panes[known.source.name] = _branch(known, branch)
    return Section("branch", "The Maxwell branch", tabs(panes)) if panes else None


def _branch(known: SourceInformation, branch: MaxwellBranch) -> list[Block]:
    space = known.source.space
    stiffness, damping = (known.samples[:, space.index(name)] for name in (branch.stiffness, branch.damping))
    peak = loss_peak(stiffness[0], damping[0])
    tests = [test.experiment.frequency for test in known.source.main if test.experiment.frequency] or [peak]
    frequency = np.geomspace(min(*tests, peak) / _BEYOND, max(*tests, peak) * _BEYOND, 200)
    total = _loss_factor(known, frequency, branch)
    storage_colour, loss_colour, total_colour = map(mode_colour, range(3))
    keys = [
        line_key(storage_colour, "storage"),
        line_key(loss_colour, "loss (left); loss factor of the branch (right)"),
        line_key(FLOOR, f"peak of the loss, {peak:.3g} Hz"),
        line_key(BASELINE, "tests", ls=":"),
    ]
    if total is not None:
        keys.insert(2, line_key(total_colour, f"loss factor of the whole {branch.part}"))
    panels = Panels(2, 2, 2.6, legend=keys)
    left, right = panels.axes
    for k in range(len(stiffness))[::-1]:  # the reference values last, on top
        c, wt = stiffness[k] / 1e3, 2 * np.pi * frequency * damping[k] / stiffness[k]
        width, alpha = (0.5, 0.35) if k else (1.8, 1.0)
        left.semilogx(frequency, c * wt**2 / (1 + wt**2), color=storage_colour, lw=width, alpha=alpha)
        left.semilogx(frequency, c * wt / (1 + wt**2), color=loss_colour, lw=width, alpha=alpha)
    right.loglog(frequency, 1 / (2 * np.pi * frequency * damping[0] / stiffness[0]), color=loss_colour)
    if total is not None:
        right.loglog(frequency, total, color=total_colour)
    for axes in panels.axes:
        axes.axvline(peak, color=FLOOR, lw=1.0)
        for own in tests:
            axes.axvline(own, color=BASELINE, lw=0.6, ls=":")
    left.set_title("stiffness of the branch (kN/m)")
    right.set_title("loss factor")
    panels.label("frequency (Hz)")
    parallel = branch.parallel[1]
    text = (
        f"The branch has the time constant T = {branch.damping}/{branch.stiffness} = "
        f"{number(damping[0] / stiffness[0])} s; its loss peaks at 1/(2πT) = {number(peak)} Hz. Well above the peak "
        f"the branch acts as a spring, and the force hardly depends on {branch.damping}: what remains is a loss that "
        f"falls with frequency, similar to that of {parallel}. Well below the peak it acts as a damper, and the force "
        f"hardly depends on {branch.stiffness}."
    )
    figure = panels.figure(
        "stiffness and loss factor of the Maxwell branch over frequency",
        "Storage and loss stiffness of the branch (thin: at the other parameter samples), and loss factors, the ratio "
        "of the two. Dotted: frequencies of the tests.",
        good="tests on both sides of the peak.",
        bad=f"all tests far above it: {branch.damping} is correlated with {parallel}; all far below it: "
        f"{branch.stiffness} is hardly identifiable.",
        finding=f"The loss peaks at {number(peak)} Hz; {sum(t > peak for t in tests)} of {len(tests)} tests lie above.",
    )
    return [Text(text), figure]


def _loss_factor(known: SourceInformation, frequency: FloatArray, branch: MaxwellBranch) -> FloatArray | None:
    """Of spring, damper and branch in parallel, where all of them are identified."""
    space = known.source.space
    names = (*branch.parallel, branch.stiffness, branch.damping)
    if not set(names) <= set(space.names):
        return None
    c_p, d_p, c, d = (known.samples[0, space.index(name)] for name in names)
    omega = 2 * np.pi * frequency
    wt = omega * d / c
    return np.asarray((omega * d_p + c * wt / (1 + wt**2)) / (c_p + c * wt**2 / (1 + wt**2)))
