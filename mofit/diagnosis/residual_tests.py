"""Residual tests: whether a fitted hypothesis leaves a gap, without a candidate effect."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtrc

from mofit._typing import FloatArray
from mofit.data.signals import thin_svd
from mofit.diagnosis.fitting import Fitted
from mofit.diagnosis.left_residual import Remainder, Residuals, ResidualTest
from mofit.diagnosis.spectral_classes import HARMONICS, SPECTRAL_CLASSES, SUBHARMONICS, highest_frequency
from mofit.diagnosis.term_score import best_term
from mofit.diagnosis.whitened_data import WhitenedData

#: Harmonics whose change with frequency is tested one by one, and the degree of the polynomial in log frequency that
#: such a change follows.
_SMOOTH_HARMONICS, _SMOOTH_DEGREE = 5, 2
#: p-value from which on another test changes no decision.
_BEYOND_DOUBT = 1e-9
#: Of a fit: asked for more than once.
_known: WeakKeyDictionary[Fitted, Residuals] = WeakKeyDictionary()


def residual_tests(fitted: Fitted) -> Residuals:
    """Test the residual of a fitted hypothesis: class by class, harmonic by harmonic, line by line, term by term.

    Terms take the longest: they are not asked where the others leave no doubt.
    """
    if fitted not in _known:
        _known[fitted] = _tested(fitted)
    return _known[fitted]


def remember(fitted: Fitted, found: Residuals) -> None:
    """What another process found of a fit."""
    _known[fitted] = found


def _tested(fitted: Fitted) -> Residuals:
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
    if min((one.p_value for one in found if np.isfinite(one.p_value)), default=1.0) > _BEYOND_DOUBT:
        found += _term_test(left, fitted)
    found = sorted((one for one in found if np.isfinite(one.p_value)), key=lambda one: one.p_value)
    return Residuals(tuple(found), min(1.0, found[0].p_value * len(found)) if found else 1.0)


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
    statistic, freedom, squares = peak.power, peak.degrees_of_freedom, left.squares(np.flatnonzero(near))
    yield ResidualTest("highest frequency", statistic, freedom, peak.p_value, squares, peak.frequency)


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
    at = np.flatnonzero(power)
    p = left.p_value(statistic, count, at, power[at])
    return ResidualTest(name, statistic, count, p, left.squares(at, left.expected[at]))


def _term_test(left: Remainder, fitted: Fitted) -> Iterator[ResidualTest]:
    """Test of the term that fits best, corrected for the number of terms."""
    one = best_term(fitted, left.projection)
    if one is None:
        return
    observed, squares = left.observed, one.rows**2
    p = _corrected(left.p_value(one.statistic, 1.0, np.arange(len(squares)), squares), one.tried)
    size = np.asarray(np.bincount(observed.test, squares * observed.told_variance, len(observed.problem.tests)), float)
    law = f"{one.term.title}, added to {one.target.name}"
    yield ResidualTest("own signals", one.statistic, 1.0, p, size, law=law)


def _corrected(p_value: float, tried: int) -> float:
    """The smallest p-value of several tests, corrected for their number."""
    return float(-np.expm1(tried * np.log1p(-p_value)))


def _highest_line(left: Remainder, name: str) -> ResidualTest:
    """Test of the highest line of a class, corrected for the number of lines."""
    observed, where = left.observed, left.observed.of(name)
    key = observed.record.astype(np.int64) * (int(observed.line.max()) + 1) + observed.line
    lines, index = np.unique(key[where], return_inverse=True)
    power, parts = np.bincount(index, left.residual[where] ** 2), np.bincount(index)
    behind = np.bincount(index, observed.degrees_of_freedom[where]) / parts
    p = fdtrc(parts, behind, power / parts)
    best = int(np.argmin(p))
    squares = left.squares(np.flatnonzero(key == lines[best]))
    corrected = _corrected(p[best], len(lines))
    return ResidualTest(f"highest {name} line", float(power[best]), float(parts[best]), corrected, squares)
