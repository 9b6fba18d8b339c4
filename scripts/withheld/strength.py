"""How strong a hidden cause is, what could be mistaken for it, and how far a gap shrinks: from the truth alone.

All is linear around the specimen, and shapes (times, exponents) stand on a grid: a bound from above where an
effect may choose its shape. Rows are the sines' judged samples (after the first period) and the calibration
tests, made white with the true noise; J holds their derivatives by the specimen's eight parameters, g the change that
the cause makes, S_k that of a library effect.

    strength      |M g|^2,  M = I - J J+                      what re-identification leaves: expected score T less q
    separation_k  min |(I - P_[J, S_k]) g|^2                  what effect k besides leaves
    next_pair     min |(I - P_[J, S_k, S_l]) g|^2             what the best other pair of effects k and l leaves
    beyond        |(I - P_[J, all S]) g|^2                    what the whole library at once leaves, or all but one
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, compress

import numpy as np
from causes import LIBRARY, SINES, Cause, Drawn
from numpy.typing import NDArray
from respond import Case, respond
from rig_tests import RigTest
from scipy.stats import norm
from specimen import CENTRE, COLOUR, whitened

Array = NDArray[np.float64]

#: integration here, s; a step test is at rest after this time, s
STEP, SETTLED = 1e-2, 4.0
_CHANGE = 1e-3
#: share of the typical size at which the library's directions are taken
SHARE = 0.3
#: shapes at which a competitor is tried: of times and exponents so many that its best is not missed by much
_GRIDS = {
    "tau_2": (0.01, 0.02, 0.035, 0.06, 0.12, 0.25), "a_f": (0.15, 0.22, 0.3, 0.4, 0.5), "delta_d": (1e-3, 4e-3),
    "y_P": (1e-3, 3e-3, 1e-2), "tau_t": (1.0, 4.0, 15.0),
}  # fmt: skip


@dataclass(frozen=True)
class Ground:
    """Where causes are judged: white rows of each test and their derivatives.

    ``jacobian`` (m, 8) and ``directions`` {effect: [(m, q), ...]} are white; ``places`` are the rows of each test.
    """

    specimen: Mapping[str, float]
    tests: tuple[RigTest, ...]
    noise: str
    clean: tuple[Array, ...]
    places: tuple[slice, ...]
    jacobian: Array
    directions: Mapping[str, tuple[Array, ...]]

    def gaps(self, knobs: Sequence[Mapping[str, float]], kinds: Mapping[str, Sequence[str]]) -> Array:
        """White rows of the change that each setting of the knobs makes, (m, settings)."""
        return self.changes([Case(self.specimen, knob, kinds) for knob in knobs])

    def changes(self, cases: Sequence[Case]) -> Array:
        """White rows of what each case changes, (m, cases)."""
        return _changes([self], [cases])[0]

    def fitted(self, gap: Array, columns: Array) -> tuple[Array, Array]:
        """Factor of each column (m, k) alone beside the parameters that takes up most of a gap (m,), and what is left.

        nan and infinite where the column is not finite.
        """
        basis = _basis(self.jacobian)
        rest, own = (rows - basis @ (basis.T @ rows) for rows in (gap, columns))
        with np.errstate(invalid="ignore", divide="ignore"):
            factors = own.T @ rest / np.sum(own**2, axis=0)
            left = np.sum((rest[:, None] - factors * own) ** 2, axis=0)
        return factors, np.where(np.isfinite(left), left, np.inf)

    def newtons(self, rows: Array, test: int) -> float:
        """RMS [N] of white rows (m,) within a test (of coloured noise: of the frequencies where it is white)."""
        part = rows[self.places[test]]
        return float(np.sqrt(np.mean((part * _scale(self.noise, self.clean[test][-len(part) :])) ** 2)))

    def left(self, gap: Array, *columns: Array) -> float:
        """Squared length of a gap (m,) beside the parameters and further columns."""
        basis = _basis(np.concatenate([self.jacobian, *columns], axis=1))
        return float(np.sum((gap - basis @ (basis.T @ gap)) ** 2))

    def separation(self, gap: Array) -> dict[str, float]:
        """What each library effect, at its best shape, leaves of a gap (m,)."""
        return {name: float(left[0]) for name, left in self.separations(gap[:, None]).items()}

    def separations(self, gaps: Array) -> dict[str, Array]:
        """What each library effect, at its best shape, leaves of gaps (m, k): (k,) each."""
        rest, groups = self._beside_parameters(gaps)
        found: dict[str, Array] = {}
        for name, columns in groups:
            own = _basis(columns)
            left = np.sum((rest - own @ (own.T @ rest)) ** 2, axis=0)
            found[name] = np.minimum(found.get(name, np.inf), left)
        return found

    def rows(self, kept: NDArray[np.bool_]) -> NDArray[np.intp]:
        """Rows of some of the tests, (tests,)."""
        return np.concatenate([np.arange(place.start, place.stop) for place in compress(self.places, kept)])

    def only(self, kept: NDArray[np.bool_]) -> Ground:
        """The same with some of the tests, (tests,)."""
        parts, rows = list(compress(self.places, kept)), self.rows(kept)
        ends = np.cumsum([part.stop - part.start for part in parts])
        return replace(
            self,
            tests=tuple(compress(self.tests, kept)),
            clean=tuple(compress(self.clean, kept)),
            places=tuple(slice(e - p.stop + p.start, e) for e, p in zip(ends, parts, strict=True)),
            jacobian=self.jacobian[rows],
            directions={name: tuple(c[rows] for c in grid) for name, grid in self.directions.items()},
        )

    def next_pair(self, gap: Array, true: Collection[str]) -> float:
        """What the best pair of library effects but the ``true`` one, each at its best shape, leaves of a gap (m,)."""
        rest, groups = self._beside_parameters(gap)
        units = [columns / np.linalg.norm(columns, axis=0).clip(1e-300) for _, columns in groups]
        joined = np.concatenate([rest[:, None], *units], axis=1)
        gram = joined.T @ joined
        ends = 1 + np.cumsum([columns.shape[1] for columns in units])
        places = [np.arange(end - columns.shape[1], end) for end, columns in zip(ends, units, strict=True)]
        taken = [
            gram[0, both] @ np.linalg.pinv(gram[np.ix_(both, both)], 1e-9, hermitian=True) @ gram[both, 0]
            for (i, (one, _)), (j, (other, _)) in combinations(enumerate(groups), 2)
            if one != other and {one, other} != set(true)
            for both in [np.concatenate([places[i], places[j]])]
        ]
        return float(gram[0, 0] - max(taken))

    def _beside_parameters(self, gap: Array) -> tuple[Array, list[tuple[str, Array]]]:
        """Gaps (m,) or (m, k), and directions (m, q) of every effect and shape, less what the parameters take up."""
        basis = _basis(self.jacobian)
        groups = [(name, columns) for name, grid in self.directions.items() for columns in grid]
        return gap - basis @ (basis.T @ gap), [(name, c - basis @ (basis.T @ c)) for name, c in groups]

    def beyond(self, gap: Array, but: str = "") -> float:
        """What the whole library, or all of it ``but`` one effect, leaves of a gap (m,)."""
        return self.left(gap, *(c for name, grid in self.directions.items() if name != but for c in grid))


def ground(specimen: Mapping[str, float], tests: Sequence[RigTest], noise: str, library: bool = True) -> Ground:
    """Derivatives by parameters and, with ``library``, by all effects of the library, in the sine tests."""
    return grounds([(specimen, tests, noise)], library)[0]


def grounds(places: Sequence[tuple[Mapping[str, float], Sequence[RigTest], str]], library: bool = True) -> list[Ground]:
    """The same of several specimens in their tests and noise, side by side: that takes less time."""
    settings = [(cause, *setting) for cause in (LIBRARY if library else ()) for setting in settings_of(cause)]
    judged = [tuple(replace(t, duration=SETTLED) if t.kind == "step" else t for t in tests) for _, tests, _ in places]
    usual = [Case(specimen) for specimen, _, _ in places]
    records = _responses([[(case, t) for t in tests] for case, tests in zip(usual, judged, strict=True)])
    cases = [
        [Case({**specimen, name: value * (1 + _CHANGE)}) for name, value in specimen.items() if name in CENTRE]
        + [Case(specimen, knobs, dict.fromkeys(knobs, place)) for _, _, place, knobs in settings]
        for specimen, _, _ in places
    ]
    bare = [
        Ground(specimen, tests, noise, tuple(clean), _places(tests), np.empty((0, 0)), {})
        for (specimen, _, noise), tests, clean in zip(places, judged, records, strict=True)
    ]
    return [_complete(one, rows, settings) for one, rows in zip(bare, _changes(bare, cases), strict=True)]


def _places(tests: Sequence[RigTest]) -> tuple[slice, ...]:
    """Rows of each test."""
    lengths = [_length(t) for t in tests]
    return tuple(slice(end - n, end) for end, n in zip(np.cumsum(lengths), lengths, strict=True))


def _complete(
    bare: Ground, rows: Array, settings: Sequence[tuple[Cause, int, tuple[str, ...], dict[str, float]]]
) -> Ground:
    """With the derivatives that the changed rows (m, 8 + settings) show."""
    directions: dict[str, dict[int, list[Array]]] = {}
    for column, (cause, group, _, _) in zip(rows[:, len(CENTRE) :].T, settings, strict=True):
        directions.setdefault(cause.name, {}).setdefault(group, []).append(column)
    return replace(
        bare,
        jacobian=rows[:, : len(CENTRE)] / _CHANGE,
        directions={name: tuple(np.stack(c, axis=1) for c in found.values()) for name, found in directions.items()},
    )


def settings_of(cause: Cause) -> list[tuple[int, tuple[str, ...], dict[str, float]]]:
    """(group, place, knobs): directions of one group belong together."""
    shapes = [{name: v} for name, grid in _GRIDS.items() if name in cause.shape for v in grid] or [{}]
    found = []
    for place in cause.places:
        for shape in shapes:
            group = len({g for g, _, _ in found})
            for knob, size in cause.typical.items():
                found.append((group, place, {knob: SHARE * size, **shape}))
    return found


def sized(place: Ground, drawn: Drawn, target: float, *beside: Array, beyond: bool = False) -> float:
    """Multiple of the typical size at which what is left beside the parameters and further columns is as asked.

    With ``beyond``, what the whole library leaves. The nearest that the cause's limits allow, and that the carcass
    stands: a strong softening has no force to hold against the contact patch.
    """
    multiples, gaps = _standing(place, drawn)
    reached = [place.beyond(gap) if beyond else place.left(gap, *beside) for gap in gaps.T]
    level = np.maximum.accumulate(np.log(np.maximum(reached, 1e-12)))
    return float(np.exp(np.interp(np.log(target), level, np.log(multiples))))


def largest(place: Ground, drawn: Drawn) -> float:
    """Multiple of the typical size that the cause's limits and the carcass allow."""
    return float(_standing(place, drawn)[0][-1])


def _standing(place: Ground, drawn: Drawn) -> tuple[Array, Array]:
    """Multiples of the typical size up to the largest, and the gaps (m, multiples) that they make."""
    multiples = np.geomspace(drawn.cause.least, drawn.cause.most, 6)
    with np.errstate(over="ignore", invalid="ignore"):
        gaps = place.gaps([drawn.at(m) for m in multiples], dict.fromkeys(drawn.at(1.0), drawn.place))
    stands = np.cumprod(np.isfinite(gaps).all(axis=0)).astype(bool)
    return multiples[stands], gaps[:, stands]


def shrinkage(place: Ground, gap: Array, columns: Array) -> dict[str, object]:
    """Each sine left out in turn: RMS [N] of the gap before, and of what the estimates' scatter leaves after.

    ``columns`` (m, q) are the directions of the causes that are added. ``share``: what is removed of the mean squares,
    each relative to the range of its test.
    """
    before, after, squares = {}, {}, np.zeros(2)
    joined = np.concatenate([place.jacobian, columns], axis=1)
    for t, test in enumerate(place.tests):
        if test.kind not in SINES:
            continue
        kept = np.ones(len(gap), dtype=bool)
        kept[place.places[t]] = False
        shift = _shift(place.jacobian[kept], gap[kept])
        rest = gap - place.jacobian @ shift
        held = joined[place.places[t]]
        scatter = np.einsum("ni,ij,nj->n", held, np.linalg.pinv(joined[kept].T @ joined[kept], hermitian=True), held)
        left = np.zeros(len(gap))
        left[place.places[t]] = np.sqrt(np.maximum(scatter, 0))
        before[test.name], after[test.name] = place.newtons(rest, t), place.newtons(left, t)
        squares += (np.array([before[test.name], after[test.name]]) / np.ptp(place.clean[t])) ** 2
    return {"before": before, "after": after, "share": float(1 - squares[1] / squares[0]) if squares[0] > 0 else None}


def ruled_out_probability(left: Array, times: float) -> Array:
    """Probability that a competitor is at least so many times less probable, if it leaves this much of a squared gap.

    The two are close: twice the difference of the log likelihoods is normal, its variance four times its mean.
    """
    left = np.maximum(left, 1e-9)
    return np.asarray(norm.cdf((left - 2 * np.log(times)) / (2 * np.sqrt(left))))


def _shift(jacobian: Array, gap: Array) -> Array:
    """Relative change of the parameters that takes up most of a gap; the damper stays above 0."""
    shift = np.asarray(np.linalg.lstsq(jacobian, gap, rcond=None)[0])
    damper = [*CENTRE].index("d_y")
    if shift[damper] < -1:
        others = np.arange(len(shift)) != damper
        shift[damper] = -1
        shift[others] = np.linalg.lstsq(jacobian[:, others], gap + jacobian[:, damper], rcond=None)[0]
    return shift


def _responses(jobs: Sequence[Sequence[tuple[Case, RigTest]]]) -> list[list[Array]]:
    """Records of several lists of tests at once."""
    records = iter(respond([job for part in jobs for job in part], STEP))
    return [[next(records) for _ in part] for part in jobs]


def _changes(places: Sequence[Ground], cases: Sequence[Sequence[Case]]) -> list[Array]:
    """White rows (m, cases) of what cases change in each place."""
    # a test in which nothing is turned stays as it is
    jobs = [
        [
            (case, test)
            for case in own
            for test in place.tests
            if case.values(test.kind) != Case(place.specimen).values(test.kind)
        ]
        for place, own in zip(places, cases, strict=True)
    ]
    found = []
    for place, own, asked, records in zip(places, cases, jobs, _responses(jobs), strict=True):
        forces = {(id(case), test.name): force for (case, test), force in zip(asked, records, strict=True)}
        columns = [
            np.concatenate(
                [
                    _white(forces.get((id(case), test.name), base) - base, test, place.noise, base)
                    for test, base in zip(place.tests, place.clean, strict=True)
                ]
            )
            for case in own
        ]
        empty = np.empty((sum(map(_length, place.tests)), 0))
        found.append(np.stack(columns, axis=1) if columns else empty)
    return found


def _white(change: Array, test: RigTest, noise: str, clean: Array) -> Array:
    """Judged rows of one test: sines after a period, what is left of a step, the whole quasi-static test."""
    if test.kind == "step":
        # the second half of a minute, as one row
        count = 30 * test.rate * ((1 - COLOUR) / (1 + COLOUR) if noise == "coloured" else 1)
        sd = _scale(noise, clean[-1:])
        return np.asarray(change[-1:] * np.sqrt(count) / sd)
    start = len(change) - _length(test)
    return np.asarray(whitened(change[start:, None], noise, clean[start:])[:, 0])


def _scale(noise: str, clean: Array) -> Array:
    return whitened(np.ones((len(clean), 1)), "white" if noise == "coloured" else noise, clean)[:, 0] ** -1


def _length(test: RigTest) -> int:
    if test.kind == "step":
        return 1
    return len(test.time) - (round(test.rate / test.frequency) if test.frequency else 0)


def _basis(columns: Array) -> Array:
    """Orthonormal basis of what columns (m, k) span."""
    lengths = np.linalg.norm(columns, axis=0)
    vectors, values, _ = np.linalg.svd(columns[:, lengths > 0] / lengths[lengths > 0], full_matrices=False)
    return np.asarray(vectors[:, values > 1e-7 * max(values[0] if len(values) else 0, 1e-300)])
