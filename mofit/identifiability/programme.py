"""Which tests to run together in the time there is: greedy, then exchanges; every programme where they are few."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from mofit.progress import Progress, silent

Array = NDArray[np.float64]

#: Up to so many programmes are all looked at.
FEW = 5000
#: A gain of less than this in the logarithm of the criterion is none.
_LEAST_GAIN = 1e-6
#: Rounds of exchanges; three or four are what it takes.
_ROUNDS = 20
#: Two tests are taken out together while there are at most so many different pairs.
_MOST_PAIRS = 15
#: Matrices that are evaluated at a time.
_CHUNK = 4096

#: Logarithm of a criterion, shape (...), from information (..., N, d, d); smaller is better.
Objective = Callable[[Array], Array]


@dataclass(frozen=True)
class Programme:
    """Tests to run, as places among the candidates (a place twice is a test repeated), and what it comes to.

    Parameters
    ----------
    members
        Places, ascending.
    seconds
        Time it takes, overheads included.
    value
        Logarithm of the criterion.
    exhaustive
        Whether every programme that fits was looked at.
    """

    members: tuple[int, ...]
    seconds: float
    value: float
    exhaustive: bool = False


@dataclass(frozen=True)
class Pool:
    """The candidates as numbers.

    Parameters
    ----------
    information
        Of every candidate at every parameter point, shape (C, N, d, d).
    start
        What is known without any of them, (N, d, d).
    seconds
        Time that each takes, (C,).
    objective
        What is minimised.
    """

    information: Array
    start: Array
    seconds: Array
    objective: Objective

    def total(self, members: Sequence[int]) -> Array:
        """Information with these tests, (N, d, d)."""
        return np.asarray(self.start + self.information[list(members)].sum(axis=0))

    def value(self, members: Sequence[int]) -> float:
        """Logarithm of the criterion with these tests."""
        return float(self.objective(self.total(members)))

    def values_with_one_more(self, base: Array, which: NDArray[np.intp]) -> Array:
        """The same of information ``base`` (N, d, d) with each of the candidates ``which`` added, (len(which),)."""
        size = max(1, _CHUNK // len(base))
        parts = [which[i : i + size] for i in range(0, len(which), size)]
        return np.concatenate([self.objective(base + self.information[part]) for part in parts] or [np.empty(0)])

    def cost(self, members: Sequence[int]) -> float:
        """Time of these tests."""
        return float(self.seconds[list(members)].sum())


def best_programme(pool: Pool, budget: float, progress: Progress = silent) -> Programme:
    r"""The programme of least criterion that fits into ``budget`` [s]; tests may repeat.

    Greedy, once by gain and once by gain per second, :math:`(\phi(M) - \phi(M + M_c)) / t_c`; then exchanges: one or
    two tests are taken out and the time is filled again, as long as that gains. Where there are at most `FEW`
    programmes, all are looked at instead. Every candidate alone is among those compared: a budget for one test gives
    the best single test.

    Raises
    ------
    ValueError
        If no candidate fits into the budget.
    """
    if not np.any(pool.seconds <= budget):
        raise ValueError("no candidate fits into the budget")
    every = _every(pool.seconds, budget)
    if every is not None:
        values = [pool.value(members) for members in every]
        best = every[int(np.argmin(values))]
        return Programme(best, pool.cost(best), min(values), exhaustive=True)
    greedy = [_filled(pool, (), budget, per_second) for per_second in (False, True)]
    found = min((_exchanged(pool, members, budget, progress) for members in dict.fromkeys(greedy)), key=pool.value)
    return Programme(found, pool.cost(found), pool.value(found))


def _filled(pool: Pool, members: tuple[int, ...], budget: float, per_second: bool = False) -> tuple[int, ...]:
    """Tests added one by one, each the best of those that still fit, until none gains."""
    base, left = pool.total(members), budget - pool.cost(members)
    now = float(pool.objective(base))
    while True:
        fits = np.flatnonzero(pool.seconds <= left + 1e-9)
        values = pool.values_with_one_more(base, fits)
        gain = now - values
        if not len(fits) or not np.any(gain > _LEAST_GAIN):
            return tuple(sorted(members))
        best = int(np.argmax(gain / pool.seconds[fits] if per_second else gain))
        members = (*members, int(fits[best]))
        base, now, left = base + pool.information[fits[best]], float(values[best]), left - pool.seconds[fits[best]]


def _exchanged(pool: Pool, members: tuple[int, ...], budget: float, progress: Progress) -> tuple[int, ...]:
    """Programmes that differ in one or two tests, the best each time, until none is better."""
    now = pool.value(members)
    for number in range(_ROUNDS):
        progress("exchange", number, _ROUNDS, f"{len(members)} tests")
        kept = [_without(members, out) for out in _removals(members)]
        tried = dict.fromkeys(_filled(pool, rest, budget, way) for rest in kept for way in (False, True))
        best = min(tried, key=pool.value)
        value = pool.value(best)
        if now - value <= _LEAST_GAIN:
            break
        members, now = best, value
    return members


def _removals(members: tuple[int, ...]) -> list[tuple[int, ...]]:
    """Which tests to take out: each one, and each pair while they are few."""
    different = sorted(set(members))
    singles: list[tuple[int, ...]] = [(member,) for member in different]
    pairs: list[tuple[int, ...]] = list(combinations(different, 2))
    pairs += [(member, member) for member, count in Counter(members).items() if count > 1]
    return singles + (pairs if len(pairs) <= _MOST_PAIRS else [])


def _without(members: tuple[int, ...], out: tuple[int, ...]) -> tuple[int, ...]:
    return tuple((Counter(members) - Counter(out)).elements())


def _every(seconds: Array, budget: float) -> list[tuple[int, ...]] | None:
    """Every programme that fits and is not empty; None if they are more than `FEW`."""
    found: list[tuple[int, ...]] = []
    open_ends: list[tuple[tuple[int, ...], float]] = [((), budget)]
    while open_ends:
        members, left = open_ends.pop()
        for place in range(members[-1] if members else 0, len(seconds)):
            if seconds[place] <= left + 1e-9:
                found.append((*members, place))
                open_ends.append((found[-1], left - float(seconds[place])))
        if len(found) > FEW:
            return None
    return found
