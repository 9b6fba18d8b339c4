"""Where the gap lies: over tests and line classes, over the input and its rate, and over time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mofit.diagnosis.baseline import Fitted
from mofit.diagnosis.lines import CLASSES
from mofit.diagnosis.observed import Observed
from mofit.diagnosis.projection import project
from mofit.diagnosis.remaining import power_clue
from mofit.drives import first_input

Array = NDArray[np.float64]

#: Cells of the map over input and rate, each way.
_CELLS = 12
#: Stretches of a record in the map over time.
_STRETCHES = 10


@dataclass(frozen=True)
class Spot:
    """The gap on one class of lines of one test.

    Parameters
    ----------
    test, output, lines
        Where.
    gap, noise
        Root mean square of what is left beyond the noise, and of the noise on the same lines, in the output's unit.
    of_peak
        The gap relative to the output's largest deviation from its mean.
    share
        Of the squares of all that the model leaves on the lines that can be explained.
    p
        Chance of such a power without a gap.
    """

    test: str
    output: str
    lines: str
    gap: float
    noise: float
    of_peak: float
    share: float
    p: float


@dataclass(frozen=True)
class InputMap:
    """Mean gap over the input and its rate: edges (c + 1,), mean gap and its standard error (c, c); nan where empty."""

    input_edges: Array
    rate_edges: Array
    gap: Array
    error: Array


@dataclass(frozen=True)
class TimeMap:
    """Gap over the time of one test: middles of its stretches [s] and the structured part's root mean square there."""

    test: str
    start_time: float | None
    time: Array
    gap: Array
    noise: float


@dataclass(frozen=True)
class Where:
    """The gap of one hypothesis, located.

    ``squares`` is the mean square of the gap per test (negative by chance where there is none), ``peaks`` the largest
    deviation of the output from its mean.
    """

    unit: str
    spots: tuple[Spot, ...]
    squares: Mapping[str, float]
    peaks: Mapping[str, float]
    input_map: InputMap
    time_maps: tuple[TimeMap, ...]

    @property
    def gap(self) -> float:
        """Root mean square of the gap over all tests, in the unit of the (first) output."""
        return float(np.sqrt(max(float(np.mean(list(self.squares.values()))), 0.0)))

    @property
    def relative(self) -> float:
        """Root mean square of the gap relative to the output's range, over all tests."""
        # a range is about two peaks
        squares = [max(square, 0.0) / (2 * self.peaks[test]) ** 2 for test, square in self.squares.items()]
        return float(np.sqrt(np.mean(squares)))


def locate(fitted: Fitted) -> Where:
    """Locate what a fitted hypothesis leaves."""
    observed, projection = fitted.hypothesis.observed, project(fitted)
    rows = len(observed.measured)
    residual, expected = projection.residual[:rows], 1 - projection.leverage[:rows]
    squares = power_of(observed, residual, expected)
    noise = observed.variance
    peaks = [float(np.max(np.abs(v - v.mean()))) for v in (_measured(observed, i) for i in range(len(observed.parts)))]
    explainable = max(float(squares[observed.repeating].clip(0).sum()), np.finfo(float).tiny)
    spots = []
    for i, (test, output, _) in enumerate(observed.parts):
        for name in CLASSES:
            here = (observed.part == i) & observed.of(name)
            if not here.any():
                continue
            power = max(float(squares[here].sum()), 0.0)
            gap = float(np.sqrt(power))
            spots.append(
                Spot(
                    test=observed.problem.tests[test],
                    output=observed.problem.model.outputs[output].name,
                    lines=name,
                    gap=gap,
                    noise=float(np.sqrt(noise[here].sum())),
                    of_peak=gap / peaks[i],
                    share=power / explainable if name != "other" else 0.0,
                    p=power_clue(name, residual, expected, observed, here).p,
                )
            )
    structured = [_structured(observed, residual, i) for i in range(len(observed.parts))]
    likely = observed.repeating
    names = observed.problem.tests
    totals = {name: float(squares[likely & (observed.test == t)].sum()) for t, name in enumerate(names)}
    largest = {names[test]: peak for (test, _, _), peak in zip(observed.parts, peaks, strict=True)}
    unit = observed.problem.model.outputs[0].unit
    return Where(
        unit, tuple(spots), totals, largest, _input_map(observed, structured), tuple(_time_maps(observed, structured))
    )


def power_of(observed: Observed, residual: Array, expected: Array) -> Array:
    """Mean square of the signal that every row stands for, beyond its expectation, in the output's unit²; (m,)."""
    return (residual**2 - expected) * observed.variance


def _measured(observed: Observed, part: int) -> Array:
    test, output, w = observed.parts[part]
    return np.asarray(observed.problem.drives[test].measured[w.start : w.start + w.count, output])


def _structured(observed: Observed, residual: Array, part: int) -> Array:
    """The residual of one record on the lines that may hold a gap, over its samples (n,)."""
    here = observed.part == part
    kept = np.where(observed.repeating[here], residual[here], 0.0)
    return observed.parts[part][2].signal(kept)


def _input_map(observed: Observed, structured: Sequence[Array]) -> InputMap:
    """Mean structured residual per cell; its standard error from the noise on the same lines."""
    driver = first_input(observed.problem.model)
    inputs, rates, gaps, errors = [], [], [], []
    for (test, _, w), gap in zip(observed.parts, structured, strict=True):
        values = observed.problem.measurements[test].channel(driver)[w.start : w.start + w.count]
        inputs.append(values)
        rates.append(np.gradient(values, w.step))
        gaps.append(gap)
        errors.append(np.full(len(gap), np.sqrt(np.mean(w.process.spectrum))))
    x, v, g, e = (np.concatenate(part) for part in (inputs, rates, gaps, errors))
    ends = [np.quantile(part, (0.001, 0.999)) for part in (x, v)]
    edges = [np.linspace(low, high, _CELLS + 1) for low, high in ends]
    count, total, squares = (
        np.histogram2d(x, v, bins=edges, weights=weights)[0] for weights in (np.ones(len(x)), g, e**2)
    )
    with np.errstate(invalid="ignore", divide="ignore"):
        return InputMap(edges[0], edges[1], total / count, np.sqrt(squares) / count)


def _time_maps(observed: Observed, structured: Sequence[Array]) -> list[TimeMap]:
    maps = []
    for (test, _, w), gap in zip(observed.parts, structured, strict=True):
        measurement = observed.problem.measurements[test]
        cuts = np.array_split(np.arange(len(gap)), min(_STRETCHES, max(len(gap) // 8, 1)))
        maps.append(
            TimeMap(
                measurement.name,
                measurement.procedure.start_time,
                np.array([(w.start + cut.mean()) * w.step for cut in cuts]),
                np.array([np.sqrt(np.mean(gap[cut] ** 2)) for cut in cuts]),
                float(np.sqrt(np.mean(w.process.spectrum))),
            )
        )
    return maps


def significant(where: Where, chance: float) -> NDArray[np.bool_]:
    """Which spots hold a gap beyond chance, corrected for their number."""
    p = np.array([spot.p for spot in where.spots])
    return np.asarray(np.nan_to_num(p, nan=1.0) * len(p) < chance)
