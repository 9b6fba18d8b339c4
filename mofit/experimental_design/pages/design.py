"""The page of a design: the tests to run first, then why, what less time would give, and the other candidates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup

from mofit.experimental_design.candidates import Candidate
from mofit.experimental_design.design_job import Proposal
from mofit.experimental_design.optimal_design import Design
from mofit.experimental_design.text import (
    GRADES,
    criterion_text,
    samples_text,
    seconds_text,
    settings_text,
    target_text,
    value_text,
)
from mofit.report.toolkit.axes import log_if_wide
from mofit.report.toolkit.blocks import Block, Column, Details, Figure, Raw, Section, Table, Text, badge, banner, words
from mofit.report.toolkit.figures import BASELINE, Panels, dot_key, line_key, mode_colour
from mofit.report.toolkit.formatting import listed, math_symbol, number, percent, symbol
from mofit.report.toolkit.page import draw_sections, write_page

#: A test without which the standard deviation grows by less contributes hardly anything.
_MATTERS = 1.02
#: Values that differ by more are drawn on a logarithmic axis.
_WIDE = 20.0


def write_design_page(proposal: Proposal, summary: Mapping[str, Any], path: Path) -> Path:
    """Write the page of a design and its summary, self-contained; a file of this name is replaced."""
    makers = (_tests, _why, _time, _singles, _infeasible, _method)
    sections = draw_sections([partial(make, summary=summary) for make in makers], proposal)
    source = proposal.design.known.source
    title = "Next tests for " + ", ".join(summary["criterion"]["of"]) + target_text(summary)
    return write_page(path, title, f"{source.model.title or source.model.name} · after {source.name}", sections)


def _tests(proposal: Proposal, summary: Mapping[str, Any]) -> Section:
    tests, entries = summary["design"], summary["parameters"].values()
    chosen = Table([
        Column("Run next", [test["name"] for test in tests]),
        words("Kind", [test["kind"] for test in tests]),
        words("Settings", [settings_text(test) for test in tests]),
        Column("Times", [f"{test['times']}" for test in tests]),
        Column("Time", [seconds_text(test["seconds"]) for test in tests]),
    ])  # fmt: skip
    expected = Table(
        [
            Column("Parameter", [symbol(name) for name in summary["parameters"]]),
            words("Unit", [entry["unit"] for entry in entries]),
            Column("Sd before", [number(entry["sd_before"]) for entry in entries]),
            Column("Sd after", [number(entry["sd"]) for entry in entries]),
            Column("Relative before", [percent(entry["relative_sd_before"]) for entry in entries]),
            Column("after", [percent(entry["relative_sd"]) for entry in entries]),
            Column("Range", [f"{percent(entry['low'])} … {percent(entry['high'])}" for entry in entries]),
            words("Before", [badge(v, GRADES[v]) for v in (entry["verdict_before"] for entry in entries)]),
            words("After", [badge(v, GRADES[v]) for v in (entry["verdict"] for entry in entries)]),
        ],
        f"Expected standard deviation of the estimate{target_text(summary)}, {samples_text(summary)}. Range: of "
        "the relative one after, over the samples.",
    )
    missed = [banner(sentence, "bad") for sentence in summary["not_identifiable"]]
    blocks: list[Block] = [*missed, chosen, Text(criterion_text(summary)), expected]
    return Section("design", "The design", blocks, {"design": tests})


def _why(proposal: Proposal, summary: Mapping[str, Any]) -> Section | None:
    blocks: list[Block] = []
    names, tests = list(summary["parameters"]), summary["design"]
    if len(tests) > 1:
        columns = [Column(symbol(name), [number(test["without"][name], 3) for test in tests]) for name in names]
        blocks += [
            Text(
                "What each test of the design contributes: the factor by which a standard deviation grows without it."
            ),
            Table([Column("Test", [test["name"] for test in tests]), *columns]),
            *(Text(_contributors(summary, name)) for name in names),
        ]
    blocks += _over_frequency(proposal, summary, names)
    return Section("why", "Why these tests", blocks) if blocks else None


def _contributors(summary: Mapping[str, Any], name: str) -> Markup:
    tests = sorted(summary["design"], key=lambda test: -test["without"][name])
    matter = [test["name"] for test in tests if test["without"][name] >= _MATTERS]
    if not matter:
        return Markup("No single test of the design is essential for {}.").format(symbol(name))
    return Markup("Information on <b>{}</b> comes from {}.").format(symbol(name), listed(matter))


def _over_frequency(proposal: Proposal, summary: Mapping[str, Any], names: Sequence[str]) -> list[Block]:
    """Standard deviation with one sine more over its frequency, a line per amplitude, for the longest duration."""
    found = proposal.design
    sines = [
        (i, c) for i, c in enumerate(found.candidates)
        if c.plan.kind == "sine" and not c.infeasible and c.experiment.frequency and not c.plan.conditions
    ]  # fmt: skip
    if len({c.experiment.frequency for _, c in sines}) < 3:
        return []
    longest = max(c.seconds for _, c in sines)
    kept = [(i, c) for i, c in sines if c.seconds >= 0.99 * longest]
    sizes = {str(c.plan.amplitude): float(c.experiment.amplitude or 0) for _, c in kept}
    amplitudes = sorted(sizes, key=sizes.__getitem__)
    keys = [line_key(mode_colour(k), amplitude) for k, amplitude in enumerate(amplitudes)]
    panels = Panels(len(names), 3, 2.2, legend=[*keys, line_key(BASELINE, "without", ls="--")])
    for k, (name, axes) in enumerate(zip(names, panels.axes, strict=True)):
        axes.axhline(100 * summary["parameters"][name]["relative_sd_before"], color=BASELINE, ls="--")
        for place, amplitude in enumerate(amplitudes):
            line = sorted((float(c.experiment.frequency or 0), 100 * float(found.single_sd[i, k]))
                          for i, c in kept if str(c.plan.amplitude) == amplitude)  # fmt: skip
            axes.plot(*np.array(line).T, color=mode_colour(place), marker="o", ms=3.5)
        axes.set_xscale("log")
        log_if_wide(axes, 100 * found.single_sd[[i for i, _ in kept], k], _WIDE)
        axes.set_title(math_symbol(name))
    panels.label("frequency (Hz)", "relative sd (%)")
    return [
        panels.figure(
            "Expected relative standard deviation with one sine test more, over its frequency",
            f"Expected standard deviation with one sine more of {seconds_text(longest)} (overhead included), over its "
            "frequency. The minimum is where the parameter is most visible.",
            good="a clear minimum: sines of that frequency are informative.",
            bad="lines along the dashed one: no sine adds information on the parameter.",
            finding=_most_informative(found, kept, names),
        )
    ]


def _most_informative(found: Design, kept: Sequence[tuple[int, Candidate]], names: Sequence[str]) -> Markup:
    """The frequency of the sine that lowers each standard deviation most."""
    best = {name: min(kept, key=lambda one, k=k: found.single_sd[one[0], k])[1] for k, name in enumerate(names)}  # type: ignore[misc]
    parts = [
        Markup("{} at {} Hz").format(symbol(name), number(float(one.experiment.frequency or 0)))
        for name, one in best.items()
    ]
    return Markup("A sine informs most: {}.").format(listed(parts))


def _time(proposal: Proposal, summary: Mapping[str, Any]) -> Section:
    pareto = proposal.design.pareto
    table = Table([
        Column("Time", [seconds_text(p.seconds) for p in pareto]),
        Column("Criterion", [value_text(summary, p.value) for p in pareto]),
        words("Tests", [", ".join(f"{n} × {t}" if n > 1 else t for t, n in p.tests) for p in pareto]),
    ])  # fmt: skip
    blocks: list[Block] = [_time_figure(proposal), table]
    return Section("time", "What less time would give", blocks, {"pareto": summary["pareto"]})


def _time_figure(proposal: Proposal) -> Figure:
    found = proposal.design
    factor, label = (1, "noncentrality") if found.criterion.larger_is_better else (100, "criterion (%)")
    panels = Panels(1, 1, 3.0, legend=[
        line_key(mode_colour(0), "best design of that time", marker="o"),
        dot_key(mode_colour(1), "proposed", marker="*", size=10),
        dot_key(BASELINE, "one test alone", size=4),
    ])  # fmt: skip
    axes = panels.axes[0]
    seconds = np.array([c.seconds for c in found.candidates])
    feasible = np.isfinite(found.singles)
    singles = factor * found.singles[feasible]
    axes.plot(seconds[feasible], singles, ls="none", marker="o", ms=3, color=BASELINE, alpha=0.6)
    front = np.array([[0.0, found.value_before], *((p.seconds, p.value) for p in found.pareto)])
    axes.plot(front[:, 0], factor * front[:, 1], color=mode_colour(0), marker="o", ms=5)
    axes.plot([found.seconds], [factor * found.value_after], ls="none", marker="*", ms=13, color=mode_colour(1))
    log_if_wide(axes, np.append(singles, [factor * found.value_before, factor * found.value_after]), _WIDE)
    panels.label("additional time (s)", label)
    return panels.figure(
        "Criterion over testing time",
        "The criterion over the time of the tests.",
        good="the curve still falls at the star: the time is well spent.",
        bad="it is flat before: a shorter design is as informative.",
        finding=f"The proposed design takes {seconds_text(found.seconds)}; "
        f"{label} {number(factor * found.value_before)} before, {number(factor * found.value_after)} after.",
    )


def _singles(proposal: Proposal, summary: Mapping[str, Any]) -> Section:
    tests = summary["singles"]
    columns = [
        Column("Test", [test["name"] for test in tests]),
        Column("Time", [seconds_text(test["seconds"]) for test in tests]),
        Column("Criterion", [value_text(summary, test["value"]) for test in tests]),
    ]
    for name in summary["parameters"]:
        head = Markup("{} relative sd").format(symbol(name))
        columns.append(Column(head, [percent(test["relative_sd"][name]) for test in tests]))
    caption = f"The best {len(tests)} of {summary['candidates']} candidates, each as the only additional test."
    return Section("singles", "Best single tests", [Table(columns, caption)])


def _infeasible(proposal: Proposal, summary: Mapping[str, Any]) -> Section | None:
    found = [c for c in proposal.design.candidates if c.infeasible]
    if not found:
        return None
    limits = ", ".join(sorted(summary["infeasible"]))
    text = Text(f"{len(found)} of {summary['candidates']} candidates violate a limit of the rig: {limits}.")
    table = Table([Column("Test", [c.name for c in found]), words("Limit (SI units)", [c.infeasible for c in found])])
    return Section("infeasible", "Infeasible candidates", [text, Details("All of them", [table])])


def _method(proposal: Proposal, summary: Mapping[str, Any]) -> Section:
    values = Markup(", ").join(
        Markup("{} {}").format(symbol(name), number(value, 4)) for name, value in summary["values"].items()
    )
    blocks: list[Block] = [
        *(Text(note) for note in summary["notes"]),
        Text(Markup("Evaluated at {} parameter samples around {} (SI units).").format(summary["samples"], values)),
        Text(
            "The expected standard deviation is that of mofit's own estimate: Gauss-Newton Hessian and covariance of "
            "the gradient of the weighted sum of squares, from exact sensitivities and the noise of each test; "
            "calibration stages as they are fitted. Designs are found greedily, by gain and by gain per second, then "
            "improved by exchanging one or two tests until nothing gains. Where few selections of tests fit, all are "
            "evaluated."
        ),
        Details("The design space", [Raw(Markup("<pre>{}</pre>").format(_space(summary["space"])))]),
    ]
    return Section("method", "Method", blocks)


def _space(space: Mapping[str, Any]) -> str:
    lines = [f"overhead: {space['overhead']}"]
    lines += [f"limit of {key}: {value}" for key, value in space.get("limits", {}).items() if value]
    for grid in space["tests"]:
        lines.append("")
        lines += [f"{key}: {', '.join(map(str, v)) if isinstance(v, list) else v}" for key, v in grid.items() if v]
    return "\n".join(lines)
