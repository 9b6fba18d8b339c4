"""What a fit leaves of the residual, and what a test of it for a gap says."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtrc

from mofit._typing import FloatArray
from mofit.diagnosis.fitting import Fitted
from mofit.diagnosis.projection import Projection, project
from mofit.diagnosis.spectral_classes import SPECTRAL_CLASSES
from mofit.diagnosis.whitened_data import WhitenedData

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
    law
        The function of the model's own signals that fits best, in words; empty for another test.
    """

    name: str
    statistic: float
    degrees_of_freedom: float
    p_value: float
    squares: FloatArray
    frequency: float = np.nan
    law: str = ""

    @property
    def description(self) -> str:
        """What was seen, for sentences."""
        if np.isfinite(self.frequency):
            return f"a line of {self.frequency:.3g} Hz in all tests together"
        if self.law:
            return f"a part like {self.law}"
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
        at = np.flatnonzero(where)
        expected = self.expected[at] * self.observed.visible[at]
        total, count = float(np.sum(self.told[at] ** 2)), float(expected.sum())
        p = self.p_value(total, count, at, expected) if count >= 0.5 else np.nan
        return ResidualTest(name, total, count, p, self.squares(at, self.expected[at]))

    def p_value(self, total: float, count: float, at: NDArray[np.intp], weight: FloatArray) -> float:
        """Of a sum of squares with so many degrees of freedom, of rows at some places with these weights (k,).

        Rows of one record share a noise estimate, records do not (Satterthwaite); but constants are extrapolated alike
        in all records, from how the noise grows towards zero frequency.
        """
        record, constant = self.observed.record[at], self.observed.line[at] == 0
        # few lines known badly make a sum uncertain, however well the others are known
        inverse = weight / self.observed.degrees_of_freedom[at]
        own = np.bincount(record, weight) @ np.bincount(record, inverse)
        levels, unsure = constant * weight, constant * inverse
        between = levels.sum() * unsure.sum() - np.bincount(record, levels) @ np.bincount(record, unsure)
        behind = float(weight.sum() ** 2 / (own + between))
        return float(fdtrc(count, behind, total / count))

    def squares(self, at: NDArray[np.intp], expected: FloatArray | float = 1.0) -> FloatArray:
        """Mean square per test (tests,) of rows (k,) beyond their expectation, in the output's unit²; see `sizes`."""
        observed = self.observed
        power = (self.told[at] ** 2 - expected * observed.visible[at]) * observed.told_variance[at]
        return np.asarray(np.bincount(observed.test[at], power, len(observed.problem.tests)), dtype=np.float64)
