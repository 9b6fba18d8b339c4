"""Which campaigns there are, and what each hides."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from causes import BY_NAME, LIBRARY, UNMODELLED, VARIANTS, Drawn, draw_cause
from numpy.typing import NDArray
from respond import Case, respond
from rig_tests import RigTest, planned_tests
from rivals import closest
from specimen import NOISES, draw_specimen
from strength import Ground, grounds, largest, shrinkage, sized

#: every second campaign draws the strength, the others the size as a multiple of the typical one, both on a log scale
RANGE, MULTIPLES = (8.0, 2000.0), (0.3, 2.0)
#: of what is left beside the whole library (unmodelled causes), or beside the other cause (pairs)
CLEAR = (100.0, 3000.0)
FAIR_PAIR, TRIES = 50.0, 25
#: knobs that may soften the carcass: it can give way late in a test; then the size is taken back by this factor
SOFTENING, LESS = {"k_c", "k_a", "e_y"}, 0.8
#: cases in the hash of a campaign's name: a seed makes the campaigns that it made under these names
_HASHED = {"variant": "kin", "unmodelled": "unknown"}


@dataclass(frozen=True)
class Slot:
    """One campaign to be made: ``case`` none, effect, variant, unmodelled or pair; ``cause`` by name where it is given.

    ``paper``: with the paper's tests alone.
    """

    seed: int
    case: str
    cause: str
    number: int
    paper: bool = False

    @property
    def campaign(self) -> str:
        """Opaque name."""
        kind, case = "withheld paper" if self.paper else "withheld", _HASHED.get(self.case, self.case)
        return hashlib.sha256(f"{kind} {self.seed} {case} {self.cause} {self.number}".encode()).hexdigest()[:12]

    @property
    def noise(self) -> str:
        """Kind of noise, in turn."""
        return NOISES[self.number % len(NOISES)]

    def rng(self, stream: int) -> np.random.Generator:
        """A stream of its own for every use: 0 specimen and tests, 1 cause, 2 noise, from 10 appended tests."""
        return np.random.default_rng([int(self.campaign, 16) % 2**32, int(self.campaign, 16) >> 32, stream])


def slots(
    seed: int, none: int, per_effect: int, unmodelled: int, pairs: int, variants: int, paper: bool = False
) -> list[Slot]:
    """All campaigns, in the order of their opaque names; more of a kind leave the others as they are."""
    found = [Slot(seed, "none", "", i, paper) for i in range(none)]
    counted = (
        ("effect", LIBRARY, per_effect), ("variant", VARIANTS, variants), ("unmodelled", UNMODELLED, unmodelled),
    )  # fmt: skip
    for case, causes, count in counted:
        found += [Slot(seed, case, cause.name, i, paper) for cause in causes for i in range(count)]
    found += [Slot(seed, "pair", "", i, paper) for i in range(pairs)]
    return sorted(found, key=lambda slot: slot.campaign)


def setting(slot: Slot) -> tuple[dict[str, float], tuple[RigTest, ...]]:
    """Specimen and tests of a campaign."""
    rng = slot.rng(0)
    while True:
        specimen, tests = draw_specimen(rng), planned_tests(rng, slot.paper)
        # the most that the carcass can hold is c_y / (4 |p_y|)
        if specimen["c_y"] > 4 * abs(specimen["p_y"]) * specimen["F_M"] or _stands(Case(specimen), tests):
            return specimen, tests


def label(slot: Slot) -> dict[str, Any]:
    """What a campaign hides, how strong that is, and what could be mistaken for it (see `strength`)."""
    return labels_of([slot])[slot.campaign]


def labels_of(wanted: Sequence[Slot]) -> dict[str, dict[str, Any]]:
    """The same of several campaigns, by name."""
    hiding = [slot for slot in wanted if slot.case != "none"]
    places = grounds([(*setting(slot), slot.noise) for slot in hiding])
    judged = dict(zip(hiding, places, strict=True))
    return {slot.campaign: _label(slot, judged.get(slot)) for slot in wanted}


def _label(slot: Slot, place: Ground | None) -> dict[str, Any]:
    specimen, tests = setting(slot)
    entry: dict[str, Any] = {
        "seed": slot.seed, "case": slot.case, "cause": slot.cause, "number": slot.number, "noise": slot.noise,
        "paper": slot.paper, "specimen": specimen, "causes": [],
    }  # fmt: skip
    if place is None:
        return entry
    rng = slot.rng(1)
    chosen = _pair(place, rng) if slot.case == "pair" else [_single(place, slot, rng)]
    kinds = {knob: drawn.place for drawn, _ in chosen for knob in drawn.at(1.0)}
    softer = SOFTENING & kinds.keys()
    while softer and not _stands(Case(specimen, _merged(drawn.at(m) for drawn, m in chosen), kinds), tests):
        chosen = [(drawn, LESS * m) for drawn, m in chosen]
    whole = place.gaps([_merged(drawn.at(m) for drawn, m in chosen)], kinds)[:, 0]
    own = [place.gaps([drawn.at(m)], kinds)[:, 0] for drawn, m in chosen]
    for i, (drawn, m) in enumerate(chosen):
        others = [gap[:, None] for j, gap in enumerate(own) if j != i]
        entry["causes"].append(
            {
                "name": drawn.cause.name,
                "named": drawn.cause.alias or drawn.cause.name,
                "size": drawn.size(m) / (3 if drawn.cause.name == "finite_brush" else 1),
                "unit": drawn.cause.unit,
                "knobs": drawn.at(m),
                "place": drawn.place,
                "strength": place.left(own[i]),
                "strength_beside_others": place.left(own[i], *others),
            }
        )
    entry["strength"] = place.left(whole)
    entry["separation"] = closest(place, whole) if slot.case == "effect" else place.separation(whole)
    entry["beyond_library"] = place.beyond(whole)
    if slot.case == "effect":
        entry["beyond_others"] = place.beyond(whole, but=slot.cause)
    if slot.case == "pair":
        entry["next_pair"] = place.next_pair(whole, [drawn.cause.name for drawn, _ in chosen])
    if slot.case in ("effect", "pair"):
        entry["shrinkage"] = shrinkage(place, whole, np.stack(own, axis=1))
    return entry


def case_of(entry: Mapping[str, Any], bare: bool = False) -> Case:
    """Specimen with its causes; ``bare`` without them."""
    if bare:
        return Case(entry["specimen"])
    knobs = _merged(cause["knobs"] for cause in entry["causes"])
    return Case(entry["specimen"], knobs, {knob: c["place"] for c in entry["causes"] for knob in c["knobs"]})


def slot_of(entry: Mapping[str, Any]) -> Slot:
    """The slot that a label belongs to."""
    return Slot(entry["seed"], entry["case"], entry["cause"], entry["number"], entry.get("paper", False))


def _merged(settings: Iterator[Mapping[str, float]] | Any) -> dict[str, float]:
    return {name: value for knobs in settings for name, value in knobs.items()}


def _log_uniform(rng: np.random.Generator, bounds: Sequence[float]) -> float:
    return float(np.exp(rng.uniform(*np.log(bounds))))


def _single(place: Ground, slot: Slot, rng: np.random.Generator) -> tuple[Drawn, float]:
    drawn = draw_cause(BY_NAME[slot.cause], rng)
    unmodelled = slot.case == "unmodelled"
    if not unmodelled and (slot.number // len(NOISES)) % 2:
        return drawn, min(_log_uniform(rng, MULTIPLES), largest(place, drawn))
    return drawn, sized(place, drawn, _log_uniform(rng, CLEAR if unmodelled else RANGE), beyond=unmodelled)


def _pair(place: Ground, rng: np.random.Generator) -> list[tuple[Drawn, float]]:
    """Two effects of the library that each stay visible beside the other."""
    for _ in range(TRIES):
        first, second = rng.choice(len(LIBRARY), 2, replace=False)
        pair = [draw_cause(LIBRARY[i], rng) for i in (first, second)]
        if set(pair[0].shape) & set(pair[1].shape):
            continue
        beside = [_direction(place, pair[1]), _direction(place, pair[0])]
        wanted = [_log_uniform(rng, CLEAR) for _ in pair]
        sizes = [sized(place, d, w, b) for d, w, b in zip(pair, wanted, beside, strict=True)]
        gaps = [place.gaps([d.at(m)], dict.fromkeys(d.at(m), d.place))[:, 0] for d, m in zip(pair, sizes, strict=True)]
        clear = [place.left(g, b) for g, b in zip(gaps, beside, strict=True)]
        if min(clear) >= FAIR_PAIR and min(place.separation(gaps[0] + gaps[1]).values()) >= FAIR_PAIR:
            return list(zip(pair, sizes, strict=True))
    raise RuntimeError("no pair of effects was clear enough; try another seed")


def _stands(case: Case, tests: Sequence[RigTest]) -> bool:
    """Whether the carcass holds against the contact patch to the end of every test."""
    with np.errstate(over="ignore", invalid="ignore"):
        forces = respond([(case, test) for test in tests])
    return all(bool(np.isfinite(force).all()) for force in forces)


def _direction(place: Ground, drawn: Drawn) -> NDArray:
    return place.gaps([drawn.at(0.3)], dict.fromkeys(drawn.at(1.0), drawn.place))
