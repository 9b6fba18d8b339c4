"""The joint posterior: correlated parameters, and principal directions, the combinations that the data identify."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from markupsafe import Markup

from mofit._typing import FloatArray
from mofit.parameters import ParameterSpace
from mofit.report.corner import corner_figure
from mofit.report.marginals import extract_marginals, marginals_figure
from mofit.report.run import Mode, Run
from mofit.report.toolkit.blocks import (
    Block,
    Column,
    Section,
    Table,
    Text,
    badge,
    bullets,
    tabs,
    words,
    wrapped,
)
from mofit.report.toolkit.formatting import THIN, listed, number, percent, symbol, unit_text

STRONG = 0.8
"""Correlation from which two parameters are named as correlated."""

FLAT = 0.5
"""Share of the prior's standard deviation above which a direction counts as not identified."""

PRIOR_SD = 1 / np.sqrt(12)
"""Standard deviation of the uniform prior on the unit cube."""

_MAIN = 0.3
"""Share of the largest weight from which a parameter counts as part of a direction."""

_LISTED = 8
"""Most pairs that the text lists; the corner plot shows all."""


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
        """The change with its sign: in per cent, as a factor from 100 % on, else in the parameter's unit."""
        value = self.absolute if np.isnan(self.relative) else 100 * self.relative
        sign = "+" if value >= 0 else "−"
        if np.isnan(self.relative):
            size = number(abs(value), 2) + (THIN + self.unit if unit_text(self.unit) else "")
        elif value >= 100:
            sign, size = "×", number(1 + self.relative, 2)
        else:
            size = f"{number(abs(value), 2)}{THIN}%"
        return Markup("{}&nbsp;{}{}").format(symbol(self.parameter), sign, size)


@dataclass(frozen=True)
class Direction:
    """A principal direction of the posterior in the unit cube.

    `weights` is its unit vector over all parameters; `width` the posterior's standard deviation along it over the
    prior's; `changes` what one posterior standard deviation along it means for the parameters that take part.
    """

    weights: FloatArray
    width: float
    changes: list[Change]

    @property
    def flat(self) -> bool:
        """Whether the data do not identify it."""
        return self.width > FLAT

    @property
    def text(self) -> Markup:
        """What a direction that is not identified means."""
        changes, width = listed([change.text for change in self.changes]), percent(min(self.width, 1.0), 2)
        if len(self.changes) == 1:
            text = Markup("<b>Not identifiable:</b> {}. Its posterior is {} as wide as the prior.")
            return text.format(symbol(self.changes[0].parameter), width)
        return Markup(
            "<b>Not identifiable:</b> {} together hardly change the fit. Along this direction the posterior is {} as "
            "wide as the prior."
        ).format(changes, width)


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
        """The pair, and in which ratio its parameters compensate each other."""
        how = "rise and fall together" if self.correlation > 0 else "compensate each other"
        text = Markup("{} and {} {} (correlation {})").format(
            symbol(self.first), symbol(self.second), how, number(self.correlation, 2)
        )
        if np.isfinite(self.ratio):
            sign = "+" if self.ratio > 0 else "−"
            text += Markup(": {}&nbsp;+1{t}% goes with {}&nbsp;{}{}{t}%").format(
                symbol(self.first), symbol(self.second), sign, number(abs(self.ratio), 2), t=THIN
            )
        return text + Markup(".")


def correlation(run: Run, mode: Mode) -> FloatArray:
    """Correlation of the posterior draws in the unit cube, shape (parameter, parameter)."""
    d = len(mode.parameters)
    return np.corrcoef(run.space(mode.parameters).to_unit(mode.flat_draws).T).reshape(d, d)


def principal_directions(space: ParameterSpace, covariance: FloatArray, centre: FloatArray) -> list[Direction]:
    r"""Eigenvectors of a posterior covariance in the unit cube, widest first.

    .. math:: C v_i = \lambda_i v_i, \qquad \mathrm{width}_i = \sqrt{12 \lambda_i}

    Parameters
    ----------
    space
        The d parameters.
    covariance
        In the unit cube, shape (d, d).
    centre
        Values from which changes are measured, in the parameters' units, shape (d,).
    """
    values, vectors = np.linalg.eigh(covariance)
    found = []
    for value, vector in zip(values[::-1], vectors.T[::-1], strict=True):
        order = np.argsort(-np.abs(vector), kind="stable")
        weights = vector * (1.0 if vector[order[0]] >= 0 else -1.0)
        sd = float(np.sqrt(max(value, 0.0)))
        main = [int(k) for k in order if abs(weights[k]) > _MAIN * abs(weights[order[0]])]
        changes = [_change(space, k, sd * weights[k], np.sqrt(covariance[k, k]), float(centre[k])) for k in main]
        found.append(Direction(weights, sd / PRIOR_SD, changes))
    return found


def _change(space: ParameterSpace, k: int, step: float, sd: float, centre: float) -> Change:
    """Of one parameter by a step in the unit cube."""
    own = space.parameters[k]
    if own.scale == "log":
        relative = float((own.upper / own.lower) ** step - 1)
        return Change(own.name, own.unit, relative * centre, relative)
    width = own.upper - own.lower
    relative = step * width / abs(centre) if abs(centre) > sd * width else np.nan
    return Change(own.name, own.unit, float(step * width), float(relative))


def directions_of(run: Run, mode: Mode) -> list[Direction]:
    """Principal directions of the draws of a mode."""
    space = run.space(mode.parameters)
    covariance = np.atleast_2d(np.cov(space.to_unit(mode.flat_draws).T))
    return principal_directions(space, covariance, mode.array("mean"))


def strong_pairs(run: Run, mode: Mode) -> list[Pair]:
    """Pairs correlated by more than `STRONG` in the unit cube, strongest first; none where nothing was sampled."""
    if not mode.sampled:
        return []
    matrix, names = correlation(run, mode), mode.parameters
    mean, sd = mode.array("mean"), mode.array("sd")
    share = np.where(np.abs(mean) > sd, sd / np.maximum(np.abs(mean), np.finfo(float).tiny), np.nan)
    found = [
        Pair(names[i], names[j], float(matrix[i, j]), float(np.sign(matrix[i, j]) * share[j] / share[i]))
        for i in range(len(names))
        for j in range(i + 1, len(names))
        if abs(matrix[i, j]) > STRONG
    ]
    return sorted(found, key=lambda pair: -abs(pair.correlation))


def direction_texts(directions: list[Direction]) -> list[Markup]:
    """The directions that the data do not identify, or that there is none."""
    texts = [direction.text for direction in directions if direction.flat]
    if texts:
        return texts
    widest = directions[0]
    text = Markup("The data identify every direction: the widest ({}) is {} as wide as the prior.")
    return [text.format(listed([change.text for change in widest.changes]), percent(widest.width, 2))]


def _pair_list(pairs: list[Pair]) -> Block:
    """The strongly correlated pairs, or that there is none."""
    if not pairs:
        return Text(f"No two parameters are correlated by more than {STRONG}.")
    lead = f"Correlated by more than {STRONG}; the data identify a combination better than either parameter:"
    more = f" the {_LISTED} strongest of {len(pairs)}:" if len(pairs) > _LISTED else ""
    return bullets([pair.text for pair in pairs[:_LISTED]], lead.rstrip(":") + (";" + more if more else ":"))


def posterior_section(run: Run) -> Section | None:
    """Marginals of all modes, then per mode its correlations, what is not identifiable, and its corner plot."""
    if not run.sampled:
        return None
    panes: dict[str, list[Block]] = {}
    data = {}
    for mode in run.sampled:
        panes[mode.title], data[mode.name], _ = _joint(run, mode)
        if len(mode.parameters) > 1:
            panes[mode.title].append(corner_figure(run, mode))
    marginals = extract_marginals(run)
    blocks = [marginals_figure(run, marginals), *tabs(panes)]
    return Section("posterior", "Posterior", blocks, {"marginals": marginals, "modes": data})


def directions_section(run: Run) -> Section | None:
    """Strong correlations and all principal directions, per mode."""
    panes: dict[str, list[Block]] = {}
    data = {}
    for mode in run.sampled:
        blocks, data[mode.name], directions = _joint(run, mode)
        panes[mode.title] = [*blocks, _table(directions)]
    return Section("directions", "Correlations and directions", tabs(panes), {"modes": data}) if panes else None


def _joint(run: Run, mode: Mode) -> tuple[list[Block], dict[str, Any], list[Direction]]:
    """Correlations and directions of a mode: text, the numbers behind it, and the directions."""
    pairs, directions = strong_pairs(run, mode), directions_of(run, mode)
    data = {
        "parameters": mode.parameters,
        "correlation": correlation(run, mode),
        "pairs": pairs,
        "directions": directions,
    }
    return [*(Text(text) for text in direction_texts(directions)), _pair_list(pairs)], data, directions


def _table(directions: list[Direction]) -> Table:
    changes = [Markup(", ").join(change.text for change in direction.changes) for direction in directions]
    verdicts = [badge(*(("not identified", "bad") if d.flat else ("identified", "good"))) for d in directions]
    return Table(
        [
            Column("No.", [str(k) for k in range(1, len(directions) + 1)]),
            words("One standard deviation along it", [wrapped(text) for text in changes]),
            Column("Width, prior = 100 %", [percent(direction.width, 2) for direction in directions]),
            words("", verdicts),
        ],
        "Principal directions of the posterior in the prior box, widest first; the last are the combinations that the "
        f"data identify best. A direction wider than {percent(FLAT, 2)} of the prior counts as not identified.",
    )
