"""The page of a design: the programme first, then why, what less time would give, and what else was looked at."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes
from numpy.typing import NDArray

from mofit.identifiability.design_files import Proposal
from mofit.identifiability.design_text import GRADES, criterion_text, seconds_text, settings_text, value_text
from mofit.report.display import badge, listed, math_symbol, number, percent, symbol
from mofit.report.page import Block, Details, Figure, Raw, Section, Table, Text, render
from mofit.report.style import (
    BASELINE,
    RC,
    cluster_colour,
    few_ticks,
    image_of,
    legend_above,
    legend_height,
    line_key,
    panels,
)
from mofit.result import atomic_path

#: A test without which the spread grows by less carries next to nothing.
_MATTERS = 1.02
#: Values that differ by more are drawn on a logarithmic axis.
_WIDE = 20.0

Array = NDArray[np.float64]


def write_design_page(proposal: Proposal, told: Mapping[str, Any], path: Path) -> Path:
    """Write the page, self-contained.

    Parameters
    ----------
    proposal
        The design.
    told
        Its summary.
    path
        The page.
    """
    with mpl.rc_context(RC):
        made = [_programme(told), _why(proposal, told), _pareto(proposal, told), _singles(told), _refused(proposal),
                _method(told)]  # fmt: skip
    sections = [section for section in made if section is not None]
    source = proposal.design.told.source
    title = "Next tests for " + ", ".join(told["criterion"]["of"])
    with atomic_path(path) as temporary:
        text = render(title, f"{source.model.title or source.model.name} · after {source.name}", sections)
        temporary.write_text(text, encoding="utf-8")
    return path


def _programme(told: Mapping[str, Any]) -> Section:
    blocks: list[Block] = [Raw(Markup('<p class="banner bad">{}</p>').format(sentence)) for sentence in told["lost"]]
    tests = [
        [test["name"], test["kind"], settings_text(test), f"{test['times']}", seconds_text(test["seconds"])]
        for test in told["programme"]
    ]
    blocks += [
        Table(["Run next", "Kind", "Settings", "Times", "Time"], tests, left=(1, 2)),
        Text(criterion_text(told)),
        Table(
            ["Parameter", "Unit", "Sd before", "Sd after", "Relative before", "after", "Range", "Before", "After"],
            [_row(name, entry) for name, entry in told["parameters"].items()],
            f"Expected standard deviation of the estimate: median over {told['points']} parameter sets; range: of the "
            "relative one after, over the sets.",
            left=(1, 7, 8),
        ),
    ]
    return Section("programme", "The programme", blocks, {"programme": told["programme"]})


def _row(name: str, entry: Mapping[str, Any]) -> list[Markup | str]:
    return [
        symbol(name), entry["unit"], number(entry["sd_before"]), number(entry["sd"]),
        percent(entry["relative_sd_before"]), percent(entry["relative_sd"]),
        f"{percent(entry['low'])} … {percent(entry['high'])}",
        badge(entry["verdict_before"], GRADES[entry["verdict_before"]]),
        badge(entry["verdict"], GRADES[entry["verdict"]]),
    ]  # fmt: skip


def _why(proposal: Proposal, told: Mapping[str, Any]) -> Section | None:
    blocks: list[Block] = []
    names = list(told["parameters"])
    if len(told["programme"]) > 1:
        rows = [[test["name"], *(number(test["without"][name], 3) for name in names)] for test in told["programme"]]
        blocks += [
            Text("What each test of the programme is for: the factor by which a standard deviation grows without it."),
            Table(["Test", *(symbol(name) for name in names)], rows),
            *(Text(sentence) for sentence in _carriers(told, names)),
        ]
    blocks += _over_frequency(proposal, told, names)
    return Section("why", "Why these", blocks) if blocks else None


def _carriers(told: Mapping[str, Any], names: Sequence[str]) -> list[Markup]:
    found = []
    for name in names:
        tests = sorted(told["programme"], key=lambda test: -test["without"][name])
        matter = [test["name"] for test in tests if test["without"][name] >= _MATTERS]
        text = (
            Markup("<b>{}</b> is carried by {}.") if matter else Markup("No test of the programme alone carries {}{}.")
        )
        found.append(text.format(symbol(name), listed(matter) if matter else ""))
    return found


def _over_frequency(proposal: Proposal, told: Mapping[str, Any], names: Sequence[str]) -> list[Block]:
    """Expected spread with one sine more over its frequency, a line per amplitude, tests of the longest duration."""
    found = proposal.design
    sines = [
        (i, c) for i, c in enumerate(found.candidates)
        if c.plan.kind == "sine" and not c.refused and c.procedure.frequency and not c.plan.conditions
    ]  # fmt: skip
    if len({c.procedure.frequency for _, c in sines}) < 3:
        return []
    longest = max(c.seconds for _, c in sines)
    kept = [(i, c) for i, c in sines if c.seconds >= 0.99 * longest]
    amplitudes = sorted({str(c.plan.amplitude) for _, c in kept}, key=lambda a: next(
        float(c.procedure.amplitude or 0) for _, c in kept if str(c.plan.amplitude) == a))  # fmt: skip
    entries = len(amplitudes) + 1
    canvas, axes, _ = panels(len(names), 3, 2.2, margin=(0.75, 0.5, 0.15, 0.35 + legend_height(entries)))
    for k, (name, panel) in enumerate(zip(names, axes, strict=True)):
        panel.axhline(100 * told["parameters"][name]["relative_sd_before"], color=BASELINE, ls="--")
        for place, amplitude in enumerate(amplitudes):
            line = sorted((float(c.procedure.frequency or 0), 100 * float(found.single_sd[i, k]))
                          for i, c in kept if str(c.plan.amplitude) == amplitude)  # fmt: skip
            panel.plot(*np.array(line).T, color=cluster_colour(place), marker="o", ms=3.5)
        panel.set_xscale("log")
        _scale(panel, found.single_sd[[i for i, _ in kept], k])
        panel.set_title(math_symbol(name))
        panel.set_ylabel("relative sd (%)")
        panel.set_xlabel("frequency (Hz)")
    keys = [line_key(cluster_colour(k), amplitude) for k, amplitude in enumerate(amplitudes)]
    legend_above(canvas, [*keys, line_key(BASELINE, "without", ls="--")])
    duration = seconds_text(longest)
    return [
        Figure(
            image_of(canvas),
            "Expected relative standard deviation with one sine test more, over its frequency",
            f"What one sine more of {duration} (overhead included) would leave of each parameter's spread, over its "
            "frequency: the lowest point is where the parameter shows most.",
            good="a clear valley: that frequency carries the parameter.",
            bad="lines along the dashed one: no sine tells more of the parameter than is known already.",
        )
    ]


def _scale(panel: Axes, values: Array) -> None:
    """From zero, or logarithmic where values differ by much."""
    some = values[np.isfinite(values) & (values > 0)]
    if len(some) and some.max() > _WIDE * some.min():
        panel.set_yscale("log")
        return
    panel.set_ylim(bottom=0)
    few_ticks(panel, None, 4)


def _pareto(proposal: Proposal, told: Mapping[str, Any]) -> Section:
    found = proposal.design
    factor = 1 if told["criterion"]["name"] == "T" else 100
    canvas, (panel,), _ = panels(1, 1, 3.0, margin=(0.75, 0.5, 0.15, 0.65))
    seconds = np.array([c.seconds for c in found.candidates])
    shown = np.isfinite(found.singles)
    panel.plot(seconds[shown], factor * found.singles[shown], ls="none", marker="o", ms=3, color=BASELINE, alpha=0.6)
    front = np.array([[0.0, found.value_before], *((p.seconds, p.value) for p in found.pareto)])
    panel.plot(front[:, 0], factor * front[:, 1], color=cluster_colour(0), marker="o", ms=5)
    panel.plot([found.seconds], [factor * found.value_after], ls="none", marker="*", ms=13, color=cluster_colour(1))
    _scale(panel, np.append(found.singles[shown], [found.value_before, found.value_after]))
    panel.set_xlabel("time more (s)")
    panel.set_ylabel("noncentrality" if factor == 1 else "criterion (%)")
    legend_above(canvas, [
        line_key(cluster_colour(0), "best programme of that time", marker="o"),
        line_key(cluster_colour(1), "proposed", ls="none", marker="*", ms=10),
        line_key(BASELINE, "one test alone", ls="none", marker="o", ms=4),
    ])  # fmt: skip
    rows = [
        [
            seconds_text(p.seconds),
            value_text(told, p.value),
            ", ".join(f"{n} × {t}" if n > 1 else t for t, n in p.tests),
        ]
        for p in found.pareto
    ]
    return Section(
        "time",
        "What less time would give",
        [
            Figure(image_of(canvas), "Criterion over testing time", "The criterion over the time of the tests.",
                   good="the curve still falls at the star: the time is well spent.",
                   bad="it is flat before: a shorter programme tells as much."),
            Table(["Time", "Criterion", "Programme"], rows, left=(2,)),
        ],
        {"pareto": told["pareto"]},
    )  # fmt: skip


def _singles(told: Mapping[str, Any]) -> Section:
    names = list(told["parameters"])
    rows = [
        [test["name"], seconds_text(test["seconds"]), value_text(told, test["value"]),
         *(percent(test["relative_sd"][name]) for name in names)]
        for test in told["singles"]
    ]  # fmt: skip
    heads = [Markup("{} relative sd").format(symbol(name)) for name in names]
    caption = f"The best {len(rows)} of {told['candidates']} candidates, each as the only test more."
    return Section("singles", "Best single tests", [Table(["Test", "Time", "Criterion", *heads], rows, caption)])


def _refused(proposal: Proposal) -> Section | None:
    rows = [[c.name, c.refused] for c in proposal.design.candidates if c.refused]
    if not rows:
        return None
    reasons = sorted({reason.partition(":")[0] for _, reason in rows})
    told = Text(f"{len(rows)} of {len(proposal.design.candidates)} candidates break a limit of the rig: "
                f"{', '.join(reasons)}.")  # fmt: skip
    table = Table(["Test", "Limit (SI units)"], rows, left=(1,))
    return Section("refused", "What the rig cannot run", [told, Details("All of them", [table])])


def _method(told: Mapping[str, Any]) -> Section:
    blocks: list[Block] = [Text(note) for note in told["notes"]]
    values = Markup(", ").join(
        Markup("{} {}").format(symbol(name), number(value, 4)) for name, value in told["values"].items()
    )
    blocks += [
        Text(Markup("Judged at {} parameter sets around {} (SI units).").format(told["points"], values)),
        Text(
            "The expected spread is that of mofit's own estimate: curvature and scatter of the weighted squares from "
            "exact sensitivities and the noise of each test, calibration stages as they are fitted. Programmes are "
            "found greedily, by gain and by gain per second, then improved by exchanging one or two tests until "
            "nothing gains; few programmes are all looked at."
        ),
        Details("The space that was searched", [Raw(Markup("<pre>{}</pre>").format(_space(told["space"])))]),
    ]
    return Section("method", "How this was found", blocks)


def _space(space: Mapping[str, Any]) -> str:
    lines = [f"overhead: {space['overhead']}"]
    lines += [f"limit of {key}: {value}" for key, value in space.get("limits", {}).items() if value]
    for grid in space["tests"]:
        lines.append("")
        lines += [f"{key}: {', '.join(map(str, v)) if isinstance(v, list) else v}" for key, v in grid.items() if v]
    return "\n".join(lines)
