"""Residual tests: whether a fitted hypothesis leaves a gap, without a candidate effect."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import f as fisher

from mofit._typing import FloatArray
from mofit.data.signals import thin_svd
from mofit.diagnosis.fitting import Fitted, Projection, project
from mofit.diagnosis.spectral_classes import HARMONICS, SPECTRAL_CLASSES, SUBHARMONICS, highest_frequency
from mofit.diagnosis.whitened_data import WhitenedData

#: Harmonics whose change with frequency is tested one by one, and the degree of the polynomial in log frequency that
#: such a change follows.
_SMOOTH_HARMONICS, _SMOOTH_DEGREE = 5, 2
#: p-value, corrected for the number of tests, below which an entry of a residual map or a residual test is listed.
LISTED = 0.01
#: Test names that need other words than "NAME in all tests together".
_PHRASES = {one.name: one.phrase for one in SPECTRAL_CLASSES} | {
    "harmonic 0": "the constant in all tests together",
    "past inputs": "a part that past inputs predict",
    "highest rotating line": "a rotational order in one test",
    "highest slow line": "a slow change in one test",
    "highest other line": "a single line in one test",
}


@dataclass(frozen=True)
class ResidualTest:
    """One test for a gap.

    Parameters
    ----------
    name
        What is tested.
    statistic, degrees_of_freedom
        Sum of whitened squares and its expectation without a gap.
    p_value
        Of such a sum without a gap, the noise being estimated.
    squares
        Mean square per test of what the lines tested hold beyond the noise, in the output's unit²; (tests,).
    frequency
        Of the line that is highest in all tests together, Hz; nan for another test.
    """

    name: str
    statistic: float
    degrees_of_freedom: float
    p_value: float
    squares: FloatArray
    frequency: float = np.nan

    @property
    def description(self) -> str:
        """What was seen, for sentences."""
        if np.isfinite(self.frequency):
            return f"a line of {self.frequency:.3g} Hz in all tests together"
        if self.name.startswith("order "):
            return f"lines at {self.name[6:]} of the excitation frequency"
        return _PHRASES.get(self.name, f"{self.name} in all tests together")

    @property
    def rms(self) -> float:
        """Root mean square over all tests, in the output's unit; what leaks past the lines tested is not in it."""
        return float(np.sqrt(max(float(np.mean(self.squares)), 0.0)))


@dataclass(frozen=True)
class Residuals:
    """All residual tests of a fit.

    Parameters
    ----------
    tests
        The most significant first.
    p_value
        Of the most significant one, corrected for their number (Bonferroni).
    """

    tests: tuple[ResidualTest, ...]
    p_value: float

    def significant(self, p_value: float) -> tuple[ResidualTest, ...]:
        """Those below a p-value, corrected for their number."""
        return tuple(one for one in self.tests if one.p_value * len(self.tests) < p_value)

    def squares(self, p_value: float) -> FloatArray:
        """Mean square per test (tests,) of the largest gap that is significant; zeros if none is.

        In a sum over all lines a gap on lines with little noise would be hidden by the noise of the others.
        """
        found = [one.squares for one in self.significant(p_value)]
        return max(found, key=np.sum, default=np.zeros_like(self.tests[0].squares) if self.tests else np.zeros(1))


def residual_tests(fitted: Fitted) -> Residuals:
    """Test the residual of a fitted hypothesis, class by class, harmonic by harmonic and line by line."""
    left = Remainder.of(fitted)
    observed = left.observed
    classes = [one.name for one in SPECTRAL_CLASSES if observed.of(one.name).any()]
    found = [left.power_test(name, observed.of(name)) for name in classes if name not in ("subharmonic", "other")]
    found += [left.power_test(f"order {odd}/2", at) for odd, at in _half_orders(observed)]
    found += _smooth_tests(left)
    if observed.predicting.any():
        found.append(_columns_test(left, "past inputs", observed.predicting))
    found += [_highest_line(left, name) for name in ("rotating", "slow", "other") if name in classes]
    found += _common_frequency(left)
    found = sorted((one for one in found if np.isfinite(one.p_value)), key=lambda one: one.p_value)
    return Residuals(tuple(found), min(1.0, found[0].p_value * len(found)) if found else 1.0)


@dataclass(frozen=True)
class Remainder:
    """What the parameters of a fitted hypothesis leave of the residual.

    Parameters
    ----------
    observed, projection
        The tests, and the projector of the fit.
    residual, expected
        Residual beside the parameters, and what noise alone makes of its square; rows of the tests (m,).
    told
        What of the residual can be told from noise, (m,).
    """

    observed: WhitenedData
    projection: Projection
    residual: FloatArray
    expected: FloatArray
    told: FloatArray

    @classmethod
    def of(cls, fitted: Fitted) -> Remainder:
        """Of a fit."""
        observed, projection = fitted.hypothesis.observed, project(fitted)
        rows = len(observed.measured)
        residual = projection.residual[:rows]
        return cls(observed, projection, residual, 1 - projection.leverage[:rows], observed.told(residual))

    def power_test(self, name: str, where: NDArray[np.bool_]) -> ResidualTest:
        """F test of the power of some rows (m,)."""
        expected = self.expected * self.observed.visible
        total, count = float(np.sum(self.told[where] ** 2)), float(expected[where].sum())
        p = self.p_value(total, count, where * expected) if count >= 0.5 else np.nan
        return ResidualTest(name, total, count, p, self.squares(where, self.expected))

    def p_value(self, total: float, count: float, weight: FloatArray) -> float:
        """Of a sum of squares with so many degrees of freedom, of rows with these weights (m,).

        Rows of one record share a noise estimate, records do not (Satterthwaite); but constants are extrapolated alike
        in all records, from how the noise grows towards zero frequency.
        """
        record, constant = self.observed.record, self.observed.line == 0
        # few lines known badly make a sum uncertain, however well the others are known
        inverse = weight / self.observed.degrees_of_freedom
        own = np.bincount(record, weight) @ np.bincount(record, inverse)
        levels, unsure = constant * weight, constant * inverse
        between = levels.sum() * unsure.sum() - np.bincount(record, levels) @ np.bincount(record, unsure)
        behind = float(weight.sum() ** 2 / (own + between))
        return float(fisher.sf(total / count, count, behind))

    def squares(self, where: NDArray[np.bool_], expected: FloatArray | float = 1.0) -> FloatArray:
        """Mean square per test (tests,) of some rows beyond their expectation, in the output's unit²; see `sizes`."""
        beyond = self.told**2 - expected * self.observed.visible
        power = where * beyond * self.observed.told_variance
        return np.asarray(np.bincount(self.observed.test, power, len(self.observed.problem.tests)), dtype=np.float64)


def _half_orders(observed: WhitenedData) -> Iterator[tuple[int, NDArray[np.bool_]]]:
    """Odd multiples of half the excitation's frequency, and their rows (m,): a sum over all would hide a single one."""
    periods = np.array([w.periods for _, _, w in observed.records])[observed.record]
    multiple = 2 * np.round((2 * observed.line / np.maximum(periods, 1) - 1) / 2) + 1
    for odd in range(1, 2 * SUBHARMONICS, 2):
        where = observed.of("subharmonic") & (multiple == odd)
        if where.any():
            yield odd, where


def _common_frequency(left: Remainder) -> Iterator[ResidualTest]:
    """Test of the frequency with the least probable power in all tests together: mains, a gear.

    The constant and the low harmonics do not count: there a wrong model leaves something in every test.
    """
    observed, residual = left.observed, left.residual
    records = [w for _, _, w in observed.records]
    split = [observed.record == i for i in range(len(records))]
    rest = ~observed.of("dc", "odd", "even")
    kept = [
        np.isin(np.arange(len(w.frequencies)), observed.line[own & rest]) for own, w in zip(split, records, strict=True)
    ]
    peak = highest_frequency(records, [residual[own] for own in split], kept)
    if peak is None:
        return
    near = np.zeros(len(residual), dtype=bool)
    for own, lines, mine in zip(split, peak.near(records), kept, strict=True):
        near[own] = (lines & mine)[observed.line[own]]
    statistic, freedom = peak.power, peak.degrees_of_freedom
    yield ResidualTest("highest frequency", statistic, freedom, peak.p_value, left.squares(near), peak.frequency)


def _smooth_tests(left: Remainder) -> Iterator[ResidualTest]:
    r"""Score tests for a gap that changes smoothly with the excitation frequency.

    On harmonic h, relative to the phase of the excitation, the gap of test t is taken as
    :math:`\sum_j c_j (\log f_t)^j` with complex coefficients: any effect of the class adds to it, and few coefficients
    see what a sum over all lines would hide. Low harmonics are tested one by one; all together but the constant, with
    straight lines in log f, show a gap that is distributed over many.
    """
    observed = left.observed
    places = [i for i, (_, _, w) in enumerate(observed.records) if w.periods]
    frequency = np.array([1 / observed.records[i][2].period for i in places])
    levels = len(np.unique(np.round(np.log(frequency), 3))) if places else 0
    if levels < 2:
        return
    z = np.log(frequency) - np.log(frequency).mean()
    degree = min(_SMOOTH_DEGREE, levels - 1)
    powers = np.stack([(z / np.abs(z).max()) ** j for j in range(degree + 1)], axis=1)
    for harmonic in range(_SMOOTH_HARMONICS + 1):
        yield _columns_test(left, f"harmonic {harmonic}", _smooth_columns(observed, places, powers, harmonic))
    together = [_smooth_columns(observed, places, powers[:, :2], harmonic) for harmonic in range(1, HARMONICS + 1)]
    yield _columns_test(left, "harmonics together", np.concatenate(together, axis=1))


def _smooth_columns(observed: WhitenedData, places: Sequence[int], powers: FloatArray, harmonic: int) -> FloatArray:
    """What real and imaginary coefficients of powers (records, k) of log f make on a harmonic, (m, 2 k).

    In standard deviations of the noise, so that all records count alike.
    """
    columns = np.zeros((len(observed.measured), 2, powers.shape[1]))
    for i, weights in zip(places, powers, strict=True):
        at = np.flatnonzero((observed.record == i) & (observed.line == harmonic * observed.records[i][2].periods))
        for part in (0, 1):
            # a unit cosine (0) or sine (1) of the excitation's phase; the rows of a line: real, then imaginary part
            turn = np.exp(1j * (harmonic * observed.phase[i] - 0.5 * np.pi * part))
            columns[at, part] = np.array([turn.real, turn.imag][: len(at)])[:, None] * weights
    return columns.reshape(len(columns), -1)


def _columns_test(left: Remainder, name: str, columns: FloatArray) -> ResidualTest:
    """Score test of columns (m, k)."""
    rest = left.projection.apply(columns[:, np.any(columns != 0, axis=0)])
    vectors, values, _ = thin_svd(rest)
    kept = vectors[:, values > 1e-6 * max(values[0], 1e-300)]
    statistic, count = float(np.sum((kept.T @ left.projection.residual) ** 2)), kept.shape[1]
    power = np.sum(columns**2, axis=1)
    p = left.p_value(statistic, count, power)
    return ResidualTest(name, statistic, count, p, left.squares(power > 0, left.expected))


def _highest_line(left: Remainder, name: str) -> ResidualTest:
    """Test of the highest line of a class, corrected for the number of lines."""
    observed, where = left.observed, left.observed.of(name)
    key = observed.record.astype(np.int64) * (int(observed.line.max()) + 1) + observed.line
    lines, index = np.unique(key[where], return_inverse=True)
    power, parts = np.bincount(index, left.residual[where] ** 2), np.bincount(index)
    behind = np.bincount(index, observed.degrees_of_freedom[where]) / parts
    p = fisher.sf(power / parts, parts, behind)
    best = int(np.argmin(p))
    corrected = float(-np.expm1(len(lines) * np.log1p(-p[best])))
    squares = left.squares(key == lines[best])
    return ResidualTest(f"highest {name} line", float(power[best]), float(parts[best]), corrected, squares)
