"""Candidate tests of a design: their signals, their time, which the rig cannot run, and their information."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mofit._typing import FloatArray
from mofit.data import Experiment
from mofit.design.information import Information, information
from mofit.design.noise_model import ChannelNoise
from mofit.design.planned_tests import planned_tests
from mofit.design.rig_limits import RigLimits, required_limits, violation
from mofit.models import Model
from mofit.simulation.virtual_rig.plan import Plan, TestPlan
from mofit.simulation.virtual_rig.setup import set_up


@dataclass(frozen=True, eq=False)
class Candidate:
    """A test that could be run."""

    plan: TestPlan
    """As in a plan file."""
    experiment: Experiment
    """Its signals."""
    seconds: float
    """Its duration and the rig's overhead [s]."""
    infeasible: str = ""
    """The limit that it violates; empty if none."""

    @property
    def name(self) -> str:
        """Name of the test."""
        return self.plan.name


def candidates(base: Plan, plans: Sequence[TestPlan], limits: RigLimits, overhead: float) -> tuple[Candidate, ...]:
    """Signals of all tests, and which of them violate a limit of the input (of outputs: later, by simulation).

    Parameters
    ----------
    base
        The plan that the tests would join: model, conditions, and the seed of the phases of multisines (those that
        `mofit simulate` draws are others).
    plans
        The tests.
    limits
        Of the model's driven input; tests of a calibration stage have an input of their own, of which only the
        sampling rate and the duration are limited.
    overhead
        Time per test beside its duration [s].

    Raises
    ------
    InputError
        With every issue: values of the wrong unit, missing conditions.
    """
    setup = set_up(base.model_copy(update={"tests": tuple(plans)}), "space")
    found = []
    for test in setup.tests:
        # the same phases for every multisine, whatever the other candidates are
        experiment = test.experiment(np.random.default_rng(base.seed), setup.conditions)
        required = required_limits(experiment, test.excited.name)
        broken = violation(required, limits, test.excited.unit)
        found.append(Candidate(test.plan, experiment, required.duration + overhead, broken))
    return tuple(found)


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

    Parameters
    ----------
    model, samples, scale, jobs, tolerance
        See `mofit.design.information.information`.
    experiments
        The tests.
    noise
        By output.
    periods
        Periodic tests are simulated for so many periods only. The information of a steady-state period then counts as
        often as the test has more of them: for searches among many.
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
        transient = data.samples - np.count_nonzero(data.weights[:, 0])
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
