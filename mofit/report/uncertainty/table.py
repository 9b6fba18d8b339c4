"""The summary: one line per parameter with its spread, what the data taught of it, and a sentence."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup, escape

from mofit.report.display import THIN, badge, listed, number, symbol, with_sd
from mofit.report.page import Block, Section, Table, Text, tabs
from mofit.report.parameter_table import Estimate, extract_estimates
from mofit.report.run import Cluster, Run, labels, numbers, tab_title
from mofit.report.summary import convergence_banner, extract_headline
from mofit.report.uncertainty.directions import Pair, strong_pairs

_UNMOVED = 0.9
"""Share of an earlier stage's standard deviation from which the tests have added next to nothing."""


@dataclass(frozen=True)
class Line:
    """One parameter of one solution: its numbers, its sd if noise were all (nan if unknown), and what they mean.

    `plain` is the sentence without markup.
    """

    estimate: Estimate
    noise_sd: float
    sentence: Markup
    plain: str


def extract_lines(run: Run, cluster: Cluster) -> list[Line]:
    """The parameters of a cluster in order."""
    pairs = strong_pairs(run, cluster) if cluster.draws is not None else []
    known = earlier_sd(run)
    lines = []
    for estimate, noise_sd in zip(extract_estimates(run, cluster), cluster.array("noise_sd"), strict=True):
        earlier = known.get(estimate.parameter, np.nan)
        plain = sentence(estimate, pairs, earlier, lambda name: Markup(escape(name))).unescape()
        lines.append(Line(estimate, float(noise_sd), sentence(estimate, pairs, earlier), plain))
    return lines


def earlier_sd(run: Run) -> dict[str, float]:
    """Standard deviations that calibration stages alone gave, by parameter."""
    node = run.group("calibration")
    stages = {} if node is None else node.children
    return {
        parameter: float(sd)
        for name, stage in stages.items()
        for parameter, sd in zip(labels(stage, f"parameter_{name}"), numbers(stage, "sd"), strict=True)
    }


def sentence(
    estimate: Estimate, pairs: list[Pair], earlier: float = np.nan, show: Callable[[str], Markup] = symbol
) -> Markup:
    """What the data say of a parameter, in words.

    Parameters
    ----------
    estimate
        Its numbers.
    pairs
        Strongly correlated pairs, strongest first.
    earlier
        Its standard deviation by a calibration stage alone; nan if there is none.
    show
        How names of parameters are written.
    """
    parts = [_what(estimate)]
    if estimate.at_bound:
        side = "upper" if estimate.at_bound > 0 else "lower"
        parts.append(Markup("its minimum is at its {} bound: widen the box, or doubt the model").format(side))
    off = abs(estimate.mean - estimate.value) / estimate.sd if estimate.sd > 0 else 0.0
    if off > 1 and not estimate.at_bound:
        parts.append(Markup("its mean lies {} sd from the refined minimum").format(number(off, 2)))
    if np.isfinite(earlier) and earlier > 0 and np.isfinite(estimate.sd):
        parts.append(_beside_stage(estimate.sd / earlier))
    for pair in pairs:
        if estimate.parameter in (pair.first, pair.second):
            other = pair.second if estimate.parameter == pair.first else pair.first
            how = "rises and falls with" if pair.correlation > 0 else "trades against"
            parts.append(Markup("{} {} (correlation {})").format(how, show(other), number(pair.correlation, 2)))
            break
    return show(estimate.parameter) + Markup(": ") + Markup("; ").join(parts) + Markup(".")


def _what(e: Estimate) -> Markup:
    unit = "" if e.unit == "1" else f"{THIN}{e.unit}"
    low, high = with_sd(e.q05, e.sd) + unit, with_sd(e.q95, e.sd) + unit
    verdict = e.verdict.lower()
    if not np.isfinite(e.sd):
        return Markup("not sampled, so its spread is not known")
    if verdict.startswith("lower limit"):
        return Markup("the data give a lower limit only: above {} with 95{t}% probability").format(low, t=THIN)
    if verdict.startswith("upper limit"):
        return Markup("the data give an upper limit only: below {} with 95{t}% probability").format(high, t=THIN)
    if e.contraction < 0.1:
        return Markup("not moved from the prior: the data say nothing of it")
    if verdict.startswith("not identifiable"):
        return Markup("the data do not pin it: the posterior reaches both bounds")
    width = f"{100 * (1 - e.contraction):.0f}{THIN}%"
    if verdict.startswith("weak") or e.contraction < 0.5:
        return Markup("between {} and {}: a range, not a value; still {} as wide as the prior").format(low, high, width)
    if abs(e.mean) > 2 * e.sd:
        return Markup("known to ± {}{}%").format(number(100 * e.sd / abs(e.mean), 2), THIN)
    return Markup("known to ± {}{}; zero is not excluded").format(number(e.sd, 2), unit)


def _beside_stage(share: float) -> Markup:
    if share > 1.1:
        return Markup("wider than its calibration stage alone says ({}×)").format(number(share, 2))
    if share > _UNMOVED:
        return Markup("not moved from what its calibration stage knew")
    return Markup("{}{}% narrower than by its calibration stage alone").format(f"{100 * (1 - share):.0f}", THIN)


def table_section(run: Run) -> Section:
    """Banner, what is shown, and a table per solution, best first."""
    headline = extract_headline(run)
    lines = {cluster.name: extract_lines(run, cluster) for cluster in run.clusters}
    panes: dict[str, list[Block]] = {tab_title(c): [_table(lines[c.name], c)] for c in run.clusters}
    blocks: list[Block] = [convergence_banner(headline), *(Text(text) for text in _overview(run)), *tabs(panes)]
    return Section("summary", "Summary", blocks, {"converged": run.converged, "clusters": lines})


def _overview(run: Run) -> list[Markup]:
    best = run.clusters[0]
    texts = []
    if len(run.plausible) > 1:
        texts.append(
            Markup("<b>{} solutions are plausible:</b> {}. Each table below is the spread around one of them.").format(
                len(run.plausible), listed([tab_title(cluster) for cluster in run.plausible])
            )
        )
    graded = {
        grade: [symbol(name) for name, own in zip(best.parameters, best.grades, strict=True) if own == grade]
        for grade in ("good", "fair", "bad")
    }
    if graded["good"]:
        texts.append(Markup("<b>Pinned by the data:</b> {}.").format(listed(graded["good"])))
    if graded["fair"]:
        texts.append(Markup("<b>A limit or a range only:</b> {}.").format(listed(graded["fair"])))
    if graded["bad"]:
        texts.append(Markup("<b>Not to be read as a value:</b> {}.").format(listed(graded["bad"])))
    return texts


def _table(lines: list[Line], cluster: Cluster) -> Table:
    rows = []
    split = any(np.isfinite(line.noise_sd) for line in lines)
    for line in lines:
        e = line.estimate
        sampled = np.isfinite(e.sd)
        rows.append(
            [
                symbol(e.parameter),
                with_sd(e.mean, e.sd) + (f" ± {number(e.sd, 2)}" if sampled else ""),
                f"{with_sd(e.q05, e.sd)} … {with_sd(e.q95, e.sd)}" if sampled else "–",
                *([number(line.noise_sd, 2)] if split else []),
                "" if e.unit == "1" else e.unit,
                "–" if np.isnan(e.contraction) else f"{100 * e.contraction:.1f}{THIN}%".replace("-", "−"),
                badge(e.verdict or "not sampled", e.grade),
                Markup('<span class="words">{}</span>').format(line.sentence),
            ]
        )
    columns = ["Parameter", "Mean ± sd", "90 % interval", "Unit", "Contraction", "Verdict", "In words"]
    caption = (
        f"Solution {cluster.name}. Contraction, from prior to posterior: 1 − posterior sd / prior sd, in the box of "
        "the prior; 100 % is a point, 0 % means that the data said nothing."
    )
    if split:
        columns.insert(3, "Noise alone, sd")
        caption += (
            " Mean, sd and interval hold the noise and what the model misses; beside them the sd that noise alone "
            "would give, were the model exact."
        )
    if not cluster.converged:
        caption += " Its chains did not converge."
    return Table(columns, rows, caption, left=[3 + split, 5 + split, 6 + split])
