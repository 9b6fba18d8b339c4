r"""Information of tests about the parameters, as numbers that add up from test to test.

The identification minimises a weighted sum of squares. With its Gauss-Newton Hessian H and the covariance J of its
gradient the precision of the estimate is :math:`H J^{-1} H`, the inverse of the sandwich covariance
(`mofit.problem.curvature_adjustment`). H and J of tests add up within a stage: the tests of a calibration stage are
fitted by themselves, and enter as a prior. With S stages before the main identification

.. math:: M = \sum_{g=0}^{S} H_g J_g^{-1} H_g + B, \qquad H_g = \sum_{t \in g} H_t, \quad J_g = \sum_{t \in g} J_t

where B is the precision from the bounds alone. Where all noise is white and known, :math:`J = H` and M is the Fisher
information.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mofit._typing import FloatArray
from mofit.data import Experiment
from mofit.experimental_design.noise_model import ChannelNoise
from mofit.experimental_design.planned_tests import DesignTest, groups, planned_tests
from mofit.experimental_design.sensitivity import TOLERANCE, Sensitivity, sensitivities
from mofit.experimental_design.simulations_needed import require_simulations
from mofit.experimental_design.sources import Source
from mofit.models import Model, build_system

#: A Hessian's eigenvalue below this share of the mean one counts as zero.
_FLAT = 1e-12


@dataclass(frozen=True, eq=False)
class Information:
    """Information of T tests at N parameter samples, per change of each parameter by its scale; G groups."""

    estimator: FloatArray
    """H and J by test, sample and group, (T, N, G, 2, d, d)."""
    fisher: FloatArray
    """Fisher information, (T, N, d, d); nan where a simulation fails."""
    peaks: FloatArray
    """Largest magnitude of each output over the samples, (T, outputs); nan for tests of a calibration stage."""
    main: tuple[Sensitivity, ...] = ()
    """Sensitivities of the tests of the main identification at the first sample, if they are asked for."""


def information(
    model: Model,
    tests: Sequence[DesignTest],
    samples: FloatArray,
    scale: FloatArray,
    jobs: int = 1,
    tolerance: float = TOLERANCE,
    *,
    keep: bool = False,
) -> Information:
    """Information of tests, all of a group at all samples in one simulation.

    Parameters
    ----------
    model, tests
        The model to be identified, and the tests.
    samples
        Parameter samples (N, d) in the order of the model's parameters.
    scale
        Change of each parameter that counts as 1, (N, d); ones give SI units.
    jobs, tolerance
        Threads, on which results do not depend; tolerance of the integration, relative to the outputs' range.
    keep
        Whether the sensitivities of the main tests are kept.

    Raises
    ------
    InputError
        If a user's simulator may take more simulations than are left.
    """
    require_simulations(model, len(tests), len(samples))
    names = [parameter.name for parameter in model.parameters]
    every = groups(model)
    shape = (len(tests), len(samples), len(every), 2, len(names), len(names))
    estimator, fisher = np.zeros(shape), np.zeros((*shape[:2], *shape[-2:]))
    peaks, main = np.full((len(tests), len(model.outputs)), np.nan), []
    for number, group in enumerate(every):
        which = [i for i, test in enumerate(tests) if test.group == number]
        if not which:
            continue
        own = [names.index(parameter.name) for parameter in group.model.parameters]
        found = sensitivities(
            build_system(group.model), [tests[i].data for i in which], samples[:, own],
            [tests[i].noise for i in which], [names[k] for k in own], jobs, tolerance,
        )  # fmt: skip
        square = scale[:, own, None] * scale[:, None, own]
        for i, test in zip(which, found, strict=True):
            place = np.ix_([i], range(len(samples)), [number], range(2), own, own)
            both = np.stack([test.hessian * square, test.score_covariance * square], axis=1)
            estimator[place] = both[None, :, None]
            fisher[np.ix_([i], range(len(samples)), own, own)] = test.fisher * square
            if number == 0:
                peaks[i, list(tests[i].data.fitted)] = [np.max(np.abs(outputs)) for outputs in test.outputs]
                main += [test.first()] if keep else []
    return Information(estimator, fisher, peaks, tuple(main))


def candidate_information(
    model: Model,
    experiments: Sequence[Experiment],
    samples: FloatArray,
    scale: FloatArray,
    noise: Mapping[str, ChannelNoise],
    jobs: int = 1,
    periods: int | None = None,
    tolerance: float = 1e-4,
) -> Information:
    """Information of many planned tests; tests that are alike are simulated once.

    Noise is by output; the rest as in `information`. Of periodic tests only the first ``periods`` are simulated; the
    information of a steady-state period then counts as often as the test has more of them: for searches among many.
    """
    short = [_shortened(experiment, periods) for experiment in experiments]
    keys = [_key(experiment) for experiment in short]
    different = dict(zip(keys, short, strict=True))
    tests = planned_tests(model, list(different.values()), samples[0], noise, (), jobs)
    found = information(model, tests, samples, scale, jobs, tolerance)
    place_of = {id(test.experiment): place for place, test in enumerate(tests)}
    places = [place_of[id(different[key])] for key in keys]
    more = np.empty(len(experiments))
    for number, (experiment, place) in enumerate(zip(experiments, places, strict=True)):
        data = tests[place].data
        transient = data.samples - np.count_nonzero(np.any(data.weights, axis=1))
        more[number] = (len(experiment.time) - transient) / (data.samples - transient)
    return Information(
        estimator=more[:, None, None, None, None, None] * found.estimator[places],
        fisher=more[:, None, None, None] * found.fisher[places],
        peaks=found.peaks[places],
    )


def _shortened(experiment: Experiment, periods: int | None) -> Experiment:
    """A periodic test with its first periods only."""
    if periods is None or not experiment.frequency:
        return experiment
    count = round(periods / (experiment.frequency * experiment.step))
    if count >= len(experiment.time):
        return experiment
    inputs = {name: values[:count] for name, values in experiment.inputs.items()}
    return replace(experiment, time=experiment.time[:count], inputs=inputs)


def _key(experiment: Experiment) -> tuple[object, ...]:
    """Equal for tests with equal excitation and equal samples used in the fit."""
    signals = tuple((name, np.asarray(values).tobytes()) for name, values in sorted(experiment.inputs.items()))
    conditions = tuple(sorted(experiment.conditions.items()))
    return signals, experiment.step, experiment.kind, experiment.interpolation, conditions


def estimator_precision(estimator: FloatArray) -> FloatArray:
    r"""Precision :math:`\sum_g H_g J_g^{-1} H_g` of the estimate, (..., d, d), from sums (..., G, 2, d, d)."""
    hessian, score = estimator[..., 0, :, :], estimator[..., 1, :, :]
    size = hessian.shape[-1]
    trace = np.trace(hessian, axis1=-2, axis2=-1)[..., None, None]
    ratio = np.trace(score, axis1=-2, axis2=-1)[..., None, None] / np.maximum(trace, np.finfo(float).tiny)
    flat = _FLAT * trace / size * np.eye(size)
    empty = ~(trace > 0)
    safe = np.where(empty, np.eye(size), score + ratio * flat)
    own = np.where(empty, 0.0, hessian + flat)
    return np.asarray((np.swapaxes(own, -1, -2) @ np.linalg.solve(safe, own)).sum(axis=-3))


@dataclass(frozen=True, eq=False)
class SourceInformation:
    """Information of all tests of a source; matrices are in the unit cube of the parameters."""

    source: Source
    """The tests."""
    samples: FloatArray
    """The parameter samples, (N, d); the first are the reference values."""
    tests: Information
    """The information of each test."""

    @property
    def derivative(self) -> FloatArray:
        """Derivative of the values by the unit coordinates, (N, d)."""
        return self.source.space.derivative(self.samples)

    @property
    def unit(self) -> FloatArray:
        """The samples in the unit cube, (N, d)."""
        return self.source.space.to_unit(self.samples)

    def estimator(self, tests: Sequence[str], repeats: float = 1.0) -> FloatArray:
        """H and J of named main tests, run ``repeats`` times, and all calibration stages, (N, G, 2, d, d)."""
        main, stages = self._places(tests)
        return np.asarray(repeats * self.tests.estimator[main].sum(axis=0) + self.tests.estimator[stages].sum(axis=0))

    def precision(self, tests: Sequence[str], repeats: float = 1.0) -> FloatArray:
        """Precision of the estimate from these tests and all calibration stages, (N, d, d); without tests the prior."""
        return estimator_precision(self.estimator(tests, repeats))

    def fisher(self, tests: Sequence[str]) -> FloatArray:
        """Fisher information of the same tests, (N, d, d)."""
        main, stages = self._places(tests)
        return np.asarray(self.tests.fisher[[*main, *stages]].sum(axis=0))

    def _places(self, tests: Sequence[str]) -> tuple[list[int], list[int]]:
        every = list(enumerate(self.source.tests))
        main = [i for i, test in every if test.group == 0 and test.name in tests]
        return main, [i for i, test in every if test.group > 0]


def source_information(source: Source, samples: FloatArray, jobs: int = 1) -> SourceInformation:
    """Information of all tests of a source at parameter samples (N, d)."""
    scale = source.space.derivative(samples)
    return SourceInformation(source, samples, information(source.model, source.tests, samples, scale, jobs, keep=True))
