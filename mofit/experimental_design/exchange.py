"""Which tests to run together in the time there is: greedy, then exchanges; every selection where they are few."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from mofit._typing import FloatArray
from mofit.runtime.progress import Progress, silent

#: Matrices that are evaluated at a time.
_CHUNK = 4096
#: Rounding of sums of times [s].
_ROUNDING = 1e-9

#: Logarithm of a criterion, shape (...), from sums over tests (..., N, …); smaller is better.
Objective = Callable[[FloatArray], FloatArray]


@dataclass(frozen=True)
class ExchangeSettings:
    """Numbers of the search."""

    exhaustive: int = 5000
    """Up to so many selections are all evaluated: that takes about a second."""
    least_gain: float = 1e-6
    """A gain of less in the logarithm of the criterion is none: it would be rounding."""
    rounds: int = 20
    """Rounds of exchanges at most; three or four are what it takes."""
    most_pairs: int = 15
    """Two tests are taken out together while there are at most so many different pairs: their cost grows fast."""


SETTINGS = ExchangeSettings()


@dataclass(frozen=True)
class Selection:
    """Tests to run, as places among the candidates (a place twice is a test repeated)."""

    members: tuple[int, ...]
    """Places, ascending."""
    seconds: float
    """Time it takes, overheads included."""
    value: float
    """Logarithm of the criterion."""
    exhaustive: bool = False
    """Whether every selection that fits was evaluated."""


@dataclass(frozen=True)
class CandidatePool:
    """The candidates as numbers."""

    information: FloatArray
    """What each candidate adds at every parameter sample, shape (C, N, …)."""
    start: FloatArray
    """What there is without any of them, (N, …)."""
    seconds: FloatArray
    """Time that each takes, (C,); infinite for one that must not be chosen."""
    objective: Objective
    """What is minimised."""

    def total(self, members: Sequence[int]) -> FloatArray:
        """Information with these tests, (N, …)."""
        return np.asarray(self.start + self.information[list(members)].sum(axis=0))

    def value(self, members: Sequence[int]) -> float:
        """Logarithm of the criterion with these tests."""
        return float(self.objective(self.total(members)))

    def values_with_one_more(self, base: FloatArray, which: NDArray[np.intp]) -> FloatArray:
        """The same for sums ``base`` (N, …) with each of the candidates ``which`` added, (len(which),)."""
        size = max(1, _CHUNK // len(base))
        parts = [which[i : i + size] for i in range(0, len(which), size)]
        return np.concatenate([self.objective(base + self.information[part]) for part in parts] or [np.empty(0)])

    def cost(self, members: Sequence[int]) -> float:
        """Time of these tests."""
        return float(self.seconds[list(members)].sum())


def best_selection(
    pool: CandidatePool, budget: float, progress: Progress = silent, exhaustive: int = SETTINGS.exhaustive
) -> Selection:
    r"""The selection of least criterion that fits into ``budget`` [s]; tests may repeat.

    Greedy, once by gain and once by gain per second, :math:`(\phi(M) - \phi(M + M_c)) / t_c`; then exchanges (Fedorov):
    one or two tests are taken out and the time is filled again, as long as that gains. Where the selections are at most
    ``exhaustive``, all are evaluated instead. Every candidate alone is among those compared: a budget for one test
    gives the best single test.

    Raises
    ------
    ValueError
        If no candidate fits into the budget.
    """
    if not np.any(pool.seconds <= budget):
        raise ValueError("no candidate fits into the budget")
    every = _every(pool.seconds, budget, exhaustive)
    if every is not None:
        values = [pool.value(members) for members in every]
        best = every[int(np.argmin(values))]
        return Selection(best, pool.cost(best), min(values), exhaustive=True)
    greedy = dict.fromkeys(_filled(pool, (), budget, per_second) for per_second in (False, True))
    found = min((_exchanged(pool, members, budget, progress) for members in greedy), key=pool.value)
    return Selection(found, pool.cost(found), pool.value(found))


def _filled(pool: CandidatePool, members: tuple[int, ...], budget: float, per_second: bool) -> tuple[int, ...]:
    """Tests added one by one, each the best of those that still fit, until none gains."""
    base, left = pool.total(members), budget - pool.cost(members)
    now = float(pool.objective(base))
    while True:
        fits = np.flatnonzero(pool.seconds <= left + _ROUNDING)
        values = pool.values_with_one_more(base, fits)
        gain = now - values
        if not len(fits) or not np.any(gain > SETTINGS.least_gain):
            return tuple(sorted(members))
        best = int(np.argmax(gain / pool.seconds[fits] if per_second else gain))
        members = (*members, int(fits[best]))
        base, now, left = base + pool.information[fits[best]], float(values[best]), left - pool.seconds[fits[best]]


def _exchanged(pool: CandidatePool, members: tuple[int, ...], budget: float, progress: Progress) -> tuple[int, ...]:
    """Selections that differ in one or two tests, the best each time, until none is better."""
    now = pool.value(members)
    for number in range(SETTINGS.rounds):
        progress("exchange", number, SETTINGS.rounds, f"{len(members)} tests")
        kept = [_without(members, out) for out in _removals(members, SETTINGS.most_pairs)]
        tried = dict.fromkeys(_filled(pool, rest, budget, way) for rest in kept for way in (False, True))
        best = min(tried, key=pool.value)
        value = pool.value(best)
        if now - value <= SETTINGS.least_gain:
            break
        members, now = best, value
    return members


def _removals(members: tuple[int, ...], most_pairs: int) -> list[tuple[int, ...]]:
    """Which tests to take out: each one, and each pair while they are few."""
    different = sorted(set(members))
    singles: list[tuple[int, ...]] = [(member,) for member in different]
    pairs: list[tuple[int, ...]] = list(combinations(different, 2))
    pairs += [(member, member) for member, count in Counter(members).items() if count > 1]
    return singles + (pairs if len(pairs) <= most_pairs else [])


def _without(members: tuple[int, ...], out: tuple[int, ...]) -> tuple[int, ...]:
    return tuple((Counter(members) - Counter(out)).elements())


def _every(seconds: FloatArray, budget: float, most: int) -> list[tuple[int, ...]] | None:
    """Every selection that fits and is not empty; None if they are more than ``most``."""
    found: list[tuple[int, ...]] = []
    open_ends: list[tuple[tuple[int, ...], float]] = [((), budget)]
    while open_ends:
        members, left = open_ends.pop()
        for place in range(members[-1] if members else 0, len(seconds)):
            if seconds[place] <= left + _ROUNDING:
                found.append((*members, place))
                open_ends.append((found[-1], left - float(seconds[place])))
        if len(found) > most:
            return None
    return found
