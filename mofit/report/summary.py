"""The headline: what came out of a run, in a few sentences and figures."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from markupsafe import Markup

from mofit._typing import FloatArray
from mofit.report.run import PLAUSIBLE, Run
from mofit.report.toolkit.blocks import Block, Raw, Section, Text, banner, bullets, cards
from mofit.report.toolkit.formatting import (
    count,
    interval,
    listed,
    number,
    percent,
    plus_minus,
    symbol,
    unit_text,
    whole_percent,
)
from mofit.results import green
from mofit.results.sentences import (
    ALL_IDENTIFIED,
    AT_BOUND,
    CONVERGED,
    NOT_CONVERGED,
    NOT_IDENTIFIED,
    NOT_SAMPLED,
    UNKNOWN,
)

_NOTABLE = 1.2
"""Ratio of a test's error to its noise floor from which the worst test is named."""

_FAVOURED = 0.9
"""Probability of the best mode from which the data favour it."""


@dataclass(frozen=True)
class Headline:
    """The figures of the headline; NRMSD are means over the tests that the best mode predicts."""

    converged: bool
    green: bool
    """Nothing speaks against the numbers."""
    sampled: bool
    findings: list[dict[str, str]]
    """What to know before the numbers: kind, level and text."""
    plausible: int
    nrmsd: float
    noise_floor: float
    baseline: float
    largest_r_hat: float
    smallest_ess: float
    graded: bool
    not_identified: list[str]
    at_bound: list[str]
    worst_test: str
    worst_ratio: float


def extract_headline(run: Run) -> Headline:
    """Reduce the run to a few figures."""
    best = run.best
    nrmsd, floor = run.of_objectives("nrmsd", best.node), run.of_objectives("noise_floor")
    used = np.isfinite(nrmsd)
    ratio = np.where(used & (floor > 0), nrmsd / np.where(floor > 0, floor, 1.0), -np.inf)
    worst = int(np.argmax(ratio))
    r_hat, ess = (_finite(*(mode.array(name) for mode in run.plausible)) for name in ("r_hat", "ess"))
    return Headline(
        converged=run.converged,
        green=green(run.tree),
        sampled=run.best.sampled,
        findings=run.findings,
        plausible=len(run.plausible),
        nrmsd=_mean(nrmsd[used]),
        noise_floor=_mean(floor[used]),
        baseline=_mean(run.baseline_nrmsd[used]),
        largest_r_hat=float(r_hat.max()) if r_hat.size else np.nan,
        smallest_ess=float(ess.min()) if ess.size else np.nan,
        graded="unknown" not in best.grades,
        not_identified=[n for n, grade in zip(best.parameters, best.grades, strict=True) if grade in ("fair", "bad")],
        at_bound=[n for n, bound in zip(best.parameters, best.array("at_bound"), strict=True) if bound],
        worst_test=run.objective_names[worst],
        worst_ratio=float(ratio[worst]),
    )


def _finite(*arrays: FloatArray) -> FloatArray:
    values = np.concatenate([*arrays, np.empty(0)])
    return values[np.isfinite(values)]


def _mean(values: FloatArray) -> float:
    finite = _finite(values)
    return float(finite.mean()) if finite.size else np.nan


def summary_section(run: Run) -> Section:
    """Banner, sentences and a row of key figures."""
    found = extract_headline(run)
    blocks: list[Block] = [*trust_banners(found), Text(_identified(run, found))]
    warnings = run.json("warnings")
    if warnings:
        blocks.append(bullets(warnings, Markup("<b>Warnings of the run</b>")))
    blocks += [_cards(run, found), *(Text(text) for text in (_best(run), _fit(run, found), _modes(run, found)))]
    return Section("summary", "Summary", blocks, {"headline": found, "warnings": warnings})


def trust_banners(found: Headline) -> list[Raw]:
    """What must be known before the numbers, each in a coloured box; green only where nothing speaks against them."""
    grades = {"untrusted": "bad", "caution": "fair"}
    return [
        *(banner(entry["text"], grades.get(entry["level"], "fair")) for entry in found.findings),
        _convergence(found),
    ]


def _convergence(found: Headline) -> Raw:
    """Whether the sampling converged."""
    if not found.sampled:
        return banner(NOT_SAMPLED, "fair")
    ess = count(found.smallest_ess) if np.isfinite(found.smallest_ess) else "–"
    figures = f" (largest R-hat {found.largest_r_hat:.3f}, smallest effective sample size {ess})"
    if found.converged:
        return banner(CONVERGED.format(figures=figures), "good" if found.green else "fair")
    return banner(NOT_CONVERGED.format(figures=figures), "bad")


def _cards(run: Run, found: Headline) -> Raw:
    parameters = len(run.best.parameters)
    items = [
        (percent(found.nrmsd), "mean NRMSD of the best mode"),
        (percent(found.noise_floor), "noise floor: the least any model can reach"),
    ]
    if np.isfinite(found.baseline):
        items.append((percent(found.baseline), f"baseline: {run.baseline_title}"))
    modes = "plausible mode" if found.plausible == 1 else "plausible modes"
    items.append((str(found.plausible), f"{modes} (probability above {whole_percent(PLAUSIBLE)})"))
    if found.graded:
        items.append((f"{parameters - len(found.not_identified)} of {parameters}", "parameters identified"))
    seconds = run.json("seconds")
    if seconds:
        items.append((f"{number(seconds.get('total', sum(seconds.values())))} s", "computing time"))
    return cards(items)


def _best(run: Run) -> Markup:
    best = run.best
    rows = zip(best.parameters, *(best.array(name) for name in ("value", "sd", "q05", "q95")), strict=True)
    values = [
        Markup("{}&nbsp;= {}{}").format(
            symbol(name), _estimate(*numbers), f" {run.unit(name)}" if unit_text(run.unit(name)) else ""
        )
        for name, *numbers in rows
    ]
    share = f" (posterior probability {percent(best.probability)})" if len(run.modes) > 1 else ""
    return Markup("<b>Best mode {}</b>{}: {}.").format(best.name, share, listed(values))


def _estimate(value: float, sd: float, low: float, high: float) -> str:
    """A value with its standard deviation, or the 90 % interval where that does not hold the value."""
    if value < low or value > high:
        return f"{interval(low, high, sd)} (90\u00a0%)"
    return plus_minus(value, sd).replace(" ±", "\u00a0±")


def _fit(run: Run, found: Headline) -> Markup:
    over = found.nrmsd / found.noise_floor if found.noise_floor > 0 else np.nan
    text = Markup("<b>Error.</b> The mean NRMSD is {}, {}× the noise floor of {}.").format(
        percent(found.nrmsd), number(over), percent(found.noise_floor)
    )
    if np.isfinite(found.baseline):
        change = 1 - found.nrmsd / found.baseline
        text += Markup(" The baseline {} reaches {}: the model's error is {} {}.").format(
            run.baseline_title,
            percent(found.baseline),
            whole_percent(abs(change)),
            "smaller" if change >= 0 else "larger",
        )
    if np.isfinite(found.worst_ratio) and found.worst_ratio > _NOTABLE:
        text += Markup(" The largest residual is that of {}: {}× its noise floor.").format(
            found.worst_test, number(found.worst_ratio)
        )
    return text


def _modes(run: Run, found: Headline) -> Markup:
    if found.plausible == 1:
        others = len(run.modes) - 1
        more = f" The search found {others} more, each with a probability below {whole_percent(PLAUSIBLE)}."
        return Markup("<b>Modes.</b> One posterior mode is plausible.{}").format(more if others else "")
    shares = listed([f"{mode.name} ({percent(mode.probability)})" for mode in run.plausible])
    sentence = (
        f"The data favour {run.best.name} but do not exclude the others."
        if run.best.probability > _FAVOURED
        else "The data alone do not distinguish them."
    )
    return Markup("<b>Modes.</b> {} posterior modes are plausible: {}. {}").format(found.plausible, shares, sentence)


def _identified(run: Run, found: Headline) -> Markup:
    if not found.graded and not found.not_identified:
        text = Markup(UNKNOWN)
    elif not found.not_identified:
        text = Markup(ALL_IDENTIFIED).format(count=len(run.best.parameters))
    else:
        at_bound = listed([symbol(name) for name in found.at_bound])
        bounds = Markup(AT_BOUND).format(names=at_bound) if found.at_bound else Markup("")
        names = listed([symbol(name) for name in found.not_identified])
        text = Markup(NOT_IDENTIFIED).format(names=names, bounds=bounds)
    return Markup("<b>Parameters.</b> ") + text
