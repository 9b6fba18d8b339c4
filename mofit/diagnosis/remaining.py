"""Whether a hypothesis leaves a gap: tests that need no candidate."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import f as fisher

from mofit.diagnosis.baseline import Fitted
from mofit.diagnosis.lines import CLASSES, HARMONICS, SUBHARMONICS
from mofit.diagnosis.observed import Observed
from mofit.diagnosis.projection import Projection, project
from mofit.diagnosis.steady import highest_frequency

Array = NDArray[np.float64]

#: Harmonics whose change from test to test is looked at one by one as a smooth one.
_SMOOTH_HARMONICS = 5
#: What was looked at, in words; a harmonic is looked at in all tests together.
_TOLD = {
    "dc": "the constant",
    "odd": "odd harmonics",
    "even": "even harmonics",
    "rotating": "lines of wheel and drum",
    "slow": "slow changes",
    "steady": "steady lines",
    "excited": "what is excited",
    "harmonic 0": "the constant in all tests together",
    "highest rotating line": "a line of wheel or drum in one test",
    "highest slow line": "a slow change in one test",
    "highest other line": "a line in one test",
}
#: Degree of the polynomial in log frequency that such a change follows.
_DEGREE = 2


@dataclass(frozen=True)
class Clue:
    """One test for a gap.

    Parameters
    ----------
    name
        What was looked at.
    statistic, freedom
        Sum of white squares and its expectation without a gap.
    p
        Chance of such a sum without a gap, the noise being estimated.
    squares
        Mean square per test of what the lines looked at hold beyond the noise, in the output's unit²; (tests,).
    frequency
        Of the line that stands out in all tests together, Hz; nan for another clue.
    """

    name: str
    statistic: float
    freedom: float
    p: float
    squares: Array
    frequency: float = np.nan

    @property
    def told(self) -> str:
        """What was seen, in words."""
        if np.isfinite(self.frequency):
            return f"a line of {self.frequency:.3g} Hz in all tests together"
        if self.name.startswith("order "):
            return f"lines at {self.name[6:]} of the frequency of excitation"
        return _TOLD.get(self.name, f"{self.name} in all tests together")

    @property
    def rms(self) -> float:
        """Root mean square over all tests of what it saw, in the output's unit, without what leaks past its lines."""
        return float(np.sqrt(max(float(np.mean(self.squares)), 0.0)))


@dataclass(frozen=True)
class Remaining:
    """What a hypothesis leaves.

    Parameters
    ----------
    clues
        All tests, the most significant first.
    p
        Chance of the most significant one, corrected for their number (Bonferroni).
    """

    clues: tuple[Clue, ...]
    p: float

    def loud(self, chance: float) -> tuple[Clue, ...]:
        """The significant ones."""
        return tuple(clue for clue in self.clues if clue.p * len(self.clues) < chance)

    def squares(self, chance: float) -> Array:
        """Mean square per test (tests,) of the largest gap that is significant; zeros if none is.

        A sum over all lines would drown a gap that lies where there is little noise in that of the others.
        """
        loud = [clue.squares for clue in self.loud(chance)]
        return max(loud, key=np.sum, default=np.zeros_like(self.clues[0].squares) if self.clues else np.zeros(1))


def remaining(fitted: Fitted) -> Remaining:
    """Test the residual of a fitted hypothesis, class by class, harmonic by harmonic and line by line."""
    projection, observed = project(fitted), fitted.hypothesis.observed
    rows = len(observed.measured)
    residual, expected = projection.residual[:rows], 1 - projection.leverage[:rows]
    clues = [
        power_clue(name, residual, expected, observed, observed.of(name))
        for name in CLASSES
        if name not in ("subharmonic", "other") and observed.of(name).any()
    ]
    clues += [power_clue(f"order {odd}/2", residual, expected, observed, rows) for odd, rows in half_orders(observed)]
    clues += smooth_clues(projection, observed)
    clues += [peak_clue(name, residual, observed, observed.of(name)) for name in ("rotating", "slow", "other")
              if observed.of(name).any()]  # fmt: skip
    clues += frequency_clue(residual, observed)
    clues = sorted((clue for clue in clues if np.isfinite(clue.p)), key=lambda clue: clue.p)
    return Remaining(tuple(clues), min(1.0, clues[0].p * len(clues)) if clues else 1.0)


def power_clue(name: str, residual: Array, expected: Array, observed: Observed, where: NDArray[np.bool_]) -> Clue:
    """F test of the power of some rows."""
    total, count = float(np.sum(residual[where] ** 2)), float(expected[where].sum())
    p = float(fisher.sf(total / count, count, _behind(observed, where * expected))) if count >= 0.5 else np.nan
    return Clue(name, total, count, p, _squares(residual, expected, observed, where))


def half_orders(observed: Observed) -> Iterator[tuple[int, NDArray[np.bool_]]]:
    """Odd multiples of half the excitation's frequency, and their rows (m,): in a sum over all, one would drown."""
    periods = np.array([w.periods for _, _, w in observed.parts])[observed.part]
    multiple = 2 * np.round((2 * observed.line / np.maximum(periods, 1) - 1) / 2) + 1
    for odd in range(1, 2 * SUBHARMONICS, 2):
        where = observed.of("subharmonic") & (multiple == odd)
        if where.any():
            yield odd, where


def frequency_clue(residual: Array, observed: Observed) -> Iterator[Clue]:
    """Test of the frequency that stands out most in all tests together, whatever excites them: a hum, a gear.

    Constant and told harmonics do not count: there a model that is wrong leaves something in every test.
    """
    records = [w for _, _, w in observed.parts]
    split = [observed.part == i for i in range(len(records))]
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
    squares = _squares(residual, np.ones(len(residual)), observed, near)
    yield Clue("highest frequency", peak.power, peak.freedom, peak.chance, squares, peak.frequency)


def _squares(residual: Array, expected: Array, observed: Observed, where: NDArray[np.bool_]) -> Array:
    """Mean square per test (tests,) of some rows beyond their expectation, in the output's unit²."""
    power = where * (residual**2 - expected) * observed.variance
    return np.asarray(np.bincount(observed.test, power, len(observed.problem.tests)), dtype=np.float64)


def smooth_clues(projection: Projection, observed: Observed) -> Iterator[Clue]:
    r"""Score tests for what changes smoothly from test to test.

    On harmonic h, relative to the phase of the excitation, the gap of test t is taken as
    :math:`\sum_j c_j (\log f_t)^j` with complex coefficients: any effect of the class adds to it, and few coefficients
    see what a sum over all lines would drown. Low harmonics are looked at one by one; all together, with straight lines
    in log f, see a gap that is spread over many.
    """
    places = [i for i, (_, _, w) in enumerate(observed.parts) if w.periods]
    frequency = np.array([1 / observed.parts[i][2].period for i in places])
    levels = len(np.unique(np.round(np.log(frequency), 3))) if places else 0
    if levels < 2:
        return
    z = np.log(frequency) - np.log(frequency).mean()
    powers = np.stack([(z / np.abs(z).max()) ** j for j in range(min(_DEGREE, levels - 1) + 1)], axis=1)
    for harmonic in range(_SMOOTH_HARMONICS + 1):
        columns = _smooth_columns(observed, places, powers, harmonic)
        yield _score_clue(f"harmonic {harmonic}", columns, projection, observed)
    together = [_smooth_columns(observed, places, powers[:, :2], harmonic) for harmonic in range(HARMONICS + 1)]
    yield _score_clue("harmonics together", np.concatenate(together, axis=1), projection, observed)


def _smooth_columns(observed: Observed, places: Sequence[int], powers: Array, harmonic: int) -> Array:
    """What real and imaginary coefficients of powers (tests, k) of log f make on a harmonic, (m, 2 k)."""
    columns = np.zeros((len(observed.measured), 2, powers.shape[1]))
    for i, weights in zip(places, powers, strict=True):
        for part in (0, 1):
            at, values = _harmonic_rows(observed, i, harmonic, part)
            columns[at, part] = values[:, None] * weights
    return columns.reshape(len(columns), -1)


def _score_clue(name: str, columns: Array, projection: Projection, observed: Observed) -> Clue:
    """Score test of columns (m, k)."""
    rest = projection.apply(columns[:, np.any(columns != 0, axis=0)])
    vectors, values, _ = np.linalg.svd(rest, full_matrices=False)
    kept = vectors[:, values > 1e-6 * max(values[0], 1e-300)]
    count = kept.shape[1]
    statistic = float(np.sum((kept.T @ projection.residual) ** 2))
    power = np.sum(columns**2, axis=1)
    p = float(fisher.sf(statistic / count, count, _behind(observed, power)))
    rows = len(observed.measured)
    residual, expected = projection.residual[:rows], 1 - projection.leverage[:rows]
    return Clue(name, statistic, count, p, _squares(residual, expected, observed, power > 0))


def _harmonic_rows(observed: Observed, place: int, harmonic: int, part: int) -> tuple[NDArray[np.intp], Array]:
    """Rows of a harmonic of one record, and what a unit cosine (part 0) or sine (1) of the excitation's phase is there.

    In the unit of the noise's standard deviation, so that all records count alike.
    """
    w = observed.parts[place][2]
    at = np.flatnonzero((observed.part == place) & (observed.line == harmonic * w.periods))
    turn = np.exp(1j * (harmonic * observed.phase[place] - 0.5 * np.pi * part))
    # the first row of a line is its real part, the second its imaginary one
    values = np.array([turn.real, turn.imag][: len(at)])
    return at, values


def peak_clue(name: str, residual: Array, observed: Observed, where: NDArray[np.bool_]) -> Clue:
    """Test of the highest line of a class against chance, corrected for the number of lines."""
    key = observed.part.astype(np.int64) * (int(observed.line.max()) + 1) + observed.line
    lines, index = np.unique(key[where], return_inverse=True)
    power = np.bincount(index, residual[where] ** 2)
    parts = np.bincount(index)
    behind = np.bincount(index, observed.freedom[where]) / parts
    p = fisher.sf(power / parts, parts, behind)
    best = int(np.argmin(p))
    return Clue(
        f"highest {name} line",
        float(power[best]),
        float(parts[best]),
        float(-np.expm1(len(lines) * np.log1p(-p[best]))),
        _squares(residual, np.ones(len(residual)), observed, key == lines[best]),
    )


def _behind(observed: Observed, weight: Array) -> float:
    """Degrees of freedom of the noise behind rows of these weights (m,).

    Rows of one record share an estimate, records do not (Satterthwaite).
    """
    shares = np.bincount(observed.part, weight)
    levels = np.bincount(observed.part, weight * observed.freedom) / np.where(shares > 0, shares, 1.0)
    used = shares > 0
    return float(shares.sum() ** 2 / np.sum(shares[used] ** 2 / levels[used]))
