"""The objectives of a problem: pairs of a test and an output that was measured in it, each with its own noise."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from mofit._typing import FloatArray
from mofit.data import Measurement
from mofit.data.signals import SignalAnalysis, effective_samples
from mofit.models import Model
from mofit.problem.likelihood import Noise
from mofit.simulation import ExperimentData, objective_pairs


def objective_names(model: Model, experiments: Sequence[ExperimentData]) -> tuple[str, ...]:
    """Names of the objectives: those of the tests; of a model with several outputs ``test / output``.

    No name of a test holds a ``/``, so that every name tells its test.
    """
    pairs = objective_pairs(experiments)
    if len(model.outputs) == 1:
        return tuple(experiments[test].name for test, _ in pairs)
    return tuple(f"{experiments[test].name} / {model.outputs[output].name}" for test, output in pairs)


def first_noise(
    model: Model,
    measurements: Sequence[Measurement],
    signals: Sequence[SignalAnalysis],
    experiments: Sequence[ExperimentData],
) -> Noise:
    """The noise of every objective before any point was simulated: white, with the floor seen in the data."""
    pairs = objective_pairs(experiments)
    count = np.array([np.count_nonzero(experiments[test].weights[:, output]) for test, output in pairs], dtype=float)
    floor = []
    for test, output in pairs:
        name = model.outputs[output].name
        floor.append(signals[test].noise_sd[name] / float(np.ptp(measurements[test].channel(name))))
    return Noise(count, np.array(floor), count.copy())


def independent_residuals(experiments: Sequence[ExperimentData], outputs: Iterable[FloatArray]) -> FloatArray:
    """Independent residuals of every objective, from simulated outputs (n, ny) of every test at one point.

    The outputs of a test are dropped before the next are asked for.
    """
    return np.array(
        [
            effective_samples((output - experiment.measured)[experiment.weights[:, y] > 0, y])
            for experiment, output in zip(experiments, outputs, strict=True)
            for y in experiment.fitted
        ]
    )
