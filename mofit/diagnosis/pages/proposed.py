"""What is proposed where no known effect explains the gap: the terms, their estimates, and their shape."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from mofit.diagnosis.effect_file import EFFECT_FILE
from mofit.report.toolkit.blocks import Block, Column, Figure, Section, Table, Text, words
from mofit.report.toolkit.figures import Panels, band_key, line_key, mode_colour, panel_of
from mofit.report.toolkit.formatting import compact, display_unit, interval, number, percent, unit_text

#: Width of a 90 % interval in standard deviations.
_INTERVAL = 3.29


def proposed_section(data: Mapping[str, Any]) -> Section:
    """The proposed terms in words, in formulas with their estimates, and drawn."""
    proposed = data["proposed"]
    shrinkage = proposed["shrinkage"]
    alike = " or ".join(proposed["alike"])
    blocks: list[Block] = [
        Text(
            f"{proposed['sentence']} It was selected from these data, and need not be the cause. {EFFECT_FILE} in the "
            "folder of this page is the term as an effect: --effect and --effects take it."
        ),
        Text(f"Added to {alike} it would do the same." if alike else ""),
        _terms_table(proposed),
        _parameters_table(proposed),
        _curve(data),
        Text(f"Against the measured samples themselves it removes {percent(shrinkage['observed'])} of the gap."),
    ]
    keys = ("proposed", "proposed_curves")
    return Section("proposed", "A term that may be missing", blocks, {key: data[key] for key in keys})


def _terms_table(proposed: Mapping[str, Any]) -> Table:
    terms = proposed["terms"]
    scales = ", ".join(f"{name} by {compact(scale, 4)}" for name, scale in proposed["scales"].items())
    return Table(
        [words("Term", [one["title"] for one in terms]), words("Formula", [one["formula"] for one in terms])],
        f"Terms, added to {proposed['quantity']}. Signals are divided by their largest magnitude: {scales} (SI units).",
    )


def _parameters_table(proposed: Mapping[str, Any]) -> Table:
    own = proposed["parameters"]
    sds = [(one["high"] - one["low"]) / _INTERVAL for one in own]
    return Table(
        [
            Column("Parameter", [one["name"] for one in own]),
            Column("Estimate", [compact(one["value"], 4) for one in own]),
            Column("90 % interval", [interval(one["low"], one["high"], sd) for one, sd in zip(own, sds, strict=True)]),
            words("Unit", [unit_text(one["unit"]) for one in own]),
            words("Meaning", [one["description"] for one in own]),
        ],
        "Parameters of the terms, fitted jointly with those of the model.",
    )


def _curve(data: Mapping[str, Any]) -> Figure:
    found, proposed = data["proposed_curves"], data["proposed"]
    curves, unit = found["curves"], proposed["parameters"][0]["unit"]
    x = display_unit(found["variable_unit"], np.concatenate([one["x"] for one in curves]))
    y = display_unit(unit, np.concatenate([one["y"] for one in curves]))
    several = len(curves) > 1
    legend = [line_key(mode_colour(0), "term"), band_key(mode_colour(0), "90 % band")]
    panels = Panels(len(curves), 3 if several else 1, 1.9, legend=legend, margin=(0.75, 0.5, 0.1), gap=(0.5, 0.85))
    for axes, one in zip(panels.axes, curves, strict=True):
        at, value, low, high = (np.asarray(one[key]) for key in ("x", "y", "low", "high"))
        axes.plot(x.factor * at, y.factor * value, color=mode_colour(0), lw=1.4)
        if several:  # a loop has no inside that a band could fill
            for edge in (low, high):
                axes.plot(x.factor * at, y.factor * edge, color=mode_colour(0), lw=0.6, alpha=0.5)
            panel_of(axes, one["test"])
        else:
            axes.fill_between(x.factor * at, y.factor * low, y.factor * high, color=mode_colour(0), alpha=0.25, lw=0)
        axes.set_xlabel(x.label(found["variable"].replace("_", " ")), labelpad=1)
    panels.label(y=y.label(f"added to {proposed['quantity'].replace('_', ' ')}"))
    largest = y.factor * max(float(np.max(np.abs(one["y"]))) for one in curves)
    return panels.figure(
        "The proposed term over the signal that it depends on",
        "What the term adds, at most in the range of the data. "
        + ("It depends on more than this signal, so each test has a loop." if several else ""),
        good="the band is narrow, and the shape is one that you know from such parts.",
        bad="the band is wide, or the curve bends where no test was.",
        finding=f"The term reaches {number(largest, 2)} {y.name}.",
    )
