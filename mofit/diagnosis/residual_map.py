"""Where the gap lies: over tests and spectral classes, over input and rate, over time, and over parameter estimates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mofit._typing import FloatArray
from mofit.diagnosis.fitting import Fitted
from mofit.diagnosis.gap_lines import beyond_noise
from mofit.diagnosis.left_residual import Remainder
from mofit.diagnosis.spectral_classes import SPECTRAL_CLASSES
from mofit.diagnosis.whitened_data import WhitenedData
from mofit.results import cochran
from mofit.simulation import exciting_channel

#: Cells of the map over input and rate, each way, and intervals of a record in the map over time.
_CELLS, _INTERVALS = 12, 10
#: Share of the gap from which one place holds most of it.
_MOST = 0.5
#: Standard deviation of a uniform prior over the box.
_PRIOR_SD = 12**-0.5
#: Standard deviation, relative to that, from which a single test says nothing of a parameter.
_WIDEST = 0.5


@dataclass(frozen=True)
class ResidualEntry:
    """The gap on one spectral class of one test.

    Parameters
    ----------
    test, output, lines
        Where; ``lines`` names the class.
    gap, noise
        Root mean square of the residual beyond the noise, and of the noise on the same lines, in the output's unit.
    of_peak, share
        The gap relative to the output's largest deviation from its mean, and its share of the squares of the whole
        residual on the lines that can be explained.
    p_value
        Of such a power without a gap.
    """

    test: str
    output: str
    lines: str
    gap: float
    noise: float
    of_peak: float
    share: float
    p_value: float


@dataclass(frozen=True)
class Location:
    """Where more than half of the gap's mean square lies, as narrow as that can be said; empty: in all tests, classes.

    Parameters
    ----------
    test, lines
        The test, and the class of spectral lines.
    share
        Of the squares of the whole gap that lie there.
    """

    test: str
    lines: str
    share: float


@dataclass(frozen=True)
class InputMap:
    """Mean gap over the input and its rate: edges (c + 1,), mean gap and its standard error (c, c); nan where empty."""

    input_edges: FloatArray
    rate_edges: FloatArray
    gap: FloatArray
    error: FloatArray


@dataclass(frozen=True)
class TimeMap:
    """Gap over the time of one test: middles of its intervals [s] and the root mean square of the gap there."""

    test: str
    start_time: float | None
    time: FloatArray
    gap: FloatArray
    noise: float


@dataclass(frozen=True)
class ResidualMap:
    """The gap of one fitted hypothesis, located.

    ``squares`` is the mean square of the gap per test, on the lines of `gap_lines.beyond_noise` (negative by chance);
    ``peaks`` the largest deviation of the output from its mean. With several outputs all are relative to the range of
    each, and a test has the sum of the squares and the smallest of the peaks.
    """

    unit: str
    entries: tuple[ResidualEntry, ...]
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

    @property
    def largest_of_peak(self) -> float:
        """Largest gap of a test relative to its output's peak."""
        return max(np.sqrt(max(square, 0.0)) / self.peaks[test] for test, square in self.squares.items())

    @property
    def location(self) -> Location | None:
        """Where most of the gap lies: a class of one test, else a class, else a test; None where it lies all over."""
        places = [[(one.test, one.lines), ("", one.lines), (one.test, "")] for one in self.entries]
        for kind in range(3):
            shares: dict[tuple[str, str], float] = {}
            for entry, place in zip(self.entries, places, strict=True):
                shares[place[kind]] = shares.get(place[kind], 0.0) + entry.share
            where, share = max(shares.items(), key=lambda found: found[1])
            if share > _MOST:
                return Location(*where, share)
        return None

    def significant(self, p_value: float) -> list[ResidualEntry]:
        """Entries below a p-value, corrected for their number."""
        return [one for one in self.entries if one.p_value * len(self.entries) < p_value]


def residual_map(fitted: Fitted) -> ResidualMap:
    """Locate the residual of a fitted hypothesis."""
    left = Remainder.of(fitted)
    observed, tests = left.observed, left.observed.problem.tests
    squares = (left.told**2 - left.expected * observed.visible) * observed.told_variance
    used = map(observed.used_samples, range(len(observed.records)))
    sizes = zip(used, observed.sizes, strict=True)
    peaks = [float(np.max(np.abs(values - values.mean())) / size) for values, size in sizes]
    explainable = max(float(squares[observed.explainable].clip(0).sum()), np.finfo(float).tiny)
    entries = []
    for i, (test, output, _) in enumerate(observed.records):
        for name, here in ((one.name, (observed.record == i) & observed.of(one.name)) for one in SPECTRAL_CLASSES):
            if not here.any():
                continue
            power = max(float(squares[here].sum()), 0.0)
            entries.append(
                ResidualEntry(
                    test=tests[test],
                    output=observed.problem.model.outputs[output].name,
                    lines=name,
                    gap=float(np.sqrt(power)),
                    noise=float(np.sqrt(observed.told_variance[here].sum())),
                    of_peak=float(np.sqrt(power)) / peaks[i],
                    share=power / explainable if name != "other" else 0.0,
                    p_value=left.power_test(name, here).p_value,
                )
            )
    kept = np.where(observed.explainable, left.told, 0.0)
    gaps = [w.signal(kept[observed.record == i]) / observed.sizes[i] for i, (_, _, w) in enumerate(observed.records)]
    totals = np.bincount(observed.test, squares * beyond_noise(observed, squares), len(tests))
    of_test = [
        [peak for (k, _, _), peak in zip(observed.records, peaks, strict=True) if k == t] for t in range(len(tests))
    ]
    return ResidualMap(
        observed.unit,
        tuple(entries),
        dict(zip(tests, map(float, totals), strict=True)),
        dict(zip(tests, map(min, of_test), strict=True)),
        _input_map(observed, gaps),
        tuple(_time_maps(observed, gaps)),
    )


def _input_map(observed: WhitenedData, gaps: Sequence[FloatArray]) -> InputMap:
    """Mean gap per cell, over the tests excited as the first; its standard error from the noise on the same lines."""
    problem, columns = observed.problem, []
    exciting = [exciting_channel(problem.model, problem.measurements[test]) for test, _, _ in observed.records]
    for (test, _, w), size, gap, name in zip(observed.records, observed.sizes, gaps, exciting, strict=True):
        if name != exciting[0]:
            continue
        values = problem.measurements[test].channel(name)[w.start : w.start + w.count]
        noise = np.full(w.count, np.mean(w.process.spectrum) / size**2)
        columns.append([values, np.gradient(values, w.step), np.ones(w.count), gap, noise])
    x, v, *weights = np.concatenate(columns, axis=1)
    ends = [np.quantile(part, (0.001, 0.999)) for part in (x, v)]
    edges = [np.linspace(low, high, _CELLS + 1) for low, high in ends]
    count, total, squares = (np.histogram2d(x, v, bins=edges, weights=part)[0] for part in weights)
    with np.errstate(invalid="ignore", divide="ignore"):
        return InputMap(edges[0], edges[1], total / count, np.sqrt(squares) / count)


def _time_maps(observed: WhitenedData, gaps: Sequence[FloatArray]) -> list[TimeMap]:
    maps = []
    for (test, _, w), size, gap in zip(observed.records, observed.sizes, gaps, strict=True):
        measurement = observed.problem.measurements[test]
        intervals = min(_INTERVALS, max(len(gap) // 8, 1))
        cuts = np.array_split(np.arange(len(gap)), intervals)
        maps.append(
            TimeMap(
                measurement.name,
                measurement.experiment.start_time,
                np.array([(w.start + cut.mean()) * w.step for cut in cuts]),
                np.array([np.sqrt(np.mean(gap[cut] ** 2)) for cut in cuts]),
                float(np.sqrt(np.mean(w.process.spectrum)) / size),
            )
        )
    return maps


@dataclass(frozen=True)
class Homogeneity:
    """Cochran's test whether single tests agree on a parameter that no calibration stage knows.

    Parameters
    ----------
    parameter, unit
        Which.
    tests, values, sds
        Estimates from each test alone, near the joint minimum, in the parameter's unit.
    p_value, i_squared
        Of such a scatter if the model were right; share of it beyond the estimates' own uncertainty. nan for fewer than
        two tests.
    """

    parameter: str
    unit: str
    tests: tuple[str, ...]
    values: FloatArray
    sds: FloatArray
    p_value: float
    i_squared: float


def homogeneity(fitted: Fitted) -> list[Homogeneity]:
    """One Gauss–Newton step from the joint minimum to that of each test alone, and whether the steps differ.

    All parameters are free with the prior of the stages; what no stage knows has the box as a wide Gaussian prior.
    Estimates wider than half of it are left out, and parameters that differ from test to test anyway.
    """
    model, observed = fitted.hypothesis, fitted.hypothesis.observed
    space, point, tests = model.space, fitted.minimum.point, observed.problem.tests
    moves, sds = np.zeros((2, len(tests), len(space)))
    for t in range(len(tests)):
        used = np.ones(len(fitted.residual), dtype=bool)
        used[: len(observed.measured)] = observed.test == t
        jacobian = -fitted.jacobian[used]
        inverse = np.linalg.inv(jacobian.T @ jacobian + np.eye(len(space)) / _PRIOR_SD**2)
        moves[t], sds[t] = inverse @ (jacobian.T @ fitted.residual[used]), np.sqrt(np.diag(inverse))
    found = []
    for k, parameter in enumerate(space.parameters):
        if parameter.name in observed.problem.prior.names or not model.layout.shared[k]:
            continue
        good = (sds[:, k] < _WIDEST * _PRIOR_SD) & (fitted.minimum.at_bound[k] == 0)
        _, _, _, p, i_squared = cochran(moves[good, k], sds[good, k])
        place = np.repeat(point[None], int(good.sum()), axis=0)
        place[:, k] = np.clip(place[:, k] + moves[good, k], 0.0, 1.0)
        values = space.from_unit(place)
        found.append(
            Homogeneity(
                parameter.name,
                parameter.unit,
                tuple(test for test, on in zip(tests, good, strict=True) if on),
                values[:, k],
                sds[good, k] * space.derivative(values)[:, k],
                p,
                i_squared,
            )
        )
    return found
