"""Whether the tests, each on its own, agree on one value of a parameter."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from mofit.report.display import THIN, badge, compact, listed, math_symbol, number, percent, symbol, with_sd
from mofit.report.page import Block, Figure, Section, Table, Text
from mofit.report.per_frequency import PerTest, draw_per_test, extract_per_test
from mofit.report.posterior import FLAT
from mofit.report.run import Array, Run
from mofit.report.style import MEASURED, cluster_colour, image_of, legend_above, line_key, panels
from mofit.report.uncertainty.directions import PRIOR_SD
from mofit.result.agreement import cochran

CHANCE = 0.01
"""p value below which the tests are said to disagree."""

_EDGE = 1e-3
"""Share of the box within which an estimate is at its bound."""

_FEWEST, _DRIFT = 5, 0.7
"""Estimates, and rank correlation with frequency, from which a drift is named."""


@dataclass(frozen=True)
class Homogeneity:
    """Cochran's test on one parameter.

    `pooled` and `pooled_sd` are in the parameter's SI unit; `p` and `i_squared` are nan with fewer than two estimates.
    `drift` is the rank correlation of the estimates with frequency, nan with fewer than five or without frequencies.
    """

    parameter: str
    used: list[str]
    at_bound: list[str]
    wide: list[str]
    pooled: float
    pooled_sd: float
    q: float
    p: float
    i_squared: float
    drift: float

    @property
    def agree(self) -> bool | None:
        """Whether the tests agree; None where too few can be used."""
        return None if np.isnan(self.p) else self.p >= CHANCE


def extract_homogeneity(run: Run, found: PerTest) -> list[Homogeneity]:
    """The test for every parameter that single tests were asked for, in the scale that is searched (log or linear)."""
    return [_homogeneity(run, found, k, name) for k, name in enumerate(found.parameters)]


def _homogeneity(run: Run, found: PerTest, k: int, name: str) -> Homogeneity:
    value, sd = found.value[:, 0, k], found.sd[:, 0, k]
    place = run.to_unit(value[:, None], [name])[:, 0]
    width = sd / _slope(run, name, value)
    there = np.isfinite(place) & np.isfinite(width) & (width > 0)
    bound = there & ((place < _EDGE) | (place > 1 - _EDGE))
    wide = there & ~bound & (width > FLAT * PRIOR_SD)
    used = there & ~bound & ~wide
    mean, spread, q, p, i_squared = cochran(place[used], width[used])
    pooled = run.from_unit(np.array([[mean]]), [name])[:, 0]

    def names(mask: NDArray[np.bool_]) -> list[str]:
        return [test for test, on in zip(found.tests, mask, strict=True) if on]

    return Homogeneity(
        parameter=name,
        used=names(used),
        at_bound=names(bound),
        wide=names(wide),
        pooled=float(pooled[0]),
        pooled_sd=float(spread * _slope(run, name, pooled)[0]),
        q=q,
        p=p,
        i_squared=i_squared,
        drift=_rank_correlation(found.frequency[used], value[used]),
    )


def _rank_correlation(x: Array, y: Array) -> float:
    if len(x) < _FEWEST or not np.isfinite(x).all() or np.ptp(x) == 0 or np.ptp(y) == 0:
        return float("nan")
    return float(np.corrcoef(np.argsort(np.argsort(x)), np.argsort(np.argsort(y)))[0, 1])


def _slope(run: Run, name: str, value: Array) -> Array:
    """Change of the value per change of its place in the box."""
    lower, upper = (float(run.of_parameters(key, [name])[0]) for key in ("lower", "upper"))
    if run.is_log([name])[0]:
        return value * np.log(upper / lower)
    return np.full(value.shape, upper - lower)


def heterogeneity_section(run: Run) -> Section | None:
    """Words, figure and table; None where no test was identified on its own with a spread."""
    found = extract_per_test(run)
    if found is None or not np.isfinite(found.sd[:, 0]).any():
        return None
    results = extract_homogeneity(run, found)
    blocks: list[Block] = [
        Text(
            "Each test identified on its own. If the model is right, the estimates scatter as their own spread says. "
            "Cochran's Q tells how likely such a scatter is by chance (below "
            f"{100 * CHANCE:.0f} % the tests are said to disagree), and I² which share of it the spread does not "
            "explain. A parameter on which the tests disagree takes up something that differs between them."
        ),
        *(Text(words(result)) for result in results),
        _figure(run, found, results),
        _table(run, found, results),
    ]
    return Section("heterogeneity", "Estimates of single tests", blocks, {"parameters": results, "estimates": found})


def words(result: Homogeneity) -> Markup:
    """The outcome for one parameter, and what was left out."""
    name = symbol(result.parameter)
    if result.agree is None:
        text = Markup("<b>{}:</b> too few tests can tell it on their own").format(name)
    elif result.agree:
        text = Markup("<b>{}:</b> the {} tests agree (p = {})").format(name, len(result.used), _p(result.p))
    else:
        text = Markup("<b>{}:</b> the {} tests disagree beyond their spread (p {}, I² = {}{}%){}").format(
            name, len(result.used), _p(result.p, "= "), f"{100 * result.i_squared:.0f}", THIN, _drift(result.drift)
        )
    out = []
    if result.at_bound:
        out.append(Markup("at a bound: {}").format(listed(result.at_bound)))
    if result.wide:
        out.append(Markup("about as wide as the box: {}").format(listed(result.wide)))
    return text + (Markup(" (left out, {})").format(Markup("; ").join(out)) if out else Markup("")) + Markup(".")


def _drift(r: float) -> str:
    if not abs(r) > _DRIFT:
        return ""
    return f"; the estimates {'rise' if r > 0 else 'fall'} with frequency (rank correlation {number(r, 2)})"


def _p(p: float, equals: str = "") -> str:
    return "< 0.0001" if p < 1e-4 else equals + number(p, 2)


def _figure(run: Run, found: PerTest, results: list[Homogeneity]) -> Figure:
    names = found.parameters
    lower, upper = run.of_parameters("lower", names), run.of_parameters("upper", names)
    shown = _marked(found, results)
    canvas, axes, _ = panels(len(names), 3, 2.1, margin=(0.8, 0.55, 0.15, 0.6), gap=(0.8, 0.8))
    for k, panel in enumerate(axes):
        draw_per_test(shown, k, (float(lower[k]), float(upper[k])), bool(run.is_log(names)[k]), panel)
        unit = run.unit(names[k])
        panel.set_title(math_symbol(names[k]) + ("" if unit == "1" else f"  ({unit})"))
        if k >= len(names) - 3 and np.isfinite(found.frequency).all():
            panel.set_xlabel("frequency (Hz)")
    handles = [line_key(MEASURED, "a test alone, ± sd", ls="none", marker="o", ms=5)]
    if np.isfinite(shown.value[:, 1]).any():
        handles.append(line_key(MEASURED, "left out", ls="none", marker="o", mfc="white", ms=5))
    handles.append(line_key(cluster_colour(0), f"all tests together, {run.clusters[0].name}, 5–95 %", lw=3, alpha=0.7))
    legend_above(canvas, handles)
    return Figure(
        image_of(canvas),
        "Estimates from each test alone with their standard deviation, and the joint estimate",
        "A parameter per panel: its best minimum from each test alone, and the estimate from all tests together.",
        good="about two thirds of the bars cross the line of the joint estimate.",
        bad="the estimates drift with frequency by many bars.",
    )


def _marked(found: PerTest, results: list[Homogeneity]) -> PerTest:
    """The best minima as first, those left out as second."""
    kept = np.array([[test in result.used for result in results] for test in found.tests])
    best = found.value[:, 0]
    value = np.stack([np.where(kept, best, np.nan), np.where(kept, np.nan, best)], axis=1)
    return replace(found, value=value, sd=found.sd[:, :1])


def _table(run: Run, found: PerTest, results: list[Homogeneity]) -> Table:
    rows = []
    for k, r in enumerate(results):
        unit = run.unit(r.parameter)
        verdict = {None: badge("too few", "fair"), True: badge("agree", "good"), False: badge("disagree", "bad")}
        rows.append(
            [
                symbol(r.parameter),
                f"{with_sd(r.pooled, r.pooled_sd)} ± {number(r.pooled_sd, 2)}" if r.used else "–",
                with_sd(float(found.joint[k]), float(found.joint_high[k] - found.joint_low[k]) / 3.29),
                "" if unit == "1" else unit,
                f"{len(r.used)} of {len(found.tests)}",
                compact(r.q, 4),
                str(max(len(r.used) - 1, 0)),
                _p(r.p) if np.isfinite(r.p) else "–",
                percent(r.i_squared),
                verdict[r.agree],
            ]
        )
    return Table(
        ["Parameter", "Tests pooled ± sd", "All together", "Unit", "Used", "Q", "Degrees", "p", "I²", "Verdict"],
        rows,
        "Cochran's test of homogeneity, in the scale of the search. Standard deviations are those of the curvature "
        "(Laplace).",
        left=[3, 9],
    )
