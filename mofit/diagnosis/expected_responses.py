"""What fitted models predict of experiments that nobody has run yet."""

from __future__ import annotations

from collections.abc import Hashable, Sequence

import numpy as np

from mofit._typing import FloatArray
from mofit.data import Experiment, Measurement
from mofit.data.signals import SignalAnalysis
from mofit.diagnosis.fitting import Fitted
from mofit.diagnosis.whitened_data import WhitenedData
from mofit.models import Model, with_effects
from mofit.simulation import ExperimentData, experiment_data

#: Runge–Kutta steps per sampling interval: no noise is known yet that would say how few are enough.
_STEPS = 8
#: Multiple of the largest measured output past which a simulation has diverged.
_DIVERGENCE = 100.0

#: Output (n,) of an experiment, and its derivative (n, d + l).
Response = tuple[FloatArray, FloatArray]


def expected_responses(
    observed: WhitenedData, models: Sequence[Fitted], experiments: Sequence[Experiment], settling: float
) -> list[list[Response]]:
    """Per model the output of every experiment and its derivative, but for the periods ``settling``.

    By the d unit coordinates, and by the l scoped values that the new test has of its own. nan where it diverges.
    """
    read = _Read(observed, experiments)
    return [_responses(read, one, settling) for one in models]


class _Read:
    """Experiments as models read them: those that read the same share all that is known of them."""

    def __init__(self, observed: WhitenedData, experiments: Sequence[Experiment]) -> None:
        self.observed, self.experiments = observed, experiments
        self._known: dict[Hashable, list[ExperimentData]] = {}

    def by(self, fitted: Fitted) -> tuple[Model, list[ExperimentData]]:
        """The model with its effects, and the experiments with all that it reads."""
        extended = with_effects(self.observed.problem.model, *fitted.hypothesis.effects)
        read = tuple(extended.inputs), tuple(extended.conditions), tuple(extended.outputs)
        if read not in self._known:
            self._known[read] = [self._without_measurement(extended, one) for one in self.experiments]
        return extended, self._known[read]

    def _without_measurement(self, model: Model, experiment: Experiment) -> ExperimentData:
        problem = self.observed.problem
        # any output will do: it is not used
        outputs = {problem.model.outputs[0].name: np.sin(experiment.time)}
        measurement = Measurement(experiment, outputs, problem.measurements[0].units)
        return experiment_data(model, measurement, SignalAnalysis(None, 0, 0.0, 0.0, {}, "", {}), settled=False)


def _responses(read: _Read, fitted: Fitted, settling: float) -> list[Response]:
    layout, point, observed = fitted.hypothesis.layout, fitted.minimum.point[None], read.observed
    extended, tests = read.by(fitted)
    parameters = layout.parameters
    unit = layout.in_new_test(point)
    _, simulator = observed.simulators.simulator(extended, tests, parameters.names, _STEPS)
    first, signals = observed.first_output
    peak = max(float(np.max(np.abs(values))) for values in signals)
    found = []
    slope = parameters.derivative(parameters.from_unit(unit))[0]
    simulated = simulator.sensitivities(layout.by_name.full(unit))
    for experiment, (output, slopes) in zip(read.experiments, simulated, strict=True):
        used = experiment.time >= settling / float(experiment.frequency or 1)
        with np.errstate(over="ignore", invalid="ignore"):
            response, columns = output[0, used, first], layout.in_columns_of_new_test(slopes[0, used, first] * slope)
        if not np.max(np.abs(output[0, :, first])) < _DIVERGENCE * peak:
            response, columns = np.full_like(response, np.nan), np.zeros_like(columns)
        found.append((response, columns))
    return found
