"""The simulations that are allowed: enough to begin with, some kept for later, and a word on what went without."""

from __future__ import annotations

from collections.abc import Sequence

from mofit.errors import InputError
from mofit.identification.descents import kept_for_refinement
from mofit.identification.findings import Finding
from mofit.identification.search_budget import FEWEST_SETS
from mofit.problem import Problem
from mofit.simulation.evaluation.draws import simulations_for

#: Steps of a descent that a test alone must be worth.
ALONE = 12
#: Share of the simulations left that is kept for what follows search and descents, at most.
KEPT_SHARE = 0.4
#: Emulators' worth of simulations that is kept for sampling: the first sets, and as many to check and refine.
FIRST_EMULATOR = 2
#: What a diagnosis begins with that asked for more simulations than there were.
SIMULATIONS_SPENT = "The simulations that are allowed did not suffice: what follows is not to be trusted."


def check_allowed(problem: Problem) -> None:
    """Refuse a limit that does not let a search and one descent begin.

    Raises
    ------
    InputError
        If too few simulations are allowed.
    """
    evaluations = problem.evaluations
    if evaluations is None:
        return
    tests, free, least = len(problem.tests), len(problem.space), _least(problem)
    if evaluations.limit < least:
        message = f"too few for {tests} tests and {free} free parameters"
        raise InputError.of(f"--simulations {evaluations.limit:.0f}", message, f"Give at least {least}")


def _least(problem: Problem) -> int:
    """Simulations with which a search and a descent can begin, and the best minimum be refined."""
    descent = 2 * len(problem.tests) * (FEWEST_SETS + 2 * (1 + len(problem.space)))
    return descent + kept_for_refinement(problem)


def enough_to_search(problem: Problem) -> bool:
    """Whether the simulations left let another search begin, in wider ranges say."""
    return problem.evaluations is None or problem.evaluations.left >= _least(problem)


def keep_for_sampling(problem: Problem) -> None:
    """Keep simulations for a refinement, the score at a minimum and a first emulator: a search does not spend all."""
    evaluations = problem.evaluations
    if evaluations is not None:
        free = len(problem.space)
        evaluations.reserved.clear()
        score, emulator = (len(problem.tests) * sets for sets in (1 + 2 * free, FIRST_EMULATOR * simulations_for(free)))
        most = max(KEPT_SHARE * evaluations.left - score, 0)
        evaluations.reserved |= {"score": score, "emulator": int(min(emulator, most))}
        evaluations.reserved["refinement"] = int(min(kept_for_refinement(problem), evaluations.left / 2))


def check_left(problem: Problem) -> None:
    """Refuse to go on where search and descents have left nothing for the uncertainty.

    Raises
    ------
    InputError
        If too few simulations are left.
    """
    evaluations = problem.evaluations
    if evaluations is None:
        return
    evaluations.reserved.pop("score", None)
    if evaluations.left < len(problem.tests) * (1 + 2 * len(problem.space)) and evaluations.refused:
        message = "they were spent before the uncertainty could be computed"
        raise InputError.of(f"--simulations {evaluations.limit:.0f}", message, "Allow more, or narrow the ranges")


def keep_for_predictions(problem: Problem, records: int) -> None:
    """Keep simulations for predictions of so many records; with 0 they are free again."""
    if problem.evaluations is not None:
        problem.evaluations.reserved["predictions"] = records * simulations_for(len(problem.space))


def enough_alone(problem: Problem) -> bool:
    """Whether the simulations left let every test be fitted alone."""
    if problem.evaluations is None:
        return True
    return problem.evaluations.left >= len(problem.tests) * ALONE * (1 + 2 * len(problem.space))


def shortages(problem: Problem, groups: Sequence[str]) -> list[str]:
    """A sentence on each thing that the limit left out, given the reference fits that there are."""
    evaluations = problem.evaluations
    if evaluations is None:
        return []
    found = []
    if "/per_frequency" not in groups:
        found.append("Too few simulations were left to fit each test alone: their homogeneity is not known.")
    return found


def cut_short(problem: Problem) -> list[Finding]:
    """That descents ended early for want of simulations, if they did."""
    evaluations = problem.evaluations
    if evaluations is None or not evaluations.refused:
        return []
    text = (
        f"The limit of {evaluations.limit:.0f} simulations was reached: {evaluations.refused} that were asked for were "
        "not made. Minima may not be reached, and the posterior around them may be wrong. Allow more (--simulations)."
    )
    return [Finding("simulations", "untrusted", text)]


def all_simulated(problem: Problem) -> bool:
    """Whether all simulations were made that were asked for."""
    return problem.evaluations is None or problem.evaluations.refused == 0


def simulations_told(problem: Problem) -> list[str]:
    """What a diagnosis took of a user's simulator, and what went without; nothing of a model that has equations."""
    evaluations = problem.evaluations
    if evaluations is None:
        return []
    found = [f"{evaluations.count} simulations. Effects that act inside the simulator are out of reach."]
    return [*found, *shortages(problem, ("/per_frequency",))]
