"""Figures of a diagnosis from its results and the opened labels: plain counting."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm
from shares import mean, share, spread, upper_bound
from strength import ruled_out_probability

#: score T, or strength, from which an effect is strong, and from which it is there at all
STRONG, WEAK = 50.0, 16.0
#: what the whole library leaves of an unmodelled cause, or of an effect removed from it, so that it must be missed
CLEAR = 50.0
#: what the best other effect leaves of one (the best other pair of a pair), so that the tests distinguish it from all
DISTINGUISHABLE = 40.0
#: a competitor that is so many times less probable is not named beside an effect
RULED_OUT = 10.0

CASES = ("none", "effect", "variant", "unmodelled", "pair")
#: verdicts beside a single name
OTHERS = (
    "group with it", "group without", "several, all right", "several with it", "several without", "partly with it",
    "partly without", "unknown",
)  # fmt: skip


@dataclass(frozen=True)
class Pairing:
    """One campaign: its label, what the diagnosis reported, and the true shrinkage where it is known."""

    campaign: str
    label: Mapping[str, Any]
    result: Mapping[str, Any]
    actual: float | None = None

    @property
    def true(self) -> tuple[str, ...]:
        """Effects that ought to be named."""
        return tuple(cause["named"] for cause in self.label["causes"])

    @property
    def verdict(self) -> str:
        """What the diagnosis reported in one word."""
        return str(self.result["verdict"])

    @property
    def named(self) -> tuple[str, ...]:
        """Every effect that it names, in any of its candidate models; none where it names none with conviction."""
        if self.verdict in ("none", "unknown"):
            return ()
        parts = [effect["name"] for effect in self.result["effects"]]
        parts += list(self.result.get("group") or ())
        parts += [name for names in self.result.get("candidate_models") or () for name in names]
        return tuple(dict.fromkeys(parts))

    @property
    def right(self) -> bool:
        """Whether all true effects are among those named; where the law is said to miss, their families."""
        if set(self.true) <= set(self.named):
            return True
        of = {one["name"]: one.get("family") or one["name"] for one in self.result.get("candidates") or ()}
        families = {effect.get("family") for effect in self.result["effects"]}
        return self.verdict == "partly" and {of.get(name, name) for name in self.true} <= families

    @property
    def best(self) -> tuple[str, ...]:
        """Effects of its best candidate model; none where it names none with conviction."""
        return tuple(self.result["candidate_models"][0]) if self.named else ()

    @property
    def exact(self) -> bool:
        """Whether it reports just what is true."""
        return self.verdict in ("effect", "several") and set(self.named) == set(self.true)

    @property
    def first(self) -> bool:
        """Whether it names the true effect first."""
        return self.named[:1] == self.true

    @property
    def strength(self) -> float:
        """Of the cause, from the truth; the weaker beside the other for two."""
        return min(cause["strength_beside_others"] for cause in self.label["causes"])

    @property
    def score(self) -> float:
        """Statistic T of the true effect in the diagnosis' own score test at the model without effects."""
        tested = {one["name"]: one["statistic"] for one in self.result.get("candidates") or ()}
        return min(float(tested.get(name, 0.0)) for name in self.true)


def figures(
    pairings: Sequence[Pairing], after_next: Sequence[Sequence[Pairing]] = (), without: Sequence[Pairing] = ()
) -> dict[str, Any]:
    """All figures.

    Parameters
    ----------
    pairings
        The main run.
    after_next
        Per round: campaigns of which several candidate models were left, diagnosed again with the proposed test.
    without
        Campaigns diagnosed with the true effect removed from the candidates.
    """
    by_case = {case: [p for p in pairings if p.label["case"] == case] for case in CASES}
    effects = by_case["effect"]
    strong = [p for p in effects if p.score >= STRONG]
    weaker = [p for p in effects if WEAK <= p.score < STRONG]
    clear = [p for p in by_case["unmodelled"] if p.label["beyond_library"] >= CLEAR]
    missed = [p for p in without if removable(p)]
    alarms = [p.verdict != "none" for p in by_case["none"]]
    rounds = [{p.campaign: p for p in found} for found in (pairings, *after_next)]
    last = {campaign: p for found in rounds for campaign, p in found.items()}
    advised = [
        (p, after[c]) for before, after in pairwise(rounds) for c, p in before.items() if advises(p) and c in after
    ]
    claimed = [(before, after) for before, after in advised if claims(before)]
    return {
        "campaigns": {case: len(found) for case, found in by_case.items()},
        "none": {
            "false_alarms": share(alarms),
            "upper_95": upper_bound(sum(alarms), len(alarms)) if alarms else None,
            "by_noise": {
                noise: share(p.verdict != "none" for p in by_case["none"] if p.label["noise"] == noise)
                for noise in sorted({p.label["noise"] for p in by_case["none"]})
            },
        },
        "strong": {**_naming(strong), "set_size": mean([len(p.named) for p in strong if p.named])},
        "strong_with_next_test": _naming([last[p.campaign] for p in strong]),
        "next_tests_run": [sum(p.campaign in found for p in strong) for found in rounds[1:]],
        "strong_distinguishable": _naming([p for p in strong if _next_best(p) >= DISTINGUISHABLE]),
        "strong_first_at_best": mean([first_at_best(p) for p in strong]),
        "strong_alone_at_best": mean(
            [float(ruled_out_probability(np.array(_next_best(p)), RULED_OUT)) for p in strong]
        ),
        "weaker": _naming(weaker),
        "weakest": _naming([p for p in effects if p.score < WEAK]),
        "strong_in_truth": _naming([p for p in effects if p.strength >= STRONG]),
        "weaker_in_truth": _naming([p for p in effects if WEAK <= p.strength < STRONG]),
        "variants": _naming([p for p in by_case["variant"] if p.strength >= STRONG]),
        "unmodelled": {
            "reported_unknown": share(p.verdict == "unknown" for p in clear),
            "confidently_wrong": share(bool(p.named) for p in clear),
            "reported_partly": share(p.verdict == "partly" for p in clear),
            "reported_none": share(p.verdict == "none" for p in clear),
        },
        "pairs": _both(by_case["pair"]),
        "pairs_with_next_test": _both([last[p.campaign] for p in by_case["pair"]]),
        "pairs_distinguishable": _both([p for p in by_case["pair"] if p.label["next_pair"] >= DISTINGUISHABLE]),
        "without_the_true_one": {
            "removable": sum(removable(p) for p in effects),
            "reported_unknown": share(p.verdict == "unknown" for p in missed),
            "confidently_wrong": share(bool(p.named) for p in missed),
        },
        "shrinkage": _shrinkage([p for p in (*strong, *by_case["pair"]) if p.exact]),
        "size": _sizes([p for p in strong if p.exact]),
        "next_experiment": {
            "claimed": sum(claims(p) for found in rounds for p in found.values()),
            "resolved": share(after.exact for _, after in claimed),
            "discriminated": share(_discriminated(before, after) for before, after in claimed),
            "all": share(after.exact for _, after in advised),
            "all_expected": mean([float(before.result["next_experiment"].get("power", 0.0)) for before, _ in advised]),
        },
        "by_effect": {
            name: _naming([p for p in strong if p.true == (name,)]) for name in sorted({p.true[0] for p in strong})
        },
        "by_unmodelled": {
            name: share(p.verdict == "unknown" for p in clear if p.label["cause"] == name)
            for name in sorted({p.label["cause"] for p in clear})
        },
        "seconds": spread([p.result["seconds"] for p in pairings if p.result.get("seconds") is not None]),
    }


def confusion(pairings: Sequence[Pairing]) -> tuple[list[str], list[str], NDArray[np.int64]]:
    """Truth by row, report by column, counts.

    A column of its own for each effect that is named alone; groups and several are split by whether the truth is in.
    """
    rows = {p.campaign: _row(p) for p in pairings}
    columns = {p.campaign: _column(p) for p in pairings}
    in_library = {rows[p.campaign] for p in pairings if p.label["case"] == "effect"}
    down = [name for _, name in sorted({(CASES.index(p.label["case"]), rows[p.campaign]) for p in pairings})]
    across = ["none", *sorted((in_library | set(columns.values())) - {"none", *OTHERS}), *OTHERS]
    counts = np.zeros((len(down), len(across)), dtype=np.int64)
    for p in pairings:
        counts[down.index(rows[p.campaign]), across.index(columns[p.campaign])] += 1
    return down, across, counts


def _row(p: Pairing) -> str:
    return {"none": "no effect", "pair": "two effects"}.get(p.label["case"], p.label["cause"])


def _column(p: Pairing) -> str:
    inside = bool(p.true) and p.right
    if p.verdict == "group":
        return "group with it" if inside else "group without"
    if p.verdict == "partly":
        return "partly with it" if inside else "partly without"
    if p.verdict == "several":
        return "several, all right" if p.exact else "several with it" if inside else "several without"
    return p.named[0] if p.verdict == "effect" else p.verdict


def _naming(found: Sequence[Pairing]) -> dict[str, Any]:
    return {
        "exact": share(p.exact for p in found),
        "first": share(p.first for p in found),
        "in_set": share(p.right for p in found),
        "reported_partly": share(p.verdict == "partly" for p in found),
        "reported_none": share(p.verdict == "none" for p in found),
        "reported_unknown": share(p.verdict == "unknown" for p in found),
    }


def _both(found: Sequence[Pairing]) -> dict[str, Any]:
    return {
        "both_named": share(p.right for p in found),
        "precision": share(name in p.true for p in found for name in p.named),
        "both_first": share(set(p.true) == set(p.best) for p in found),
    }


def removable(p: Pairing) -> bool:
    """Whether an effect must be missed where it is no candidate: all others together cannot replace it."""
    return bool(p.label["beyond_others"] >= CLEAR)


def advises(p: Pairing) -> bool:
    """Whether a diagnosis that explains the gap proposes a test to discriminate between its candidate models."""
    return p.verdict != "unknown" and p.result.get("next_experiment") is not None


def claims(p: Pairing) -> bool:
    """Whether it promises that this test resolves the group."""
    return advises(p) and bool(p.result["next_experiment"]["resolves"])


def _discriminated(before: Pairing, after: Pairing) -> bool:
    """Whether of all that was named before the truth alone still is; what was not may be named beside it."""
    return set(after.true) <= set(after.named) and not set(before.named) & set(after.named) - set(after.true)


def first_at_best(p: Pairing) -> float:
    """Probability that the true effect fits better than its best competitor, if all but the effect is known.

    Of a gap a t in white noise, directions t and l take up (r t)^2 and (r l)^2; their difference is the product of
    r (t - l) and r (t + l), which are independent normals. The competitor leaves a^2 sin^2 of their angle.
    """
    strength = p.label["strength"]
    half = 0.5 * np.arcsin(np.sqrt(min(_next_best(p) / strength, 1.0)))
    means = np.sqrt(strength) * np.array([np.sin(half), np.cos(half)])
    return float(np.prod(norm.cdf(means)) + np.prod(norm.cdf(-means)))


def alone_at_best(p: Pairing) -> float:
    """Probability that the best competitor is ruled out, if all but the effect is known."""
    return float(ruled_out_probability(np.array(_next_best(p)), RULED_OUT))


def _next_best(p: Pairing) -> float:
    return min(value for name, value in p.label["separation"].items() if name not in p.true)


def _shrinkage(found: Sequence[Pairing]) -> dict[str, Any]:
    told = [(p.result["shrinkage"], p.actual) for p in found if p.result.get("shrinkage") and p.actual is not None]
    # the truth is known on tests left out in turn
    reported = [
        (kind | {"predicted": shrinkage["predicted"]}, actual)
        for shrinkage, actual in told
        for kind in shrinkage["kinds"]
        if kind["kind"] == "test"
    ]
    said, actual = [one for one, _ in reported], [one for _, one in reported]
    return {
        "predicted_off": spread([abs(s["predicted"] - a) for s, a in zip(said, actual, strict=True)]),
        "refitted_off": spread([abs(s["share"] - a) for s, a in zip(said, actual, strict=True)]),
        "covered": share(s["low"] <= a <= s["high"] for s, a in zip(said, actual, strict=True)),
        "not_reported": len(found) - len(reported),
    }


def _sizes(found: Sequence[Pairing]) -> dict[str, Any]:
    errors: dict[str, list[float]] = {}
    covered = []
    for p in found:
        cause, said = p.label["causes"][0], p.result["effects"][0]
        truth, reported = _parts(cause, said)
        errors.setdefault(cause["name"], []).append(float(np.linalg.norm(reported - truth) / np.linalg.norm(truth)))
        if len(truth) == 1 and said.get("size_low") is not None:
            covered.append(said["size_low"] <= truth[0] <= said["size_high"])
    return {
        "error": spread([e for group in errors.values() for e in group]),
        "covered": share(covered),
        "by_effect": {name: spread(group) for name, group in sorted(errors.items())},
    }


def _parts(cause: Mapping[str, Any], said: Mapping[str, Any]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """True and reported size: by parameter where there are several."""
    several = [name for name in cause["knobs"] if name[:-1] in ("A_w", "m_d")]
    reported = said.get("parameters") or {}
    if several and set(several) <= set(reported):
        return np.array([cause["knobs"][n] for n in several]), np.array([reported[n] for n in several])
    return np.array([cause["size"]]), np.array([said["size"]])
