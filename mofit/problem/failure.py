"""A model that gives no numbers, or none of its derivatives: in which test, where and when."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from mofit._typing import FloatArray
from mofit.errors import InputError, Issue
from mofit.problem.problem import Problem
from mofit.simulation.failure import find_failure

#: Parameters that a message lists.
_LISTED = 6
#: What to do about outputs that have no derivatives.
_NO_DERIVATIVE = "Keep the arguments of roots, powers and logarithms away from 0, as in sqrt(fmax(x, 1e-9))"


@contextmanager
def explained(problem: Problem) -> Iterator[None]:
    """Where the block finds no point that can be simulated, say in which test the model fails, where and when.

    Raises
    ------
    InputError
        That of the block, if the model gives finite outputs and derivatives at its nominal values, or that the
        simulations allowed are spent.
    """
    try:
        yield
    except InputError as error:
        evaluations = problem.evaluations
        if evaluations is not None and evaluations.left == 0 and evaluations.refused:
            where = f"--simulations {evaluations.limit:.0f}"
            message = "they were spent before the slopes at a single point were known"
            raise InputError.of(where, message, "Allow more, or narrow the ranges") from error
        if issues := model_failures(problem, problem.space.nominal):
            raise InputError(issues) from error
        raise


def model_failures(problem: Problem, free: FloatArray) -> list[Issue]:
    """The first test whose outputs are not finite at values (d,) of the free parameters, or else their derivatives.

    Empty if there is none.
    """
    values = problem.layout.full(problem.space.to_unit(free)[None])[0]
    for experiment in problem.experiments:
        if found := find_failure(problem.system, experiment, values):
            hint = "Correct the equations, or narrow the bounds to where they hold"
            return [_issue(problem, experiment.name, found, values, hint)]
    for experiment, table in zip(problem.experiments, problem.simulator.one_by_one(values[None], True), strict=True):
        if not (finite := np.isfinite(table[0]).all(axis=-1)).all():
            sample, output = (int(places[0]) for places in np.nonzero(~finite))
            name, when = problem.system.outputs[output], f"{sample * experiment.step:.4g} s"
            found = f"output '{name}' is finite, but not its derivatives by the parameters, from {when} on"
            return [_issue(problem, experiment.name, found, values, _NO_DERIVATIVE)]
    return []


def _issue(problem: Problem, test: str, found: str, values: FloatArray, hint: str) -> Issue:
    pairs = zip(problem.layout.names, values, strict=True)
    at = [f"{name} = {value:.4g}" for name, value in pairs][:_LISTED]
    more = ", …" if len(values) > _LISTED else ""
    return Issue(f"model '{problem.model.name}', test '{test}'", f"{found}, with {', '.join(at)}{more}", hint)
