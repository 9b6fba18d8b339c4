"""Homogeneity: whether the tests, each on its own, agree on one value of a parameter."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from mofit._typing import FloatArray
from mofit.report.directions import FLAT, PRIOR_SD
from mofit.report.overlay import NINETY
from mofit.report.per_test import PerTest, extract_per_test, farthest, per_test_panels
from mofit.report.run import Run
from mofit.report.toolkit.blocks import Block, Column, Section, Table, Text, badge, parameter_column, unit_column, words
from mofit.report.toolkit.formatting import (
    compact,
    listed,
    number,
    p_value,
    percent,
    plus_minus,
    symbol,
    whole_percent,
    with_sd,
)
from mofit.results import cochran

SIGNIFICANCE = 0.01
"""p value below which the tests disagree."""

APART = 3.0
"""Distance of the pooled estimate from the joint one, in their common standard deviation, from which they disagree."""

_EDGE = 1e-3
"""Share of the prior box within which an estimate is at its bound."""

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
    apart: float
    """Distance of the pooled estimate from that of all tests together, in their common standard deviation."""

    @property
    def agree(self) -> bool | None:
        """Whether the tests agree, with one another and with all together; None where too few can be used."""
        return None if np.isnan(self.p) else self.p >= SIGNIFICANCE and not self.apart > APART

    @property
    def text(self) -> Markup:
        """The outcome, and what was left out."""
        text = Markup("<b>{}:</b> {}").format(symbol(self.parameter), self._outcome())
        out = {"at a bound": self.at_bound, "about as wide as the prior box": self.wide}
        left = Markup("; ").join(Markup("{}: {}").format(why, listed(tests)) for why, tests in out.items() if tests)
        return text + (Markup(" (left out, {}).").format(left) if left else Markup("."))

    def _outcome(self) -> str:
        equals = "" if self.p < 1e-4 else "= "
        if self.agree is None:
            return "too few tests identify it on their own"
        if self.agree:
            return f"the {len(self.used)} tests agree (p {equals}{p_value(self.p)})"
        if self.p >= SIGNIFICANCE:
            return (
                f"the {len(self.used)} tests agree with one another, but lie {number(self.apart, 2)} standard "
                "deviations from the estimate of all together: each alone leaves out what the others decide"
            )
        text = f"the {len(self.used)} tests disagree beyond their standard deviations (p {equals}{p_value(self.p)}, "
        text += f"I² = {whole_percent(self.i_squared)})"
        if not abs(self.drift) > _DRIFT:
            return text
        how = "rise" if self.drift > 0 else "fall"
        return f"{text}; the estimates {how} with frequency (rank correlation {number(self.drift, 2)})"


def extract_homogeneity(run: Run, found: PerTest) -> list[Homogeneity]:
    """The test for every parameter that single tests estimate, in the scale that is searched (log or linear)."""
    return [_homogeneity(run, found, k, name) for k, name in enumerate(found.parameters)]


def _homogeneity(run: Run, found: PerTest, k: int, name: str) -> Homogeneity:
    space, value = run.space([name]), found.value[:, 0, [k]]
    place, width = space.to_unit(value)[:, 0], found.sd[:, 0, k] / space.derivative(value)[:, 0]
    there = np.isfinite(place) & np.isfinite(width) & (width > 0)
    bound = there & ((place < _EDGE) | (place > 1 - _EDGE))
    wide = there & ~bound & (width > FLAT * PRIOR_SD)
    used = there & ~bound & ~wide
    mean, sd, q, p, i_squared = cochran(place[used], width[used])
    pooled = space.from_unit(np.array([mean]))
    pooled_sd = float(sd * space.derivative(pooled)[0])
    joint, low, high = found.joint[k]

    def names(mask: NDArray[np.bool_]) -> list[str]:
        return [test for test, on in zip(found.tests, mask, strict=True) if on]

    return Homogeneity(
        parameter=name,
        used=names(used),
        at_bound=names(bound),
        wide=names(wide),
        pooled=float(pooled[0]),
        pooled_sd=pooled_sd,
        q=q,
        p=p,
        i_squared=i_squared,
        drift=_rank_correlation(found.frequency[used], value[used, 0]),
        apart=float(abs(pooled[0] - joint) / np.hypot(pooled_sd, (high - low) / (2 * NINETY))),
    )


def _rank_correlation(x: FloatArray, y: FloatArray) -> float:
    if len(x) < _FEWEST or not np.isfinite(x).all() or np.ptp(x) == 0 or np.ptp(y) == 0:
        return float("nan")
    return float(np.corrcoef(np.argsort(np.argsort(x)), np.argsort(np.argsort(y)))[0, 1])


def homogeneity_section(run: Run) -> Section | None:
    """Text, figure and table; None where no test was identified on its own with a standard deviation."""
    found = extract_per_test(run)
    if found is None or not np.isfinite(found.sd[:, 0]).any():
        return None
    results = extract_homogeneity(run, found)
    text = (
        "Each test is identified alone. If the model is right, the estimates scatter as their standard deviations "
        "predict. Cochran's Q tests this: p is the probability of at least such a scatter. Below "
        f"{whole_percent(SIGNIFICANCE)} the tests disagree. I² is the share of the scatter that the standard "
        "deviations do not explain. A parameter on which the tests disagree compensates for something that differs "
        "between them."
    )
    figure = per_test_panels(run, _marked(found, results), "a test alone, ± sd", "left out").figure(
        "Estimates from each test alone with their standard deviation, and the joint estimate",
        "A parameter per panel: its best minimum from each test alone, and the estimate from all tests together.",
        good="about two thirds of the bars cross the line of the joint estimate.",
        bad="the estimates drift with frequency by many bars.",
        finding=farthest(found),
    )
    blocks: list[Block] = [Text(text), *(Text(result.text) for result in results), figure, _table(run, found, results)]
    return Section("homogeneity", "Estimates of single tests", blocks, {"parameters": results, "estimates": found})


def _marked(found: PerTest, results: list[Homogeneity]) -> PerTest:
    """The best minima as first, those left out as second."""
    kept = np.array([[test in result.used for result in results] for test in found.tests])
    best = found.value[:, 0]
    value = np.stack([np.where(kept, best, np.nan), np.where(kept, np.nan, best)], axis=1)
    return replace(found, value=value, sd=found.sd[:, :1])


def _table(run: Run, found: PerTest, results: list[Homogeneity]) -> Table:
    verdict = {None: badge("too few", "fair"), True: badge("agree", "good"), False: badge("disagree", "bad")}
    return Table(
        [
            parameter_column(r.parameter for r in results),
            Column("Tests pooled ± sd", [plus_minus(r.pooled, r.pooled_sd) if r.used else "–" for r in results]),
            Column("All together", [with_sd(value, (high - low) / (2 * NINETY)) for value, low, high in found.joint]),
            unit_column(run.unit(r.parameter) for r in results),
            Column("Used", [f"{len(r.used)} of {len(found.tests)}" for r in results]),
            Column("Q", [compact(r.q, 4) for r in results]),
            Column("Degrees of freedom", [str(max(len(r.used) - 1, 0)) for r in results]),
            Column("p", ["–" if np.isnan(r.p) else p_value(r.p) for r in results]),
            Column("I²", [percent(r.i_squared) for r in results]),
            words("Verdict", [verdict[r.agree] for r in results]),
        ],
        "Cochran's test of homogeneity, in the scale of the search. Standard deviations are those of the curvature "
        "(Laplace).",
    )
