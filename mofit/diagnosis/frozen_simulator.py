"""A user's simulator at one point: what it gave there is a further input, and the effects around it are equations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from mofit._typing import FloatArray
from mofit.models import (
    BlackBoxSystem,
    Channel,
    Effect,
    Equations,
    Model,
    Simulator,
    Symbols,
    build_system,
    with_effects,
)
from mofit.simulation import ExperimentData
from mofit.simulation.evaluation.engine import BlackBoxEngine

#: What the names of the simulated outputs begin with.
SIMULATED = "simulated_"


class FrozenSimulator(Model):
    """Outputs that are inputs: those of a simulator at one point."""

    def __init__(self, box: Simulator) -> None:
        self.name, self.parameters, self.conditions = box.name, box.parameters, box.conditions
        self.outputs = box.outputs
        self.inputs = (*box.inputs, *(Channel(SIMULATED + one.name, one.unit) for one in box.outputs))

    def equations(self, s: Symbols) -> Equations:
        """What was simulated."""
        return Equations(outputs={one.name: getattr(s, SIMULATED + one.name) for one in self.outputs})


def frozen(
    box: Simulator,
    effects: Sequence[Effect],
    tests: Sequence[Mapping[str, float]],
    experiments: Sequence[ExperimentData],
) -> tuple[Model, list[ExperimentData]]:
    """The frozen simulator without effects, and the tests with what was simulated in them.

    Parameters
    ----------
    box, effects
        The simulator and the effects around it.
    tests
        Values of all parameters by test.
    experiments
        The tests as the simulator with effects takes them.
    """
    system = build_system(with_effects(box, *effects))
    assert isinstance(system, BlackBoxSystem)
    model, engine = FrozenSimulator(box), BlackBoxEngine(system, ())
    wanted = [channel.name for channel in with_effects(model, *effects).inputs]
    found = []
    for values, experiment in zip(tests, experiments, strict=True):
        simulated = engine.simulated(experiment, np.array([values[name] for name in system.parameters]))
        columns: dict[str, FloatArray] = dict(zip(system.inputs, experiment.inputs.T, strict=True))
        columns |= {SIMULATED + one.name: simulated[:, k] for k, one in enumerate(box.outputs)}
        found.append(replace(experiment, inputs=np.stack([columns[name] for name in wanted], axis=1)))
    return model, found
