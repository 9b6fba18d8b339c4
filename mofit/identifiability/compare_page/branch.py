"""Stiffness and loss factor of a Maxwell branch over frequency, beside the tests."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mofit.identifiability.comparison import Comparison
from mofit.identifiability.telling import Told
from mofit.model import build_system
from mofit.report.display import number
from mofit.report.page import Block, Figure, Section, Text, tabs
from mofit.report.style import BASELINE, CLUSTER_COLOURS, FLOOR, image_of, legend_above, line_key, panels

Array = NDArray[np.float64]

#: What a model must name for the branch to be recognised, and its parameters.
QUANTITY, PARAMETERS = "maxwell_force", ("c_M", "d_M")
#: Frequencies are drawn so far beyond the tests and the peak.
_BEYOND = 4.0


def loss_peak(stiffness: float, damping: float) -> float:
    r"""Frequency [Hz] of a Maxwell branch's largest loss, :math:`1 / (2 \pi T_M)` with :math:`T_M = d_M / c_M`."""
    return stiffness / (2 * np.pi * damping)


def branch_section(comparison: Comparison) -> Section | None:
    """Per source whose model has a Maxwell branch."""
    panes: dict[str, list[Block]] = {}
    for number_of, told in enumerate(comparison.told):
        model = told.source.model
        have = set(told.source.space.names)
        if QUANTITY in build_system(model).quantities and have >= set(PARAMETERS) and told.source.main:
            panes[told.source.name] = _blocks(comparison, told, number_of)
    return Section("branch", "The Maxwell branch", tabs(panes)) if panes else None


def _blocks(comparison: Comparison, told: Told, source: int) -> list[Block]:
    space = told.source.space
    stiffness, damping = (told.values[:, space.index(name)] for name in PARAMETERS)
    peak = loss_peak(stiffness[0], damping[0])
    tests = [(test.name, test.procedure.frequency) for test in told.source.main if test.procedure.frequency]
    found = [frequency for _, frequency in tests] or [peak]
    frequency = np.geomspace(min(*found, peak) / _BEYOND, max(*found, peak) * _BEYOND, 200)
    canvas, axes, _ = panels(2, 2, 2.6, margin=(0.75, 0.5, 0.1, 0.75))
    for k in range(len(stiffness))[::-1]:  # the stated values last, on top
        c, wt = stiffness[k] / 1e3, 2 * np.pi * frequency * damping[k] / stiffness[k]
        width, alpha = (0.5, 0.35) if k else (1.8, 1.0)
        axes[0].semilogx(frequency, c * wt**2 / (1 + wt**2), color=CLUSTER_COLOURS[0], lw=width, alpha=alpha)
        axes[0].semilogx(frequency, c * wt / (1 + wt**2), color=CLUSTER_COLOURS[1], lw=width, alpha=alpha)
    total = _loss_factor(told, frequency)
    axes[1].loglog(frequency, 1 / (2 * np.pi * frequency * damping[0] / stiffness[0]), color=CLUSTER_COLOURS[1])
    if total is not None:
        axes[1].loglog(frequency, total, color=CLUSTER_COLOURS[2])
    for each in axes:
        each.axvline(peak, color=FLOOR, lw=1.0)
        for own in found:
            each.axvline(own, color=BASELINE, lw=0.6, ls=":")
        each.set_xlabel("frequency (Hz)")
    axes[0].set(title="stiffness of the branch (kN/m)")
    axes[1].set(title="loss factor")
    keys = [
        line_key(CLUSTER_COLOURS[0], "storage"),
        line_key(CLUSTER_COLOURS[1], "loss (left); loss factor of the branch (right)"),
        line_key(FLOOR, f"peak of the loss, {peak:.3g} Hz"),
        line_key(BASELINE, "tests", ls=":"),
    ]
    if total is not None:
        keys.insert(2, line_key(CLUSTER_COLOURS[2], "loss factor of all of the carcass"))
    legend_above(canvas, keys)
    text = (
        f"The branch's time constant T_M = d_M/c_M is {number(damping[0] / stiffness[0])} s: its loss peaks at "
        f"1/(2πT_M) = {number(peak)} Hz. Well above the peak the branch acts as a spring: the force hardly depends on "
        "d_M, and what is left of it, a loss that falls with frequency, is hard to tell from d_y. Well below, it acts "
        "as a damper, and c_M fades."
    )
    figure = Figure(
        image_of(canvas),
        "stiffness and loss factor of the Maxwell branch over frequency",
        "Storage and loss stiffness of the branch (thin: at the other parameter sets), and loss factors, the ratio of "
        "the two. Dotted: frequencies of the tests.",
        good="tests on both sides of the peak.",
        bad="all tests far above it: d_M is known only together with d_y; all far below it: c_M is next to invisible.",
    )
    words = [note for note in comparison.notes if note.startswith("d_M in ") and source == 0]
    return [Text(text), figure, *(Text(note) for note in words)]


def _loss_factor(told: Told, frequency: Array) -> Array | None:
    """Of spring, damper and branch in parallel, where the model has such a spring and damper."""
    space = told.source.space
    if not {"c_y", "d_y"} <= set(space.names):
        return None
    c_y, d_y, c, d = (told.values[0, space.index(name)] for name in ("c_y", "d_y", *PARAMETERS))
    omega = 2 * np.pi * frequency
    wt = omega * d / c
    return np.asarray((omega * d_y + c * wt / (1 + wt**2)) / (c_y + c * wt**2 / (1 + wt**2)))
