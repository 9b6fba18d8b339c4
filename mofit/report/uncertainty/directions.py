"""Combinations of parameters: which ones the data fix, which ones they leave open, in physical terms."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from markupsafe import Markup

from mofit.report.display import THIN, badge, listed, number, symbol
from mofit.report.page import Block, Raw, Section, Table, Text, tabs
from mofit.report.posterior import FLAT, STRONG, correlation
from mofit.report.run import Array, Cluster, Run, tab_title

_MAIN = 0.3
"""Share of the largest weight from which a parameter counts as part of a direction."""

_LISTED = 8
"""Most pairs that are told in words; the corner plot shows all."""

PRIOR_SD = 1 / np.sqrt(12)
"""Standard deviation of the uniform prior on the unit box."""


@dataclass(frozen=True)
class Change:
    """How a parameter changes over one posterior standard deviation along a direction.

    `relative` is the change over the value (nan where the value is less than its own standard deviation from 0).
    """

    parameter: str
    unit: str
    absolute: float
    relative: float

    @property
    def text(self) -> Markup:
        """The change as an engineer says it."""
        value = self.absolute if np.isnan(self.relative) else 100 * self.relative
        sign = "+" if value >= 0 else "−"
        if np.isnan(self.relative):
            size = number(abs(value), 2) + ("" if self.unit == "1" else f"{THIN}{self.unit}")
        elif value >= 100:
            sign, size = "×", number(1 + self.relative, 2)
        else:
            size = f"{number(abs(value), 2)}{THIN}%"
        return Markup("{}&nbsp;{}{}").format(symbol(self.parameter), sign, size)


@dataclass(frozen=True)
class Direction:
    """A principal direction of the posterior in the unit box.

    `weights` is its unit vector over all parameters; `spread` the posterior's standard deviation along it over the
    prior's; `changes` what one posterior standard deviation along it means for the parameters that take part.
    """

    weights: Array
    spread: float
    changes: list[Change]

    @property
    def flat(self) -> bool:
        """Whether the data leave it open."""
        return self.spread > FLAT


@dataclass(frozen=True)
class Pair:
    """Two strongly correlated parameters.

    `ratio` is the change of the second, in per cent of its size, that goes with one per cent more of the first; nan
    where one of them is less than its standard deviation from 0.
    """

    first: str
    second: str
    correlation: float
    ratio: float

    @property
    def text(self) -> Markup:
        """The pair in words."""
        how = "rise and fall together" if self.correlation > 0 else "trade against each other"
        text = Markup("{} and {} {} (correlation {})").format(
            symbol(self.first), symbol(self.second), how, number(self.correlation, 2)
        )
        if np.isfinite(self.ratio):
            sign = "+" if self.ratio > 0 else "−"
            text += Markup(": {}&nbsp;+1{t}% goes with {}&nbsp;{}{}{t}%").format(
                symbol(self.first), symbol(self.second), sign, number(abs(self.ratio), 2), t=THIN
            )
        return text + Markup(".")


def principal_directions(run: Run, cluster: Cluster) -> list[Direction]:
    r"""Eigenvectors of the posterior covariance in the unit box, widest first.

    .. math:: C v_i = \lambda_i v_i, \qquad \mathrm{spread}_i = \sqrt{12 \lambda_i}
    """
    assert cluster.draws is not None
    place = run.to_unit(cluster.draws.reshape(-1, len(cluster.parameters)), cluster.parameters)
    values, vectors = np.linalg.eigh(np.atleast_2d(np.cov(place.T)))
    found = []
    for value, vector in zip(values[::-1], vectors.T[::-1], strict=True):
        order = np.argsort(-np.abs(vector), kind="stable")
        weights = vector * (1.0 if vector[order[0]] >= 0 else -1.0)
        sd = float(np.sqrt(max(value, 0.0)))
        main = [int(k) for k in order if abs(weights[k]) > _MAIN * abs(weights[order[0]])]
        found.append(Direction(weights, sd / PRIOR_SD, _changes(run, cluster, sd * weights, main)))
    return found


def _changes(run: Run, cluster: Cluster, step: Array, main: list[int]) -> list[Change]:
    names = cluster.parameters
    lower, upper = (np.asarray(run.of_parameters(key, names), dtype=float) for key in ("lower", "upper"))
    log, mean, sd = run.is_log(names), cluster.array("mean"), cluster.array("sd")
    found = []
    for k in main:
        if log[k]:
            relative = float((upper[k] / lower[k]) ** step[k] - 1)
            absolute = relative * float(mean[k])
        else:
            absolute = float(step[k] * (upper[k] - lower[k]))
            relative = absolute / abs(float(mean[k])) if abs(mean[k]) > sd[k] else np.nan
        found.append(Change(names[k], run.unit(names[k]), absolute, relative))
    return found


def strong_pairs(run: Run, cluster: Cluster) -> list[Pair]:
    """Pairs correlated by more than `STRONG` in the unit box, strongest first."""
    matrix, names = correlation(run, cluster), cluster.parameters
    mean, sd = cluster.array("mean"), cluster.array("sd")
    share = np.where(np.abs(mean) > sd, sd / np.maximum(np.abs(mean), np.finfo(float).tiny), np.nan)
    found = [
        Pair(names[i], names[j], float(matrix[i, j]), float(np.sign(matrix[i, j]) * share[j] / share[i]))
        for i in range(len(names))
        for j in range(i + 1, len(names))
        if abs(matrix[i, j]) > STRONG
    ]
    return sorted(found, key=lambda pair: -abs(pair.correlation))


def directions_section(run: Run) -> Section | None:
    """Strong correlations and all principal directions, per solution."""
    panes: dict[str, list[Block]] = {}
    data = {}
    for cluster in run.shown:
        if cluster.draws is None:
            continue
        pairs, found = strong_pairs(run, cluster), principal_directions(run, cluster)
        panes[tab_title(cluster)] = [*(Text(text) for text in words(found)), _pairs(pairs), _table(found)]
        data[cluster.name] = {
            "parameters": cluster.parameters,
            "correlation": correlation(run, cluster),
            "pairs": pairs,
            "directions": found,
        }
    if not panes:
        return None
    return Section("directions", "Correlations and flat directions", tabs(panes), {"clusters": data})


def words(directions: list[Direction]) -> list[Markup]:
    """The flat directions, or that there is none."""
    texts = [_flat_words(direction) for direction in directions if direction.flat]
    if texts:
        return texts
    widest = directions[0]
    text = Markup("No direction is flat: the widest ({}) is {} as wide as the prior.")
    return [text.format(listed([change.text for change in widest.changes]), _share(widest.spread))]


def _pairs(pairs: list[Pair]) -> Block:
    if not pairs:
        return Text(f"No two parameters are correlated by more than {STRONG}.")
    items = Markup("").join(Markup("<li>{}</li>").format(pair.text) for pair in pairs[:_LISTED])
    more = f" The {_LISTED} strongest of {len(pairs)}:" if len(pairs) > _LISTED else ""
    head = Markup("<p>Correlated by more than {}, so that the data know a combination better than either:{}</p>")
    return Raw(head.format(STRONG, more) + Markup("<ul>{}</ul>").format(items))


def _flat_words(direction: Direction) -> Markup:
    wide = _share(min(direction.spread, 1.0))
    if len(direction.changes) == 1:
        name = symbol(direction.changes[0].parameter)
        return Markup("<b>Flat:</b> {} is left open: the posterior is {} as wide as the prior.").format(name, wide)
    return Markup(
        "<b>Flat:</b> {} together hardly change the fit: along this direction the posterior is {} as wide as the prior."
    ).format(listed([change.text for change in direction.changes]), wide)


def _share(spread: float) -> str:
    return f"{number(100 * spread, 2)}{THIN}%"


def _table(directions: list[Direction]) -> Table:
    rows = [
        [
            str(k),
            Markup('<span class="words">{}</span>').format(
                Markup(", ").join(change.text for change in direction.changes)
            ),
            _share(direction.spread),
            badge("flat", "bad") if direction.flat else badge("fixed by the data", "good"),
        ]
        for k, direction in enumerate(directions, 1)
    ]
    return Table(
        ["No.", "One standard deviation along it", "Width, prior = 100 %", ""],
        rows,
        "Principal directions of the posterior in the box of the prior, widest first: the last are the combinations "
        f"that the data know best. A direction wider than {_share(FLAT)} of the prior counts as flat.",
        left=[1, 3],
    )
