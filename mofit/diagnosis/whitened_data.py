"""The tests of a campaign as the diagnosis sees them: whitened observations, each of a known spectral line."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from mofit._typing import FloatArray
from mofit.data.signals import NoiseProcess, thin_svd
from mofit.diagnosis.discrepancy import CalibrationStages
from mofit.diagnosis.integration import SimulatorCache
from mofit.diagnosis.noise_memory import with_common_memory
from mofit.diagnosis.spectral_classes import CLASS_INDEX, classify, interference_lines, rotational_orders
from mofit.diagnosis.whitening import Whitening, whitening
from mofit.identification.calibration import Calibration
from mofit.parameters import ParameterSpace
from mofit.problem import FLAT, Problem
from mofit.runtime.parallel import forked_map
from mofit.simulation import exciting_channel, objective_pairs
from mofit.simulation.scoped_simulator import ScopedSimulator

#: Relative singular value below which a combination of columns is none.
_RANK = 1e-6
#: Most processes: each needs memory of its own, and few refits take long.
MOST_PROCESSES = 8


@dataclass(frozen=True, eq=False)
class WhitenedData:
    """All records of all tests as one vector of m whitened observations: its rows.

    Parameters
    ----------
    problem
        The model without effects, and the tests.
    records
        One per test and output measured in it, in the order of the rows: indices of test and output, whitening.
    measured, record, line, spectral_class
        Of every row: value, index into ``records``, line of its spectrum, index into `SPECTRAL_CLASSES`; (m,).
    phase
        Of the excitation's fundamental over the samples used, rad, per record; 0 where it does not repeat.
    calibrations
        The stages before, whose estimates the prior is made of.
    noise_share
        Share of every row's variance that is noise, the rest being a discrepancy counted as noise, (m,).
    simulators
        Compiled models.
    predictors
        Functions that predict a residual from past inputs, (samples, q) per record; None for one that repeats.
    """

    problem: Problem
    records: tuple[tuple[int, int, Whitening], ...]
    measured: FloatArray
    record: NDArray[np.int64]
    line: NDArray[np.int64]
    spectral_class: NDArray[np.int64]
    phase: FloatArray
    calibrations: tuple[Calibration, ...] = ()
    noise_share: FloatArray | float = 1.0
    simulators: SimulatorCache = field(default_factory=SimulatorCache)
    predictors: tuple[FloatArray | None, ...] = ()

    @property
    def stages(self) -> CalibrationStages:
        """The calibration stages, to be fitted again with effects."""
        return CalibrationStages(self.problem.space, self.calibrations, self.simulators)

    @property
    def scoped(self) -> ParameterSpace:
        """The model's free parameters with a value per test or condition."""
        simulator = self.problem.simulator
        return simulator.scopes.space if isinstance(simulator, ScopedSimulator) else ParameterSpace(())

    @cached_property
    def prior_root(self) -> tuple[FloatArray, FloatArray]:
        """The stages' prior in unit coordinates: mean (d,), and rows R (p, d) whose squares are the precision."""
        problem = self.problem
        if not problem.prior.names:
            return np.zeros(len(problem.space)), np.zeros((0, len(problem.space)))
        mean, precision = problem.prior_density.mean, problem.prior_density.precision
        values, vectors = np.linalg.eigh(precision)
        kept = values > 1e-12 * values.max()
        return mean, np.sqrt(values[kept])[:, None] * vectors[:, kept].T

    def without_stages(self) -> WhitenedData:
        """The same tests without what the stages tell: what a model lacks it may lack in their tests, too."""
        return replace(self, problem=replace(self.problem, prior=FLAT), calibrations=())

    @property
    def processes(self) -> int:
        """So many may compute candidates, refits or terms for the tests."""
        if self.problem.evaluations is not None:  # a forked process would count its simulations for itself
            return 1
        return min(self.simulators.jobs, MOST_PROCESSES)

    @cached_property
    def test(self) -> NDArray[np.int64]:
        """Index of the test of every row, shape (m,)."""
        return np.array([test for test, _, _ in self.records])[self.record]

    @cached_property
    def degrees_of_freedom(self) -> FloatArray:
        """Degrees of freedom of the noise estimate of every row, shape (m,)."""
        return np.concatenate([w.process.degrees_of_freedom[w.line_of_row] for _, _, w in self.records])

    @cached_property
    def predicted_only(self) -> NDArray[np.bool_]:
        """Which rows show a gap only where past inputs predict it, shape (m,).

        Those of records that do not repeat, whose noise is known from the residual alone; but for lines of what hums
        and rotates, which stand out from it.
        """
        repeating = np.array([w.periods > 0 for _, _, w in self.records])[self.record]
        return ~(repeating | self.of("steady", "rotating"))

    @cached_property
    def predicting(self) -> FloatArray:
        """The predictors as whitened rows, those of every output in columns of their own, (m, k)."""
        blocks: dict[int, list[tuple[int, FloatArray]]] = {}
        for i, columns in enumerate(self.predictors):
            if columns is not None:
                blocks.setdefault(self.records[i][1], []).append((i, self.records[i][2].rows(columns)))
        found = [np.zeros((len(self.measured), 0))]
        for own in blocks.values():
            found.append(np.zeros((len(self.measured), own[0][1].shape[1])))
            for i, rows in own:
                found[-1][self.record == i] = rows
        return np.concatenate(found, axis=1) * self.predicted_only[:, None]

    @cached_property
    def _prediction(self) -> FloatArray:
        """Orthonormal basis of the predictors' rows, (m, rank)."""
        return orthonormal(self.predicting)

    @cached_property
    def visible(self) -> FloatArray:
        """Share of every row's noise that `told` keeps, (m,)."""
        return np.where(self.predicted_only, np.sum(self._prediction**2, axis=1), 1.0)

    def told(self, rows: FloatArray) -> FloatArray:
        """Of rows (m,) or columns of them (m, k), what can be told from noise: all, or what past inputs predict."""
        alone = self.predicted_only if rows.ndim == 1 else self.predicted_only[:, None]
        return np.where(alone, self._prediction @ (self._prediction.T @ rows), rows)

    @cached_property
    def variance(self) -> FloatArray:
        """Mean square of the noise that every row stands for, in the output's unit²; (m,)."""
        return np.concatenate([w.process.spectrum[w.line_of_row] / w.count for _, _, w in self.records])

    @cached_property
    def ranges(self) -> FloatArray:
        """Peak to peak of the measured samples used of every record, in the output's unit; (records,)."""
        return np.array([np.ptp(self.used_samples(i)) for i in range(len(self.records))])

    @cached_property
    def sizes(self) -> FloatArray:
        """What gaps are told in, per record: 1 in the output's unit, or its range where outputs differ; (records,)."""
        return self.ranges if len(self.problem.model.outputs) > 1 else np.ones(len(self.records))

    @property
    def unit(self) -> str:
        """Unit of what is told in `sizes`."""
        outputs = self.problem.model.outputs
        return "1" if len(outputs) > 1 else outputs[0].unit

    @property
    def first_output(self) -> tuple[int, list[FloatArray]]:
        """The first output that some test has, by index, and the whole measured signals of it, (samples,) each."""
        first = min(output for _, output, _ in self.records)
        name = self.problem.model.outputs[first].name
        return first, [self.problem.measurements[k].channel(name) for k, output, _ in self.records if output == first]

    @cached_property
    def told_variance(self) -> FloatArray:
        """`variance` in squared `sizes`, (m,)."""
        return np.asarray(self.variance / self.sizes[self.record] ** 2)

    @property
    def noise_floors(self) -> list[float]:
        """Standard deviation of the noise of every record, relative to the range of the output."""
        return [w.noise_sd / float(size) for (_, _, w), size in zip(self.records, self.ranges, strict=True)]

    def used_samples(self, record: int) -> FloatArray:
        """Measured output of a record over the samples used, (n,)."""
        test, output, w = self.records[record]
        return np.asarray(self.problem.experiments[test].measured[w.start : w.start + w.count, output])

    def of(self, *classes: str) -> NDArray[np.bool_]:
        """Which rows are of these spectral classes, shape (m,)."""
        return np.isin(self.spectral_class, [CLASS_INDEX[name] for name in classes])

    @cached_property
    def explainable(self) -> NDArray[np.bool_]:
        """Which rows may hold a gap that a model can explain: all but the other lines, shape (m,)."""
        return ~self.of("other")

    def whitened(self, outputs: Sequence[FloatArray]) -> FloatArray:
        """Whitened rows (N, m, k) of signals per test (N, samples, outputs, k)."""
        return np.concatenate([w.rows(outputs[test][..., output, :]) for test, output, w in self.records], axis=-2)


def orthonormal(columns: FloatArray) -> FloatArray:
    """Orthonormal basis (rows, rank) of columns (rows, k) of any scale."""
    size = np.linalg.norm(columns, axis=0)
    if not np.any(size > 0):
        return np.zeros((len(columns), 0))
    vectors, values, _ = thin_svd(columns[:, size > 0] / size[size > 0])
    return np.asarray(vectors[:, values > _RANK * values[0]])


def with_discrepancy(observed: WhitenedData, relative: float, *, everywhere: bool = False) -> WhitenedData:
    """The same tests with an unknown gap, relative to each output's range, counted as noise.

    It lies on the constant, all harmonics and the slow lines of a test that repeats; as strong as on the excited lines
    on all of one that does not, whose harmonics may lie anywhere. ``everywhere``: as strong as if it were on the
    harmonics alone, but counted on all lines.
    """
    classes = ("dc", "odd", "even", "excited", *(() if everywhere else ("slow",)))
    records, measured = [], []
    for i, (test, output, w) in enumerate(observed.records):
        experiment, here = observed.problem.experiments[test], observed.record == i
        size = relative * float(observed.ranges[i])
        likely = np.zeros(len(w.frequencies), dtype=bool)
        likely[observed.line[here & observed.of(*classes)]] = True
        more = w.harmonic if w.periods and not everywhere else np.full(len(likely), True)
        records.append((test, output, w.with_discrepancy(size**2, likely, more)))
        measured.append(records[-1][2].rows(experiment.measured[:, output, None])[:, 0])
    counted = replace(observed, records=tuple(records), measured=np.concatenate(measured))
    return replace(counted, noise_share=observed.noise_share * observed.variance / counted.variance)


def whiten(
    problem: Problem,
    calibrations: Sequence[Calibration] = (),
    simulators: SimulatorCache | None = None,
    known: Mapping[tuple[int, int], NoiseProcess] = MappingProxyType({}),
) -> WhitenedData:
    """Find the noise of every record and the class of every line.

    ``known`` is the noise of records that do not repeat, by indices of test and output.
    """
    simulators = simulators or SimulatorCache()
    pairs = objective_pairs(problem.experiments)
    found = forked_map(lambda pair: _whitening(problem, *pair, known), pairs, simulators.jobs)
    problem, records, stages = with_common_memory(problem, found, calibrations)
    measured, noise, phase, classes = [], [], [], []
    for test, output, w in records:
        measurement, values = problem.measurements[test], problem.experiments[test].measured[:, output]
        excitation = measurement.channel(exciting_channel(problem.model, measurement))[w.start : w.start + w.count]
        phase.append(float(np.angle(np.fft.rfft(excitation)[w.periods])) if w.periods else 0.0)
        measured.append(w.rows(values[:, None])[:, 0])
        noise.append(w.noise_rows(values))
        classes.append(classify(w, excitation, rotational_orders(measurement)))
    whitenings = [w for _, _, w in records]
    free = [(own == CLASS_INDEX["other"]) & ~w.harmonic for own, w in zip(classes, whitenings, strict=True)]
    for own, lines in zip(classes, interference_lines(whitenings, noise, free), strict=True):
        own[lines] = CLASS_INDEX["steady"]
    line = [w.line_of_row for w in whitenings]
    return WhitenedData(
        problem,
        records,
        np.concatenate(measured),
        np.repeat(np.arange(len(records)), [len(rows) for rows in line]),
        np.concatenate(line),
        np.concatenate([own[rows] for own, rows in zip(classes, line, strict=True)]),
        np.array(phase),
        stages,
        simulators=simulators,
    )


def _whitening(
    problem: Problem, test: int, output: int, known: Mapping[tuple[int, int], NoiseProcess]
) -> tuple[int, int, Whitening]:
    """Of one record by itself."""
    experiment, analysis = problem.experiments[test], problem.signals[test]
    values, used = experiment.measured[:, output], experiment.weights[:, output] > 0
    noise_sd = analysis.noise_sd[problem.model.outputs[output].name]
    return test, output, whitening(values, used, experiment.step, analysis, noise_sd, known.get((test, output)))
