"""Rates of measured inputs: signals that a missing term may depend on, though the model does not read them.

A cable that couples, a coil, an accelerated fixture: what a rig adds may follow the rate of what drives it.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from mofit._typing import FloatArray
from mofit.diagnosis.extended_tests import experiments_of
from mofit.diagnosis.hypothesis import Hypothesis
from mofit.models import Applied, Channel, Effect, Model, Symbols, with_effects
from mofit.models.model import TIME
from mofit.quantities import HOLD

#: Largest deviation of a smoothed input from itself up to which its rate is known, relative to its standard deviation.
_RESOLVED = 0.05


class InputRates(Effect):
    """Reads rates of a model's inputs, and changes nothing."""

    name = "input_rates"
    on = ("output",)

    def __init__(self, model: Model) -> None:
        self.inputs = input_rates(model)

    def apply(self, s: Symbols, value: ca.SX) -> Applied:
        """The output as it is."""
        return Applied(value)


def input_rates(model: Model) -> tuple[Channel, ...]:
    """Rates of the measured inputs whose rate the model does not read itself."""
    groups = (model.inputs, model.states, model.outputs, model.parameters, model.conditions)
    taken = {item.name for group in groups for item in group}
    known = {TIME.name, *(channel.derivative_of for channel in model.inputs)}
    measured = [one for one in model.inputs if one.derivative_of is None and one.name not in known]
    rates = [Channel(f"{one.name}_rate", f"{one.unit}/s", f"rate of {one.name}", one.name) for one in measured]
    return tuple(rate for rate in rates if rate.name not in taken)


def rates_of_inputs(hypothesis: Hypothesis) -> tuple[tuple[Channel, ...], list[dict[str, FloatArray]]]:
    """Rates of the inputs of the tests: the channels, and their samples by name per test; none of inputs that jump."""
    problem = hypothesis.observed.problem
    reads = InputRates(problem.model)
    if not reads.inputs or any(one.interpolation == HOLD for one in problem.experiments):
        return (), [{} for _ in problem.experiments]
    tests = experiments_of(hypothesis.observed.problem, (reads,))
    models = (problem.model, with_effects(problem.model, reads))
    before, after = ([channel.name for channel in model.inputs] for model in models)
    known = []
    for channel in reads.inputs:
        source = str(channel.derivative_of)
        given = np.concatenate([one.inputs[:, before.index(source)] for one in problem.experiments])
        smooth = np.concatenate([one.inputs[:, after.index(source)] for one in tests])
        if np.std(smooth - given) <= _RESOLVED * np.std(given):
            known.append(channel)
    return tuple(known), [{one.name: test.inputs[:, after.index(one.name)].copy() for one in known} for test in tests]
