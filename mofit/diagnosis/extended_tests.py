"""The tests of a problem as its model with effects reads them."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from weakref import WeakKeyDictionary

from mofit.data.signals import SignalAnalysis
from mofit.models import Effect, with_effects
from mofit.problem import Problem
from mofit.simulation import ExperimentData, experiment_data


def experiments_of(problem: Problem, effects: Sequence[Effect]) -> Sequence[ExperimentData]:
    """The tests with the inputs and conditions that effects need beside the model's."""
    if not any(effect.inputs or effect.conditions for effect in effects):
        return problem.experiments
    model = with_effects(problem.model, *effects)
    known = _extended.setdefault(problem.experiments[0], {})
    lengths = tuple(experiment.recorded for experiment in problem.experiments)
    read = (tuple(model.inputs), tuple(model.conditions), tuple(model.outputs), lengths)
    signals, found = known.get(read, ((), []))
    if signals is not problem.signals:
        tests = zip(problem.measurements, problem.signals, problem.experiments, strict=True)
        found = [
            experiment_data(model, measurement, analysis, settled=False).first(own.recorded)
            for measurement, analysis, own in tests
        ]
        known[read] = problem.signals, found
    return found


#: Of a problem, by its first test, with which they go, and the channels, conditions and samples read: tables are shared
#: by test.
_extended: WeakKeyDictionary[
    ExperimentData, dict[Hashable, tuple[Sequence[SignalAnalysis], Sequence[ExperimentData]]]
] = WeakKeyDictionary()
