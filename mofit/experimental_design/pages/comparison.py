"""The page of a comparison: one table first, then the reasons."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from markupsafe import Markup

from mofit.experimental_design.comparison_result import Comparison, ExperimentResult, InformationShare, ParameterResult
from mofit.experimental_design.expected_profiles import SETTINGS as PROFILES
from mofit.experimental_design.identifiability import IDENTIFIABLE
from mofit.experimental_design.identifiability import SETTINGS as THRESHOLDS
from mofit.experimental_design.pages.frequency import branch_section, frequency_section
from mofit.experimental_design.parameter_samples import HALF_WIDTH
from mofit.experimental_design.text import GRADES, NOTHING, augmentation_sentences
from mofit.report.directions import direction_texts, principal_directions
from mofit.report.toolkit.axes import heat_map
from mofit.report.toolkit.blocks import (
    Block,
    Column,
    Figure,
    Raw,
    Section,
    Table,
    Text,
    badge,
    banner,
    bullets,
    method_section,
    tabs,
    words,
)
from mofit.report.toolkit.figures import FLOOR, MEASURED, Panels, mode_colour
from mofit.report.toolkit.formatting import (
    listed,
    math_symbol,
    number,
    parameter_label,
    percent,
    symbol,
    unit_text,
)
from mofit.report.toolkit.page import draw_sections, write_page

#: Most profiles that are drawn, and their height over the rise that bounds the interval.
_PROFILES, _HEIGHT = 16, 3.0
#: Experiments whose maps are drawn.
_DRAWN = 12
#: Condition index above which parameters are strongly collinear (Belsley).
_STRONG = 30.0


def write_comparison(comparison: Comparison, path: Path) -> Path:
    """Write the page of a comparison, self-contained; a file of this name is replaced."""
    makers = (
        verdict_section, share_section, frequency_section, branch_section, correlation_section, profile_section,
        how_section,
    )  # fmt: skip
    model = comparison.sources[0].source.model
    files = ", ".join(known.source.name for known in comparison.sources)
    return write_page(
        path, "Experiments compared", f"{model.title or model.name} · {files}", draw_sections(makers, comparison)
    )


def verdict_section(comparison: Comparison) -> Section:
    """Every parameter in every experiment, then the reasons in sentences."""
    rows = comparison.experiments
    columns = [
        Column("Experiment", [row.experiment.name for row in rows]),
        Column("Time", [f"{row.seconds:.0f} s" for row in rows]),
    ]
    for name in comparison.parameters:
        entries = [row.parameters[name] for row in rows]
        columns += [
            words(symbol(name), [_badge(entry) for entry in entries]),
            Column(Markup("{}: sd").format(symbol(name)), [percent(entry.relative_sd) for entry in entries]),
            Column("after 60 s", [percent(entry.relative_sd_after_60_s) for entry in entries]),
        ]
    known = comparison.sources[0]
    space = known.source.space
    values = listed([
        Markup("{} = {}&nbsp;{}").format(symbol(name), number(known.samples[0, space.index(name)], 4),
                                         unit_text(space[name].unit))
        for name in comparison.parameters
    ])  # fmt: skip
    caption = Markup(
        "Expected standard deviation in per cent of the value, median over {} parameter samples around {}; and after "
        "60&nbsp;s of the experiment. A star: the verdict depends on the parameter sample."
    ).format(len(known.samples), values)
    doubtful = [
        Markup("<b>{}</b>: {}").format(row.experiment.name, entry.sentence)
        for row in rows
        for entry in row.parameters.values()
        if entry.verdict != IDENTIFIABLE
    ]
    blocks: list[Block] = [_outcome(comparison), Table(columns, caption)]
    blocks += [bullets(doubtful)] if doubtful else []
    blocks += [Text(text) for text in (*augmentation_sentences(comparison), *comparison.notes)]
    return Section("verdicts", "Experiments and parameters", blocks)


def _badge(entry: ParameterResult) -> Markup:
    return badge(entry.verdict + ("*" if len(entry.verdicts) > 1 else ""), GRADES[entry.verdict])


def _outcome(comparison: Comparison) -> Raw:
    if comparison.not_identifiable:
        names = listed([symbol(name) for name in comparison.not_identifiable])
        return banner(Markup("{}: not identifiable from any of these experiments.").format(names), "bad")
    best = [(name, comparison.best(name)) for name in comparison.parameters]
    texts = [
        Markup("{} best from {} (±{})").format(symbol(name), row.experiment.name,
                                               percent(row.parameters[name].relative_sd))
        for name, row in best
    ]  # fmt: skip
    good = all(
        any(row.parameters[name].verdict == IDENTIFIABLE for row in comparison.experiments)
        for name in comparison.parameters
    )
    return banner(listed(texts) + ".", "good" if good else "bad")


def share_section(comparison: Comparison) -> Section | None:
    """How much each test contributes to the information on each parameter; a table per experiment of several tests."""
    if not comparison.shares:
        return None
    panes = {each.experiment: [_share_table(each, comparison.parameters)] for each in comparison.shares}
    return Section("information", "Information of each test", tabs(panes))


def _share_table(shares: InformationShare, names: tuple[str, ...]) -> Table:
    columns = [Column("Test", [*shares.tests, "calibration", "bounds"])]
    bounds = np.maximum(1 - shares.share.sum(axis=0) - shares.calibration, 0.0)
    for k, name in enumerate(names):
        own = [_bar(float(share)) for share in shares.share[:, k]]
        without = [f"×{number(float(ratio), 3)}" for ratio in shares.without[:, k]]
        columns += [
            words(symbol(name), [*own, percent(float(shares.calibration[k])), percent(float(bounds[k]))]),
            Column(Markup("{}: sd without").format(symbol(name)), [*without, "", ""]),
        ]
    return Table(
        columns,
        "Share of the information on each parameter that a test contributes, without what other parameters can explain "
        f"(below {100 * NOTHING:g} %: negligible); and the factor by which the standard deviation grows without "
        "that test.",
    )


def _bar(share: float) -> Markup:
    style = f"display:inline-block;height:0.7em;width:{min(max(share, 0.0), 1.0) * 8:.2f}em;background:"
    return Markup('<span style="{}{};margin-right:0.4em"></span>{}').format(style, mode_colour(0), percent(share))


def correlation_section(comparison: Comparison) -> Section:
    """Maps and tables for all experiments, unidentifiable directions of those that are drawn."""
    rows = comparison.experiments
    columns = [
        Column("Experiment", [row.experiment.name for row in rows]),
        Column("Condition index", [number(row.condition_index, 3) for row in rows]),
    ]
    columns += [
        Column(symbol(name), [number(row.parameters[name].variance_inflation, 3) for row in rows])
        for name in comparison.parameters
    ]
    table = Table(
        columns,
        f"Largest condition index of the parameters that no calibration stage estimates (above {_STRONG:g}: strongly "
        "collinear), and variance inflation factors: the variance of a parameter over that with all others known.",
    )
    blocks: list[Block] = [_maps(comparison), table]
    for row in _drawn(comparison):
        known = comparison.sources[row.experiment.source]
        for text in direction_texts(principal_directions(known.source.space, row.covariance, known.samples[0])):
            blocks.append(Text(listed([row.experiment.name]) + ": " + text))
    return Section("correlation", "Correlation of the parameters", blocks)


def _drawn(comparison: Comparison) -> list[ExperimentResult]:
    return [row for row in comparison.experiments if np.isfinite(row.covariance).all()][:_DRAWN]


def _maps(comparison: Comparison) -> Figure:
    drawn = _drawn(comparison)
    names = [math_symbol(name) for name in comparison.sources[0].source.space.names]
    panels = Panels(len(drawn), 4, 2.0, gap=(0.55, 0.75), margin=(0.65, 0.5, 0.9))
    image = None
    for axes, row in zip(panels.axes, drawn, strict=True):
        size = np.sqrt(np.diag(row.covariance))
        scaled = row.covariance / np.outer(size, size)
        image = heat_map(axes, scaled, names, names, turned=True, cmap="RdBu_r", vmin=-1, vmax=1)
        axes.set_title(row.experiment.name)
    if image is not None:
        panels.canvas.colorbar(image, cax=panels.canvas.add_axes((0.945, 0.25, 0.012, 0.5)))
    return panels.figure(
        "correlation maps",
        "Correlation of the estimates of all parameters, calibrated ones included, in each experiment.",
        good="pale off the diagonal.",
        bad="dark: a change of one parameter compensates for a change of another.",
        finding=_darkest(comparison),
    )


def _darkest(comparison: Comparison) -> Markup:
    """The strongest correlation of all experiments that are drawn."""
    names, found = comparison.sources[0].source.space.names, (0.0, "", 0, 0)
    for row in _drawn(comparison):
        size = np.sqrt(np.diag(row.covariance))
        scaled = np.tril(np.nan_to_num(row.covariance / np.outer(size, size)), -1)
        a, b = map(int, np.unravel_index(np.argmax(np.abs(scaled)), scaled.shape))
        found = max(found, (float(scaled[a, b]), row.experiment.name, a, b), key=lambda one: abs(one[0]))
    value, name, i, j = found
    if not value:
        return Markup("No two parameters are correlated.")
    return Markup("The strongest correlation is that of {} and {} in {}: {}.").format(
        symbol(names[j]), symbol(names[i]), name, number(value, 2)
    )


def profile_section(comparison: Comparison) -> Section | None:
    """A panel per parameter and experiment that is not identifiable."""
    doubtful = [
        (row.experiment, entry, entry.profile)
        for row in comparison.experiments
        for entry in row.parameters.values()
        if entry.profile is not None and entry.verdict != IDENTIFIABLE
    ][:_PROFILES]
    if not doubtful:
        return None
    panels = Panels(len(doubtful), 4, 1.8)
    for axes, (experiment, entry, profile) in zip(panels.axes, doubtful, strict=True):
        known = comparison.sources[experiment.source]
        space = known.source.space
        place, own = space.index(entry.parameter), space[entry.parameter]
        axes.plot(profile.grid, profile.rise, "-o", ms=3, color=mode_colour(0))
        axes.axhline(PROFILES.rise, color=FLOOR, lw=1.0)
        axes.axvline(known.samples[0, place], color=MEASURED, lw=0.8, ls=":")
        axes.set(ylim=(0, _HEIGHT * PROFILES.rise), xlim=(own.lower, own.upper), ylabel="rise (nats)")
        axes.set_xlabel(parameter_label(entry.parameter, own.unit))
        if own.scale == "log":
            axes.set_xscale("log")
        axes.set_title(f"{math_symbol(entry.parameter)}, {experiment.name}")
    figure = panels.figure(
        "profile likelihoods",
        "Rise of the negative log likelihood (nats) of the expected data, with one parameter fixed over its whole box "
        "and all others refitted. The data have no noise in them; the likelihood has its width. Where the line is "
        "passed, a value is excluded (95 %). Dotted: the value that the data were simulated with.",
        good="passes the line on both sides, close to the value.",
        bad="stays below it up to a bound: no limit on that side.",
        finding=f"{len(doubtful)} profiles of parameters that the data leave open.",
    )
    return Section("profiles", "Profiles of parameters that are not identifiable", [figure])


def how_section(comparison: Comparison) -> Section:
    """The method, with its sources."""
    return method_section(
        {
            "Sensitivities": "Exact derivatives of the discretised model with respect to all parameters, at the "
            "samples that the identification uses: after the transient, at least one period of a periodic test.",
            "Noise": "Of a plan, as it states it; of a campaign, level and spectrum of what does not repeat from "
            "period to period. Model discrepancy is not counted.",
            "Expected uncertainty": Markup(
                "mofit minimises a weighted sum of squares. With its Gauss-Newton Hessian H and the covariance J of "
                "its gradient the estimate has the precision H J<sup>−1</sup> H; calibration stages, whose parameters "
                "are nuisances, add theirs. All parameters are confined by their bounds. The Cramér-Rao bound is in "
                "the numbers of <code>--json</code>."
            ),
            "Verdicts": "Identifiable: standard deviation at most "
            f"{100 * THRESHOLDS.share_of_value:g} % of the value or {100 * THRESHOLDS.share_of_box:g} % of the box. "
            "Only in a combination: not so, but it would be if the other parameters were known. One-sided: neither, "
            "but one of the bounds is excluded. The verdict is the most frequent one over the parameter samples: the "
            f"posterior of a run, or values in a box of ±{100 * HALF_WIDTH:g} % of the bounds' width around the "
            "reference values.",
            "Profiles": "Verdicts other than “identifiable” are checked by profile likelihoods [1] of the expected "
            "data at the reference values.",
            "Collinearity": "Condition indices as in [2].",
        },
        (
            "Raue A, Kreutz C, Maiwald T, Bachmann J, Schilling M, Klingmüller U, Timmer J. Structural and practical "
            "identifiability analysis of partially observed dynamical models by exploiting the profile likelihood. "
            "Bioinformatics 25(15), 1923–1929, 2009.",
            "Belsley DA, Kuh E, Welsch RE. Regression diagnostics. Wiley, 1980.",
        ),
    )
