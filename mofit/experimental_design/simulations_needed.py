"""What comparing and designing take of a user's simulator: told before it is begun, and bounded."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from mofit.errors import InputError
from mofit.models import Model
from mofit.simulation.evaluation.differences import LINE
from mofit.simulation.evaluation.evaluations import evaluations_of

#: Tests at which steps of differences are found, at most.
_PROBED = 2


def simulations_needed(model: Model, tests: int, samples: int) -> int:
    """Most simulations for sensitivities of so many tests at so many parameter samples: central differences."""
    around = 2 * len(model.parameters)
    return tests * samples * (1 + around) + min(tests, _PROBED) * (LINE + around)


def require_simulations(model: Model, tests: int, samples: int, planned: int = 0) -> None:
    """Refuse sensitivities that may take more simulations than are left; of equations none.

    So many ``planned`` tests are simulated once beforehand.

    Raises
    ------
    InputError
        With the number that they may take.
    """
    evaluations = evaluations_of(model)
    needed = simulations_needed(model, tests, samples) + planned
    if evaluations is not None and needed > evaluations.left:
        message = f"{tests} tests at {samples} parameter samples may take {needed} simulations"
        least = evaluations.count + sum(evaluations.reserved.values()) + needed
        raise InputError.of(
            f"--simulations {evaluations.limit:.0f}", message, f"Allow {least}, or take fewer --samples or tests"
        )


@contextmanager
def kept_for_later(model: Model, simulations: int) -> Iterator[None]:
    """Within the block so many simulations of a user's simulator are left for what follows it."""
    evaluations = evaluations_of(model)
    if evaluations is None:
        yield
        return
    evaluations.reserved["later"] = simulations
    try:
        yield
    finally:
        del evaluations.reserved["later"]


def refused(model: Model) -> int:
    """Simulations that were not made because the limit was reached."""
    evaluations = evaluations_of(model)
    return 0 if evaluations is None else evaluations.refused
