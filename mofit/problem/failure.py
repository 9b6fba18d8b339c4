"""A model that gives no numbers: in which test, where and when."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from mofit._typing import FloatArray
from mofit.errors import InputError, Issue
from mofit.problem.problem import Problem
from mofit.simulation.failure import find_failure

#: Parameters that a message lists.
_LISTED = 6


@contextmanager
def explained(problem: Problem) -> Iterator[None]:
    """Where the block finds no point that can be simulated, say in which test the model fails, where and when.

    Raises
    ------
    InputError
        That of the block, if the model gives finite outputs at its nominal values.
    """
    try:
        yield
    except InputError as error:
        if issues := model_failures(problem, problem.space.nominal):
            raise InputError(issues) from error
        raise


def model_failures(problem: Problem, free: FloatArray) -> list[Issue]:
    """The first test whose outputs are not finite at values (d,) of the free parameters; empty if there is none."""
    values = problem.layout.full(problem.space.to_unit(free)[None])[0]
    for experiment in problem.experiments:
        if found := find_failure(problem.system, experiment, values):
            pairs = zip(problem.layout.names, values, strict=True)
            at = [f"{name} = {value:.4g}" for name, value in pairs][:_LISTED]
            more = ", …" if len(values) > _LISTED else ""
            where = f"model '{problem.model.name}', test '{experiment.name}'"
            message = f"{found}, with {', '.join(at)}{more}"
            return [Issue(where, message, "Correct the equations, or narrow the bounds to where they hold")]
    return []
