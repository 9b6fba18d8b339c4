"""The summary of the uncertainty page: one row per parameter with its uncertainty and a sentence; the same as JSON."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from markupsafe import Markup, escape

from mofit.errors import Issue, did_you_mean, raise_errors
from mofit.report.calibration import calibrated
from mofit.report.directions import Pair, strong_pairs
from mofit.report.estimates import Estimate, estimate_columns, extract_estimates, unconverged
from mofit.report.per_test import extract_per_test
from mofit.report.run import Mode, Run
from mofit.report.summary import extract_headline, trust_banners
from mofit.report.toolkit.blocks import Block, Section, Table, Text, tabs, words, wrapped
from mofit.report.toolkit.formatting import THIN, listed, number, symbol, unit_text, whole_percent, with_sd
from mofit.report.uncertainty.homogeneity import extract_homogeneity

UNIDENTIFIABLE = "not identifiable"
"""Verdict of a parameter that the data do not inform."""

_UNMOVED = 0.9
_WIDER = 1.1
"""Shares of a calibration stage's standard deviation between which the tests have added next to nothing."""


@dataclass(frozen=True)
class Row:
    """One parameter of one mode, and what its numbers mean; `plain` is the sentence without markup."""

    estimate: Estimate
    sentence: Markup
    plain: str


def extract_rows(run: Run, mode: Mode) -> list[Row]:
    """The parameters of a mode in order."""
    pairs, stages = strong_pairs(run, mode), calibrated(run)
    rows = []
    for estimate in extract_estimates(run, mode):
        _, earlier = stages.get(estimate.parameter, (np.nan, np.nan))
        plain = sentence(estimate, pairs, earlier, lambda name: Markup(escape(name))).unescape()
        rows.append(Row(estimate, sentence(estimate, pairs, earlier), plain))
    return rows


def sentence(
    estimate: Estimate, pairs: list[Pair], earlier: float = np.nan, show: Callable[[str], Markup] = symbol
) -> Markup:
    """What the data say of a parameter, in one sentence.

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
    parts = [Markup(escape(_identified(estimate)))]
    if estimate.at_bound:
        side = "upper" if estimate.at_bound > 0 else "lower"
        parts.append(Markup("its MAP estimate is at its {} bound: widen the box, or check the model").format(side))
    off = abs(estimate.mean - estimate.value) / estimate.sd if estimate.sd > 0 else 0.0
    if off > 1 and not estimate.at_bound:
        parts.append(Markup("its mean is {} sd from the MAP estimate").format(number(off, 2)))
    if np.isfinite(earlier) and earlier > 0 and np.isfinite(estimate.sd):
        parts.append(Markup(escape(_against_stage(estimate.sd / earlier))))
    for pair in pairs:
        if estimate.parameter in (pair.first, pair.second):
            other = pair.second if estimate.parameter == pair.first else pair.first
            parts.append(Markup("correlated with {} ({})").format(show(other), number(pair.correlation, 2)))
            break
    return show(estimate.parameter) + Markup(": ") + Markup("; ").join(parts) + Markup(".")


def _identified(e: Estimate) -> str:
    """How far the data identify the parameter."""
    unit = THIN + e.unit if unit_text(e.unit) else ""
    low, high = with_sd(e.q05, e.sd) + unit, with_sd(e.q95, e.sd) + unit
    verdict = e.verdict.lower()
    if not np.isfinite(e.sd):
        return "not sampled, so its uncertainty is not known"
    if verdict.startswith("lower limit"):
        return f"only a lower limit: above {low} with a probability of 95{THIN}%"
    if verdict.startswith("upper limit"):
        return f"only an upper limit: below {high} with a probability of 95{THIN}%"
    if e.contraction < 0.1:
        return "not identifiable from these data: the posterior equals the prior"
    if verdict.startswith(UNIDENTIFIABLE):
        return "not identifiable from these data: the posterior reaches both bounds"
    if verdict.startswith("weak") or e.contraction < 0.5:
        width = whole_percent(1 - e.contraction)
        return f"weakly identified, between {low} and {high}: a range, not a value, {width} as wide as the prior"
    if abs(e.mean) > 2 * e.sd:
        return f"identified to ± {number(100 * e.sd / abs(e.mean), 2)}{THIN}%"
    return f"identified to ± {number(e.sd, 2)}{unit}; zero is not excluded"


def _against_stage(share: float) -> str:
    """The standard deviation against that of the calibration stage."""
    if share > _WIDER:
        return f"its sd is {number(share, 2)}× that of its calibration stage alone"
    if share > _UNMOVED:
        return "its sd is that of its calibration stage: the other tests add nothing"
    return f"its sd is {whole_percent(1 - share)} smaller than that of its calibration stage alone"


def table_section(run: Run) -> Section:
    """Banner, what is shown, and a table per mode, best first."""
    rows = {mode.name: extract_rows(run, mode) for mode in run.modes}
    panes: dict[str, list[Block]] = {mode.title: [_table(run, mode, rows[mode.name])] for mode in run.modes}
    blocks: list[Block] = [*trust_banners(extract_headline(run)), *map(Text, _overview(run)), *tabs(panes)]
    return Section("summary", "Summary", blocks, {"converged": run.converged, "modes": rows})


def _overview(run: Run) -> list[Markup]:
    best, texts = run.best, []
    if len(run.plausible) > 1:
        text = Markup("<b>{} posterior modes are plausible:</b> {}. Each table below describes one of them.")
        texts.append(text.format(len(run.plausible), listed([mode.title for mode in run.plausible])))
    for grade, head in {"good": "Identified", "fair": "Only a limit or a range", "bad": "Not identified"}.items():
        names = [symbol(name) for name, own in zip(best.parameters, best.grades, strict=True) if own == grade]
        if names:
            texts.append(Markup("<b>{}:</b> {}.").format(head, listed(names)))
    return texts


def _table(run: Run, mode: Mode, rows: list[Row]) -> Table:
    estimates = [row.estimate for row in rows]
    columns = estimate_columns(run, estimates)
    heads = ["Parameter", "Mean ± sd", "90 % interval", "Unit", "Contraction", "Verdict"]
    caption = (
        f"Mode {mode.name}{unconverged(mode)} Contraction is 1 − posterior sd / prior sd in the prior box: 100 % is a "
        "point; at 0 % the data do not inform the parameter."
    )
    if any(np.isfinite(e.noise_sd) for e in estimates):
        heads.insert(3, "Noise alone, sd")
        caption += (
            " Mean, sd and interval account for noise and model discrepancy. The sd from noise alone holds if the "
            "model is exact."
        )
    return Table(
        [*(columns[head] for head in heads), words("Meaning", [wrapped(row.sentence) for row in rows])], caption
    )


def uncertainty_summary(tree: xr.DataTree, asked: Sequence[str] = ()) -> dict[str, Any]:
    """The uncertainty of a run as one JSON object, which ``mofit uncertainty --json`` prints; not finite is None.

    Parameters
    ----------
    tree
        A ``mofit.result/2`` tree.
    asked
        Parameters for which it is asked whether the data identify them.

    Returns
    -------
    dict
        ``converged``; ``modes``, best first, with ``id``, ``probability`` and ``parameters`` by name; ``homogeneity``
        by name; ``not_identifiable``, those of `asked` that a plausible mode leaves unidentified.

    Raises
    ------
    InputError
        If one of `asked` is no free parameter of the run.
    """
    run = Run(tree)
    known = run.best.parameters
    raise_errors(
        Issue(f"--parameter {name}", "the run has no free parameter of this name", did_you_mean(name, known))
        for name in asked
        if name not in known
    )
    lost = {
        n for mode in run.plausible for n, v in zip(mode.parameters, mode.verdicts, strict=True) if v == UNIDENTIFIABLE
    }
    return {
        "converged": run.converged,
        "modes": [
            {
                "id": mode.name,
                "probability": _number(mode.probability),
                "parameters": {row.estimate.parameter: _entry(row) for row in extract_rows(run, mode)},
            }
            for mode in run.modes
        ],
        "homogeneity": _homogeneity(run),
        "not_identifiable": [name for name in dict.fromkeys(asked) if name in lost],
    }


def _entry(row: Row) -> dict[str, Any]:
    e = row.estimate
    numeric = ("value", "mean", "sd", "q05", "q95", "contraction", "noise_sd")
    plain = {"unit": e.unit, "at_bound": e.at_bound, "verdict": e.verdict, "sentence": row.plain}
    return {name: _number(getattr(e, name)) for name in numeric} | plain


def _homogeneity(run: Run) -> dict[str, Any]:
    found = extract_per_test(run)
    results = [] if found is None else extract_homogeneity(run, found)
    return {
        r.parameter: {"tests": len(r.used), "agree": r.agree}
        | {"q": _number(r.q), "p": _number(r.p), "i_squared": _number(r.i_squared)}
        for r in results
    }


def _number(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None
