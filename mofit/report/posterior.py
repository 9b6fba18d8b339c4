"""The joint posterior of each mode: correlations, principal directions, corner plot."""

from __future__ import annotations

from typing import Any

from markupsafe import Markup

from mofit.report.corner import corner_figure
from mofit.report.directions import (
    FLAT,
    Direction,
    correlation,
    direction_texts,
    directions_of,
    pair_list,
    strong_pairs,
)
from mofit.report.marginals import extract_marginals, marginals_figure
from mofit.report.run import Mode, Run
from mofit.report.toolkit.blocks import Block, Column, Section, Table, Text, badge, tabs, words, wrapped
from mofit.report.toolkit.formatting import percent


def posterior_section(run: Run) -> Section | None:
    """Marginals of all modes, then per mode its correlations, what is not identifiable, and its corner plot."""
    if not run.sampled:
        return None
    panes: dict[str, list[Block]] = {}
    data = {}
    for mode in run.sampled:
        panes[mode.title], data[mode.name], _ = _joint(run, mode)
        if len(mode.parameters) > 1:
            panes[mode.title].append(corner_figure(run, mode))
    marginals = extract_marginals(run)
    blocks = [marginals_figure(run, marginals), *tabs(panes)]
    return Section("posterior", "Posterior", blocks, {"marginals": marginals, "modes": data})


def directions_section(run: Run) -> Section | None:
    """Strong correlations and all principal directions, per mode."""
    panes: dict[str, list[Block]] = {}
    data = {}
    for mode in run.sampled:
        blocks, data[mode.name], directions = _joint(run, mode)
        panes[mode.title] = [*blocks, _table(directions)]
    return Section("directions", "Correlations and directions", tabs(panes), {"modes": data}) if panes else None


def _joint(run: Run, mode: Mode) -> tuple[list[Block], dict[str, Any], list[Direction]]:
    """Correlations and directions of a mode: text, the numbers behind it, and the directions."""
    pairs, directions = strong_pairs(run, mode), directions_of(run, mode)
    data = {
        "parameters": mode.parameters,
        "correlation": correlation(run, mode),
        "pairs": pairs,
        "directions": directions,
    }
    return [*(Text(text) for text in direction_texts(directions)), pair_list(pairs)], data, directions


def _table(directions: list[Direction]) -> Table:
    changes = [Markup(", ").join(change.text for change in direction.changes) for direction in directions]
    verdicts = [badge(*(("not identified", "bad") if d.flat else ("identified", "good"))) for d in directions]
    return Table(
        [
            Column("No.", [str(k) for k in range(1, len(directions) + 1)]),
            words("One standard deviation along it", [wrapped(text) for text in changes]),
            Column("Width, prior = 100 %", [percent(direction.width, 2) for direction in directions]),
            words("", verdicts),
        ],
        "Principal directions of the posterior in the prior box, widest first; the last are the combinations that the "
        f"data identify best. A direction wider than {percent(FLAT, 2)} of the prior counts as not identified.",
    )
