"""The tests of a campaign as the diagnosis sees them: white rows, each of a known line."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mofit.calibration import Calibration
from mofit.diagnosis.lines import CLASSES, classify, orders
from mofit.diagnosis.steady import steady_lines
from mofit.diagnosis.whitening import Whitening, whitening
from mofit.diagnosis.workshop import Workshop
from mofit.drives import first_input
from mofit.problem import Problem

Array = NDArray[np.float64]

OTHER = CLASSES.index("other")


@dataclass(frozen=True)
class Observed:
    """All records of all tests, made white and put under one another.

    Parameters
    ----------
    problem
        The model without effects, and the tests.
    parts
        One per test and output, in the order of the rows: index of the test, index of the output, whitening.
    measured
        White rows of what was measured, shape (m,).
    part, line, kind
        Of every row: index into ``parts``, line of its spectrum, index into `CLASSES`; shape (m,).
    phase
        Of the excitation's fundamental over the samples used, rad, per part; 0 where it does not repeat.
    calibrations
        The stages before, whose estimates the prior is made of.
    genuine
        Share of every row's variance that is noise, not a gap counted as such, (m,).
    workshop
        Compiles models.
    """

    problem: Problem
    parts: tuple[tuple[int, int, Whitening], ...]
    measured: Array
    part: NDArray[np.int64]
    line: NDArray[np.int64]
    kind: NDArray[np.int64]
    phase: Array
    calibrations: tuple[Calibration, ...] = ()
    genuine: Array | float = 1.0
    workshop: Workshop = field(default_factory=Workshop)

    @cached_property
    def prior_root(self) -> tuple[Array, Array]:
        """What the stages know, in unit coordinates: mean (d,), and rows R (p, d) whose squares are the precision."""
        problem = self.problem
        if problem.prior is None:
            return np.zeros(len(problem.space)), np.zeros((0, len(problem.space)))
        mean, precision = problem.prior.spread_over(problem.space.names)
        values, vectors = np.linalg.eigh(precision)
        kept = values > 1e-12 * values.max()
        return mean, np.sqrt(values[kept])[:, None] * vectors[:, kept].T

    @cached_property
    def test(self) -> NDArray[np.int64]:
        """Index of the test of every row, shape (m,)."""
        return np.array([test for test, _, _ in self.parts])[self.part]

    @cached_property
    def freedom(self) -> Array:
        """Degrees of freedom behind the noise of every row, shape (m,)."""
        return np.concatenate([w.process.freedom[w.line_of_row] for _, _, w in self.parts])

    @cached_property
    def variance(self) -> Array:
        """Mean square of the noise that every row stands for, in the output's unit²; (m,)."""
        return np.concatenate([w.process.spectrum[w.line_of_row] / w.count for _, _, w in self.parts])

    @cached_property
    def ranges(self) -> Array:
        """Peak to peak of the measured samples used of every part, in the output's unit; (parts,)."""
        drives = self.problem.drives
        return np.array([np.ptp(drives[t].measured[w.start : w.start + w.count, o]) for t, o, w in self.parts])

    def of(self, *classes: str) -> NDArray[np.bool_]:
        """Which rows are of these classes, shape (m,)."""
        return np.isin(self.kind, [CLASSES.index(name) for name in classes])

    @cached_property
    def repeating(self) -> NDArray[np.bool_]:
        """Which rows may hold a gap that a model can explain: all but the other lines, shape (m,)."""
        return ~self.of("other")

    def white(self, stored: Sequence[Array]) -> Array:
        """White rows (N, m, k) of signals per test (N, samples, outputs, k)."""
        return np.concatenate([w.rows(stored[test][..., output, :]) for test, output, w in self.parts], axis=-2)


def with_discrepancy(observed: Observed, relative: float, *, everywhere: bool = False) -> Observed:
    """The same tests with an unknown gap, relative to each output's range, counted as noise.

    It lies on the constant, all harmonics and the slow lines of a test that repeats, else on the excited lines.
    ``everywhere``: as strong as if it were on the harmonics alone, but counted on all lines.
    """
    classes = ("dc", "odd", "even", "excited", *(() if everywhere else ("slow",)))
    parts, measured = [], []
    for i, (test, output, w) in enumerate(observed.parts):
        drive, here = observed.problem.drives[test], observed.part == i
        values = drive.measured[:, output]
        size = relative * float(observed.ranges[i])
        likely = np.zeros(len(w.frequencies), dtype=bool)
        likely[observed.line[here & observed.of(*classes)]] = True
        more = np.full(len(likely), True) if everywhere else w.harmonic
        parts.append((test, output, w.with_discrepancy(size**2, likely, more)))
        measured.append(parts[-1][2].rows(values[:, None])[:, 0])
    counted = replace(observed, parts=tuple(parts), measured=np.concatenate(measured))
    return replace(counted, genuine=observed.genuine * observed.variance / counted.variance)


def observe(problem: Problem, calibrations: Sequence[Calibration] = (), workshop: Workshop | None = None) -> Observed:
    """Find the noise of every record and the class of every line."""
    driver = first_input(problem.model)
    parts, measured, noise, part, line, kind, phase = [], [], [], [], [], [], []
    for test, (measurement, record, drive) in enumerate(
        zip(problem.measurements, problem.records, problem.drives, strict=True)
    ):
        turning = orders(measurement)
        for output, channel in enumerate(problem.model.outputs):
            values = drive.measured[:, output]
            w = whitening(values, drive.weights[:, output] > 0, drive.step, record, record.noise_sd[channel.name])
            excitation = measurement.channel(driver)[w.start : w.start + w.count]
            phase.append(float(np.angle(np.fft.rfft(excitation)[w.periods])) if w.periods else 0.0)
            lines = w.line_of_row
            parts.append((test, output, w))
            measured.append(w.rows(values[:, None])[:, 0])
            noise.append(w.noise_rows(values[:, None])[:, 0])
            part.append(np.full(len(lines), len(parts) - 1))
            line.append(lines)
            kind.append(classify(w, turning, excitation))
    records = [w for _, _, w in parts]
    free = [(own == OTHER) & ~w.harmonic for own, w in zip(kind, records, strict=True)]
    for own, steady in zip(kind, steady_lines(records, noise, free), strict=True):
        own[steady] = CLASSES.index("steady")
    return Observed(
        problem,
        tuple(parts),
        np.concatenate(measured),
        np.concatenate(part),
        np.concatenate(line),
        np.concatenate([own[lines] for own, lines in zip(kind, line, strict=True)]),
        np.array(phase),
        tuple(calibrations),
        workshop=workshop or Workshop(),
    )
