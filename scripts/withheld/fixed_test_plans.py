"""Which tests a campaign needs to name an effect: what a perfect diagnosis could distinguish at best.

    python scripts/withheld/fixed_test_plans.py --out reports/fixed_test_plans/README.md [--specimens 9] [--seed 1]
                                          [--jobs 1]

The numbers follow from the truth alone, in the linear model (`strength`). An effect has strength S, drawn from 50 to
2,000 on a log scale. It is named first where its best competitor is less probable, and alone where that is less than a
tenth as probable. The competitor leaves a share r of the effect's gap. Twice the difference of the log likelihoods is
normal with mean r S and variance 4 r S; it must exceed 0, or 2 ln 10. The test plans are the paper's nine sines, alone,
with each sine of a pool, and with the best two, three and four of them, added one by one. A sine takes 10 s at 100 Hz,
those of 16 and 20 Hz take 5 s at 400 Hz.
"""

from __future__ import annotations

import argparse
import platform
from collections.abc import Iterator, Sequence, Set
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import scipy
from causes import LIBRARY, draw_cause
from numpy.typing import NDArray
from rig_tests import FURTHER, SPEED, further_sine, phases, planned_tests
from specimen import NOISES, draw_specimen
from strength import Ground, ground, ruled_out_probability

Array = NDArray[np.float64]

LOW, SLOW, FAST = 20 / 3.6, 36 / 3.6, 90 / 3.6
#: frequency [Hz], amplitude [deg], speed [m/s]
POOL = (
    *(
        (f, a, SPEED)
        for f, a in ((6, 2), (8, 2), (0.5, 6), (1, 6), (2, 6), (4, 6), (6, 6), (8, 6), (2, 8), (4, 8), (6, 8))
    ),
    *((f, a, SLOW) for f, a in ((2, 2), (6, 2), (2, 6), (4, 6), (6, 6), (2, 8), (4, 8), (6, 8))),
    *((f, a, LOW) for f, a in ((0.5, 2), (2, 2), (6, 2), (2, 6))),
    *((f, a, FAST) for f, a in ((2, 6), (4, 6))),
    *((f, 2, v) for f in (16, 20) for v in (SPEED, FAST)),
)
MOST = 4
STRENGTHS = np.geomspace(50, 2000, 25)
#: share of the typical size at which an effect's gap is taken
_SHARE = 0.5


@dataclass(frozen=True)
class Tyre:
    """One specimen in all tests: its ground, and the gap (m,) that every effect makes."""

    place: Ground
    gaps: dict[str, Array]


def main() -> None:
    """Write the page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--specimens", type=int, default=9)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=1, help="processes; results do not depend on it")
    options = parser.parse_args()
    with ProcessPoolExecutor(options.jobs, get_context("spawn")) as pool:
        tyres = list(pool.map(partial(tyre, seed=options.seed), range(options.specimens)))
    command = f"`python scripts/withheld/fixed_test_plans.py --specimens {options.specimens} --seed {options.seed}`"
    made_by = f"{command}; Python {platform.python_version()}, numpy {np.__version__}, scipy {scipy.__version__}"
    options.out.write_text("\n".join(page(tyres, made_by)) + "\n", encoding="utf-8")


def tyre(number: int, seed: int) -> Tyre:
    """A specimen in the planned tests and in every sine of the pool."""
    rng = np.random.default_rng([seed, number])
    specimen, tests = draw_specimen(rng), list(planned_tests(rng, paper=True))
    clock = max(t.start_time + t.duration for t in tests if t.start_time is not None)
    for i, (frequency, amplitude, speed) in enumerate(POOL):
        clock += 30
        more = further_sine(float(frequency), float(amplitude), speed)
        tests.append(replace(more, name=f"more_{i}", start_time=clock, **phases(rng)))
        clock += more.duration
    place = ground(specimen, tests, NOISES[number % len(NOISES)])
    drawn = [draw_cause(cause, rng) for cause in LIBRARY]
    with np.errstate(over="ignore", invalid="ignore"):
        gaps = {d.cause.name: place.gaps([d.at(_SHARE)], dict.fromkeys(d.at(1.0), d.place))[:, 0] for d in drawn}
    # a strong softening has no force to hold against the contact patch
    return Tyre(place, {name: gap for name, gap in gaps.items() if np.isfinite(gap).all()})


def page(tyres: Sequence[Tyre], made_by: str) -> Iterator[str]:
    """Lines of the page."""
    yield from (
        "# What fixed test plans can distinguish at best",
        "",
        (__doc__ or "").partition("\n\n")[2].split("\n\n", 1)[1],
    )
    yield from (f"Written by {made_by}.", "", "| tests | first at best | alone at best |", "|---|---|---|")
    chosen: list[int] = []
    yield f"| the nine sines | {_percent(probabilities(tyres, chosen))} |"
    for count in range(1, MOST + 1):
        found = {i: probabilities(tyres, [*chosen, i]) for i in range(len(POOL)) if i not in chosen}
        best = max(found, key=lambda i: found[i])
        for i in found if count == 1 else ():
            yield f"| … and {_sine(i)} | {_percent(found[i])} |"
        chosen.append(best)
        yield f"| **the best {count} more**: {'; '.join(map(_sine, chosen))} | {_percent(found[best])} |"
    own = [POOL.index(of) for of in FURTHER]
    yield f"| **the campaigns' own**: {'; '.join(map(_sine, own))} | {_percent(probabilities(tyres, own))} |"
    yield f"| all {len(POOL)} more | {_percent(probabilities(tyres, range(len(POOL))))} |"


def _percent(shares: Sequence[float]) -> str:
    return " | ".join(f"{100 * share:.1f} %" for share in shares)


def _sine(number: int) -> str:
    frequency, amplitude, speed = POOL[number]
    return f"{frequency:g} Hz, {amplitude:g}° at {3.6 * speed:.0f} km/h"


def probabilities(tyres: Sequence[Tyre], more: Sequence[int]) -> tuple[float, float]:
    """Mean probability that a strong effect is named first, and alone, with these sines of the pool."""
    shares = np.concatenate([competitors(one, {f"more_{i}" for i in more}) for one in tyres])
    left = shares[:, None] * STRENGTHS
    return float(np.mean(ruled_out_probability(left, 1))), float(np.mean(ruled_out_probability(left, 10)))


def competitors(one: Tyre, more: Set[str]) -> Array:
    """Share of each effect's gap that its best competitor leaves in the plan and some sines of the pool, (effects,)."""
    kept = np.array([t.name in more or not t.name.startswith("more_") for t in one.place.tests])
    place, rows = one.place.only(kept), one.place.rows(kept)
    gaps = np.stack([gap[rows] for gap in one.gaps.values()], axis=1)
    left = place.separations(gaps)
    nearest = [min(v[k] for other, v in left.items() if other != name) for k, name in enumerate(one.gaps)]
    return np.array(nearest) / [place.left(gap) for gap in gaps.T]


if __name__ == "__main__":
    main()
