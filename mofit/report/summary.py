"""The headline: what came out, in plain words."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup

from mofit.report.display import THIN, count, listed, number, percent, symbol, with_sd
from mofit.report.page import Block, Raw, Section, Text
from mofit.report.run import PLAUSIBLE, Run, numbers


@dataclass(frozen=True)
class Headline:
    """The figures of the headline; NRMSD are means over the tests that the best solution predicts."""

    converged: bool
    plausible: int
    nrmsd: float
    noise_floor: float
    baseline: float
    largest_r_hat: float
    smallest_ess: float
    graded: bool
    unpinned: list[str]
    at_bound: list[str]
    worst_test: str
    worst_ratio: float


def extract_headline(run: Run) -> Headline:
    """Boil the run down to a few figures."""
    best = run.clusters[0]
    nrmsd = numbers(best.node, "nrmsd")
    floor = run.of_tests("noise_floor")
    used = np.isfinite(nrmsd)
    ratio = np.where(used & (floor > 0), nrmsd / np.where(floor > 0, floor, 1.0), -np.inf)
    worst = int(np.argmax(ratio))
    return Headline(
        converged=run.converged,
        plausible=len(run.plausible),
        nrmsd=_mean(nrmsd[used]),
        noise_floor=_mean(floor[used]),
        baseline=_mean(run.baseline_nrmsd[used]),
        largest_r_hat=_extreme(np.max, [c.array("r_hat") for c in run.plausible]),
        smallest_ess=_extreme(np.min, [c.array("ess") for c in run.plausible]),
        graded="unknown" not in best.grades,
        unpinned=[n for n, grade in zip(best.parameters, best.grades, strict=True) if grade in ("fair", "bad")],
        at_bound=[n for n, bound in zip(best.parameters, best.array("at_bound"), strict=True) if bound],
        worst_test=run.tests[worst],
        worst_ratio=float(ratio[worst]),
    )


def _mean(values: np.ndarray) -> float:
    finite = values[np.isfinite(values)]
    return float(finite.mean()) if finite.size else float("nan")


def _extreme(choose: Callable[[np.ndarray], float], arrays: list[np.ndarray]) -> float:
    values = np.concatenate([*arrays, [np.nan]])
    finite = values[np.isfinite(values)]
    return float(choose(finite)) if finite.size else float("nan")


def summary_section(run: Run) -> Section:
    """Banner, sentences and a row of key figures."""
    found = extract_headline(run)
    blocks: list[Block] = [convergence_banner(found), _cards(run, found), Text(_best(run)), Text(_fit(run, found))]
    blocks += [Text(_solutions(run, found)), Text(_pinned(run, found))]
    warnings = run.json("warnings")
    if warnings:
        items = Markup("").join(Markup("<li>{}</li>").format(text) for text in warnings)
        blocks.append(Raw(Markup("<p><b>Warnings of the run</b></p><ul>{}</ul>").format(items)))
    return Section("summary", "Summary", blocks, {"headline": found, "warnings": warnings})


def convergence_banner(found: Headline) -> Raw:
    """Whether the run converged, in one coloured box."""
    diagnosis = f"largest R-hat {found.largest_r_hat:.3f}, smallest effective sample size {count_or_dash(found)}"
    if found.converged:
        text = f"The run converged: independent ensembles agree ({diagnosis})."
        return Raw(Markup('<div class="banner good" role="status">{}</div>').format(text))
    text = (
        f"This run did not converge ({diagnosis}). Read the intervals below as preliminary: "
        "they may be too narrow or in the wrong place. Continue the run with --resume, or give it more evaluations."
    )
    return Raw(Markup('<div class="banner bad" role="alert">{}</div>').format(text))


def count_or_dash(found: Headline) -> str:
    """The smallest effective sample size, or a dash where nothing was sampled."""
    return count(found.smallest_ess) if np.isfinite(found.smallest_ess) else "–"


def _cards(run: Run, found: Headline) -> Raw:
    cards = [
        (percent(found.nrmsd), "mean NRMSD of the best solution"),
        (percent(found.noise_floor), "noise floor: the least any model can reach"),
    ]
    if np.isfinite(found.baseline):
        cards.append((percent(found.baseline), f"baseline: {run.tree['baseline'].attrs['model_title']}"))
    cards.append((str(found.plausible), f"plausible solution{'s' if found.plausible != 1 else ''} (weight above 1 %)"))
    pinned = len(run.clusters[0].parameters) - len(found.unpinned)
    if found.graded:
        cards.append((f"{pinned} of {len(run.clusters[0].parameters)}", "parameters pinned by the data"))
    seconds = run.json("seconds")
    if seconds:
        cards.append((f"{number(seconds.get('total', sum(seconds.values())))} s", "of computing"))
    inner = Markup("").join(Markup('<div class="card"><b>{}</b><span>{}</span></div>').format(*card) for card in cards)
    return Raw(Markup('<div class="cards">{}</div>').format(inner))


def _best(run: Run) -> Markup:
    best = run.clusters[0]
    values = [
        Markup("{}&nbsp;= {}{}{}").format(
            symbol(name),
            with_sd(value, sd),
            Markup("&nbsp;± {}").format(number(sd, 2)) if np.isfinite(sd) else "",
            "" if run.unit(name) == "1" else f" {run.unit(name)}",
        )
        for name, value, sd in zip(best.parameters, best.array("value"), best.array("sd"), strict=True)
    ]
    share = f" (posterior weight {percent(best.weight)})" if len(run.clusters) > 1 else ""
    return Markup("<b>Best solution {}</b>{}: {}.").format(best.name, share, listed(values))


def _fit(run: Run, found: Headline) -> Markup:
    over = found.nrmsd / found.noise_floor if found.noise_floor > 0 else float("nan")
    text = Markup("<b>Error.</b> The mean NRMSD is {}, {}× the noise floor of {}").format(
        percent(found.nrmsd), number(over), percent(found.noise_floor)
    )
    if np.isfinite(found.baseline):
        change = 1 - found.nrmsd / found.baseline
        text += Markup("; the {} reaches {}, so the model's error is {} {}").format(
            run.baseline_title,
            percent(found.baseline),
            f"{100 * abs(change):.0f}{THIN}%",
            "smaller" if change >= 0 else "larger",
        )
    if np.isfinite(found.worst_ratio) and found.worst_ratio > 1.2:
        text += Markup(". Most is left over on {}: {}× its noise floor").format(
            found.worst_test, number(found.worst_ratio)
        )
    return text + Markup(".")


def _solutions(run: Run, found: Headline) -> Markup:
    if found.plausible == 1:
        others = len(run.clusters) - 1
        more = f"; {others} more found by the search carry less than {PLAUSIBLE:.0%} each" if others else ""
        return Markup("<b>Solutions.</b> There is one plausible solution{}.").format(more)
    shares = listed([Markup("{} ({})").format(c.name, percent(c.weight)) for c in run.plausible])
    best = run.clusters[0]
    sentence = (
        f"The data favour {best.name} but don't exclude the others."
        if best.weight > 0.9
        else "The data alone don't tell them apart."
    )
    return Markup("<b>Solutions.</b> {} solutions are plausible: {}. {}").format(found.plausible, shares, sentence)


def _pinned(run: Run, found: Headline) -> Markup:
    if not found.graded and not found.unpinned:
        return Markup("<b>Parameters.</b> Nothing was sampled, so it is not known how well the data pin them.")
    if not found.unpinned:
        return Markup("<b>Parameters.</b> The data pin all {} parameters.").format(len(run.clusters[0].parameters))
    text = Markup("<b>Parameters.</b> The data do not pin {}: read it as a range, not as a value").format(
        listed([symbol(name) for name in found.unpinned])
    )
    if found.at_bound:
        text += Markup(" ({} at a bound of the search box: widen it, or doubt the model)").format(
            listed([symbol(name) for name in found.at_bound])
        )
    return text + Markup(".")
