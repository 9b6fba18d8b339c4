"""LISDD as its abstract describes it: a clean regime, flagged regions, a term by exhaustive holdout, a split F-test.

What the abstract leaves open is chosen here: regions are bands of deflection and rate that hold equally many samples;
the clean regime is what is not flagged, from the quieter half on; a region is flagged by an F-test of its residual's
mean square against that of the clean regime, at a false discovery rate of 5 %; one or two terms; blocks of samples in
turn fit a term, choose it, and test it.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.stats import f, false_discovery_control

from diagnosis_peers_cases.answer import Answer, only
from diagnosis_peers_cases.records import Library, Records, distinct, rms
from diagnosis_peers_cases.terms import families
from mofit._typing import FloatArray

#: bands of deflection and of rate; level of both tests; samples of a block; most terms
BANDS, LEVEL, BLOCK, MOST = 4, 0.05, 50, 2
ROUNDS, RIDGE = 20, 1e-9


@dataclass(frozen=True)
class Discovery:
    """Physics from the clean regime, the flagged regions, and the terms that were confirmed there.

    Parameters
    ----------
    edges
        Inner edges of the bands of deflection and rate, (2, bands - 1).
    flagged
        Whether a region is discrepant, (regions,).
    shift
        Change of the fitted parameters, (parameters,).
    library
        Terms that add to the output or to the force.
    sizes
        Factor of each term.
    contributions
        The same in units of the residual; none where no term is confirmed.
    """

    edges: FloatArray
    flagged: NDArray[np.bool_]
    shift: FloatArray
    library: Library
    sizes: dict[str, float]
    contributions: dict[str, float]

    def predict(self, others: Records) -> FloatArray:
        """Residual of other tests: the parameters' change, to first order, and the terms where regions are flagged."""
        found = _parameters(others) @ self.shift
        columns = self.library(others)
        local = self.flagged[_regions(others, self.edges)]
        for name, size in self.sizes.items():
            found += local * size * columns[name].ravel()
        return np.asarray(found.reshape(others.output.shape))


def lisdd(records: Records, held: Records) -> Answer:
    """What is found; told is what the same procedure removes of tests left out in turn."""
    found = discovered(records)
    if found is None:
        return Answer(False, told=0.0)
    share = float(found.flagged.mean())
    where = f"in {share:.0%} of the regions of deflection and rate"
    if not found.contributions:
        return Answer(True, where=where, told=0.0)
    terms = sorted(found.contributions, key=lambda name: -found.contributions[name])
    where = f"{where}: {', '.join(terms)}"
    correction = found.predict(held)
    return Answer(True, tuple(terms), tuple(families(found.contributions)), where, _told(records), correction)


def discovered(records: Records) -> Discovery | None:
    """The procedure on some tests; None where no region is flagged."""
    inner = np.linspace(0, 1, BANDS + 1)[1:-1]
    edges = np.stack([np.quantile(signal, inner) for signal in (records.deflection, records.rate)])
    region = _regions(records, edges)
    shift, left, flagged = _clean(region, _parameters(records), records.residual.ravel())
    if not flagged.any():
        return None
    found = Discovery(edges, flagged, shift, Records.static, {}, {})
    inside = flagged[region]
    block = np.tile(np.arange(records.residual.shape[1]) // BLOCK % 3, len(records.residual))
    best: tuple[float, Library, list[str], FloatArray] | None = None
    for library in (Records.static, Records.driven) if records.forced.size else (Records.static,):
        every = library(records)
        names = distinct(every)
        columns = np.stack([every[name].ravel() / rms(every[name]) for name in names], axis=1)
        error, subset = _by_holdout(columns, left, *(inside & (block == part) for part in (0, 1)))
        if subset and (best is None or error < best[0]):
            best = error, library, [names[k] for k in subset], columns[:, subset]
    if best is None or not _confirmed(best[3], left, inside & (block == 2)):
        return found
    _, library, names, columns = best
    factors = np.linalg.lstsq(columns[inside], left[inside])[0]
    every = library(records)
    sizes = {name: float(size / rms(every[name])) for name, size in zip(names, factors, strict=True)}
    parts = {name: float(abs(size)) for name, size in zip(names, factors, strict=True)}
    return Discovery(edges, flagged, shift, library, sizes, parts)


def _clean(
    region: NDArray[np.intp], slopes: FloatArray, residual: FloatArray
) -> tuple[FloatArray, FloatArray, NDArray[np.bool_]]:
    """Parameters' change by the clean regime, what it leaves of the residual, and which regions are flagged."""
    count = np.bincount(region, minlength=BANDS**2)
    used = count > 0
    energy = np.bincount(region, residual**2, BANDS**2) / np.maximum(count, 1)
    flagged = used & (energy > np.median(energy[used]))
    for _ in range(ROUNDS):
        clean = ~flagged[region]
        shift, _, rank, _ = np.linalg.lstsq(slopes[clean], residual[clean], rcond=1e-6)
        left = residual - slopes @ shift
        freedom = max(int(clean.sum()) - int(rank), 1)
        variance = np.sum(left[clean] ** 2) / freedom
        energy = np.bincount(region, left**2, BANDS**2) / np.maximum(count, 1)
        chance = np.ones(len(count))
        chance[used] = false_discovery_control(f.sf(energy[used] / variance, count[used], freedom))
        before, flagged = flagged, chance < LEVEL
        if np.array_equal(before, flagged) or flagged[used].all():
            break
    return shift, left, flagged


def _by_holdout(
    columns: FloatArray, residual: FloatArray, fitted: NDArray[np.bool_], held: NDArray[np.bool_]
) -> tuple[float, list[int]]:
    """Squares left of held samples by the best few columns of all, and their numbers; none where none helps."""
    (gram, right), (gram_held, right_held) = (
        (columns[part].T @ columns[part], columns[part].T @ residual[part]) for part in (fitted, held)
    )
    best: tuple[float, list[int]] = 0.0, []
    for number in range(1, MOST + 1):
        for subset in map(list, combinations(range(columns.shape[1]), number)):
            square = gram[np.ix_(subset, subset)]
            sizes = np.linalg.solve(square + RIDGE * np.trace(square) * np.eye(number), right[subset])
            change = float(sizes @ gram_held[np.ix_(subset, subset)] @ sizes - 2 * sizes @ right_held[subset])
            if change < best[0]:
                best = change, subset
    return best


def _confirmed(columns: FloatArray, residual: FloatArray, where: NDArray[np.bool_]) -> bool:
    """Whether an F-test on samples that neither fitted nor chose the terms finds them."""
    own, seen = columns[where], residual[where]
    freedom = len(seen) - own.shape[1]
    if freedom < 1:
        return False
    left = float(np.sum((seen - own @ np.linalg.lstsq(own, seen)[0]) ** 2))
    gained = (float(seen @ seen) - left) / own.shape[1]
    return bool(f.sf(gained / (left / freedom), own.shape[1], freedom) < LEVEL)


def _told(records: Records) -> float:
    """Share of the residual's squares that is removed of tests left out in turn."""
    tests, left = range(len(records.residual)), []
    for test in tests:
        one = only(records, [test])
        found = discovered(only(records, [other for other in tests if other != test]))
        predicted = 0.0 if found is None or not found.contributions else found.predict(one)
        left.append(np.mean((one.residual - predicted) ** 2))
    return float(1 - np.mean(left) / np.mean(records.residual**2))


def _regions(records: Records, edges: FloatArray) -> NDArray[np.intp]:
    """Number of the region of every sample, (tests * samples,)."""
    bands = [
        np.searchsorted(own, signal.ravel())
        for own, signal in zip(edges, (records.deflection, records.rate), strict=True)
    ]
    return np.asarray(BANDS * bands[0] + bands[1])


def _parameters(records: Records) -> FloatArray:
    return records.parameters.reshape(len(records.parameters), -1).T
