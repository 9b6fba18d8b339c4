"""How parameters hang together: correlation maps, variance inflation, condition, directions in words."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mofit.identifiability.comparison import Comparison, Judged
from mofit.identifiability.telling import Told
from mofit.report.display import listed, math_symbol, number, symbol
from mofit.report.page import Block, Figure, Section, Table, Text
from mofit.report.style import image_of, panels
from mofit.report.uncertainty.directions import PRIOR_SD, Change, Direction, words

Array = NDArray[np.float64]

#: Procedures whose maps are drawn.
_DRAWN = 12
#: Weight in a direction, over the largest, from which a parameter is named.
_MAIN = 0.3
#: Above this, parameters are strongly collinear.
STRONG = 30.0


def together_section(comparison: Comparison) -> Section:
    """Maps and tables for all procedures, directions of the one that knows most."""
    names = comparison.parameters
    rows = [
        [
            row.procedure.name,
            number(row.condition, 3),
            *(number(row.entries[name].inflation, 3) for name in names),
        ]
        for row in comparison.judged
    ]
    table = Table(
        ["Procedure", "Condition index", *(symbol(name) for name in names)],
        rows,
        f"Largest condition index of the parameters that no calibration knows (above {STRONG:g}: strongly collinear), "
        "and variance inflation factors: by how much the variance of a parameter is larger than if all others were "
        "known.",
    )
    blocks: list[Block] = [_maps(comparison), table]
    for row in _told(comparison):
        told = comparison.told[row.procedure.source]
        found = [direction for direction in directions(told, row.covariance) if direction.flat] or directions(
            told, row.covariance
        )[:1]
        for text in words(found):
            blocks.append(Text(listed([row.procedure.name]) + ": " + text))
    return Section("together", "What hangs together", blocks)


def _told(comparison: Comparison) -> list[Judged]:
    return [row for row in comparison.judged if np.isfinite(row.covariance).all()][:_DRAWN]


def directions(told: Told, covariance: Array) -> list[Direction]:
    """Principal directions of a covariance (d, d) in the unit cube, widest first, with changes in SI units."""
    space, values = told.source.space, told.values[0]
    eigenvalues, vectors = np.linalg.eigh(covariance)
    found = []
    for value, vector in zip(eigenvalues[::-1], vectors.T[::-1], strict=True):
        order = np.argsort(-np.abs(vector), kind="stable")
        weights = vector * (1.0 if vector[order[0]] >= 0 else -1.0)
        sd = float(np.sqrt(max(value, 0.0)))
        main = [int(k) for k in order if abs(weights[k]) > _MAIN * abs(weights[order[0]])]
        changes = []
        for k in main:
            own = space.parameters[k]
            if own.scale == "log":
                relative = float((own.upper / own.lower) ** (sd * weights[k]) - 1)
                absolute = relative * float(values[k])
            else:
                absolute = float(sd * weights[k] * (own.upper - own.lower))
                far = abs(values[k]) > np.sqrt(covariance[k, k]) * (own.upper - own.lower)
                relative = absolute / abs(float(values[k])) if far else float("nan")
            changes.append(Change(own.name, own.unit, absolute, relative))
        found.append(Direction(weights, sd / PRIOR_SD, changes))
    return found


def _maps(comparison: Comparison) -> Figure:
    drawn = _told(comparison)
    names = comparison.told[0].source.space.names
    canvas, axes, _ = panels(len(drawn), 4, 2.0, gap=(0.55, 0.75), margin=(0.65, 0.5, 0.9, 0.4))
    image = None
    for each, row in zip(axes, drawn, strict=True):
        size = np.sqrt(np.diag(row.covariance))
        image = each.imshow(row.covariance / np.outer(size, size), cmap="RdBu_r", vmin=-1, vmax=1, aspect="auto")
        each.set_xticks(range(len(names)), [math_symbol(name) for name in names], rotation=90)
        each.set_yticks(range(len(names)), [math_symbol(name) for name in names])
        each.set_title(row.procedure.name)
        each.grid(visible=False)
    if image is not None:
        bar = canvas.add_axes((0.945, 0.25, 0.012, 0.5))
        canvas.colorbar(image, cax=bar)
    return Figure(
        image_of(canvas),
        "correlation maps",
        "Correlation of the estimates of all parameters, calibrated ones included, in each procedure.",
        good="pale off the diagonal.",
        bad="dark: two parameters can be exchanged for one another.",
    )
