"""The page: the figures that were asked for beside what came out, then by rig, excitation, noise, family and case."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from scipy.stats import beta

from other_rigs_cases.cases import ALL, CASES, NOISES
from other_rigs_cases.excitation import KINDS as EXCITATIONS
from other_rigs_cases.score import KINDS
from report_page import header, made_with, table

Rows = Sequence[dict[str, Any]]
COLUMNS = ("", "right", "of", "share", "95 % interval")
#: name of the share that a proposed term removes
SHARE = "shrinkage.removed"


def page(rows: Rows, wanted: int, command: str, doc: str | None) -> str:
    """The page as Markdown, of the rows that there are of those wanted."""
    seen = [row for row in rows if row["visible"]]
    lines = header("Rigs of other kinds", doc, command)
    hidden = len(rows) - len(seen)
    lines += [f"{len(rows)} of {wanted} campaigns so far." if len(rows) < wanted else f"{wanted} campaigns."]
    lines[-1] += f" {hidden} of them, whose effect does not stand out, are not counted." if hidden else ""
    lines += [""]
    kinds = {
        kind: [row for row in seen if row["kind"] == kind]
        for kind in ("none", "library", "own law", "stranger", "no encoder")
    }
    lines += ["## Summary", "", *_summary(seen, kinds)]
    lines += ["## By rig, excitation and noise", "", *_by_place(kinds)]
    lines += ["## By case", "", *_by_case(seen)]
    lines += [
        "## Shrinkage: told and measured",
        "",
        *_shrinkage([row for row in seen if row["kind"] != "no encoder"]),
        *_proposed(kinds["stranger"]),
    ]
    lines += ["## What went wrong", "", *_wrong(seen), made_with()]
    return "\n".join(lines).rstrip() + "\n"


def _summary(seen: Rows, kinds: dict[str, list[dict[str, Any]]]) -> list[str]:
    coloured = [row for row in seen if row["noise"] != "white" or row["excitation"] in ("chirp", "free")]
    bare = [row for row in coloured if row["kind"] == "none"]
    named = [row for row in coloured if row["kind"] in ("library", "own law", "no encoder")]
    body = [
        ("(a) false alarms", "at most 1 %", *count(kinds["none"], "quiet", wrong=True)),
        ("(a) effects of the catalogue named first", "at least 98 %", *count(kinds["library"], "first")),
        ("… their family named", "", *count(kinds["library"], "family")),
        ("(a) strangers unknown", "at least 95 %", *count(kinds["stranger"], "unknown")),
        ("… unknown, or the family that it is akin to", "", *count(kinds["stranger"], "akin")),
        ("… unknown or partly", "", *count(kinds["stranger"], "refused")),
        ("(b) laws of their own: family named", "at least 95 %", *count(kinds["own law"], "family")),
        ("(c) false alarms, coloured noise, chirps or road", "at most 1 %", *count(bare, "quiet", wrong=True)),
        ("(c) families there", "at least 95 %", *count(named, "family")),
        ("(d) orders without encoder named", "at least 98 %", *count(kinds["no encoder"], "named")),
        ("… named first", "", *count(kinds["no encoder"], "first")),
    ]  # fmt: skip
    seconds = np.array([row["seconds"] for row in seen])
    lines = table(("", "asked", "found", "of", "share", "95 % interval"), body)
    if len(seconds):
        median, most, longest = np.quantile(seconds, [0.5, 0.9, 1.0])
        lines += [f"Seconds of processor time: median {median:.1f}, 90 % {most:.1f}, longest {longest:.1f}.", ""]
    return lines


def count(rows: Rows, what: str, wrong: bool = False) -> tuple[Any, ...]:
    """Number, total, share and its Clopper–Pearson interval of rows that are right, or wrong."""
    n = len(rows)
    k = sum(row["right"][what] != wrong for row in rows)
    if not n:
        return 0, 0, "–", "–"
    low = beta.ppf(0.025, k, n - k + 1) if k else 0.0
    high = beta.ppf(0.975, k + 1, n - k) if k < n else 1.0
    return k, n, f"{100 * k / n:.1f} %", f"{100 * low:.1f} to {100 * high:.1f} %"


def _by_place(kinds: dict[str, list[dict[str, Any]]]) -> list[str]:
    asked = (
        ("none", "quiet"),
        ("library", "first"),
        ("library", "family"),
        ("own law", "family"),
        ("stranger", "refused"),
    )
    body = []
    places = (("rig", ALL), ("excitation", EXCITATIONS), ("noise", NOISES), ("begins", ("at rest", "settled")))
    for key, values in places:
        for value in values:
            cells = [count([r for r in kinds[kind] if r[key] == value], what)[:2] for kind, what in asked]
            body.append((value, *(f"{k} of {n}" for k, n in cells)))
    names = ("", "no effect: none", "catalogue: first", "catalogue: family", "own law: family", "stranger: refused")
    return table(names, body)


def _by_case(seen: Rows) -> list[str]:
    body = []
    for case in CASES:
        own = [row for row in seen if (row["case"], row["kind"]) == (case.name, case.kind)]
        if own:
            verdicts = ", ".join(
                f"{verdict} {k}" for verdict, k in Counter(row["verdict"] for row in own).most_common()
            )
            right = {"none": "quiet", "stranger": "refused"}.get(case.kind, "family")
            body.append((case.name, case.kind, case.family, *count(own, right), verdicts))
    return table(("case", "kind", "family", *COLUMNS[1:], "verdicts"), body)


def _shrinkage(seen: Rows) -> list[str]:
    """How often an interval holds what was measured on records that no fit saw."""
    body = []
    for kind in KINDS:
        for told in dict.fromkeys(("headline", kind)):
            pairs = [
                (*row["intervals"][told], row["measured"][kind])
                for row in seen
                if kind in row["measured"] and told in row["intervals"]
            ]
            if pairs:
                low, high, measured = np.array(pairs).T
                held, above = (low <= measured) & (measured <= high), measured > high
                shares = [f"{100 * value:.0f} %" for value in (held.mean(), above.mean())]
                middle = f"{100 * np.median(measured):.1f} %"
                body.append((f"{kind} records, {told} interval", held.sum(), len(pairs), *shares, middle))
    asked = (
        "Asked: 85 to 95 % of the 90 % intervals hold the share that is measured, by kind of hold-out, (e). The "
        "headline is the interval of the most demanding kind at hand: of records held out, where there are any."
    )
    return [asked, "", *table(("measured on", "hold", "of", "share", "measured above", "median measured"), body)]


#: strangers that no function of inputs and states predicts: the one is drawn at random, the other remembers every other
#: period
OF_CHANCE = ("gain that walks", "subharmonic")


def _proposed(strangers: Rows) -> list[str]:
    known = [(row["case"] in OF_CHANCE, row["proposed"][SHARE]) for row in strangers if row["proposed"]]
    if not known:
        return ["(f) No term was proposed for a stranger.", ""]
    good, worse = sum(share >= 0.8 for _, share in known), sum(share < 0 for _, share in known)
    foretold = sum(share >= 0.8 for chance, share in known if not chance)
    of_chance = sum(row["case"] in OF_CHANCE for row in strangers)
    return [
        f"(f) Of {len(strangers)} strangers {len(known)} have a proposed term; on tests left out it removes at least "
        f"80 % of the gap in {good} (asked: 60 % of all) and makes {worse} worse (asked: none). {of_chance} of them "
        f"({' or '.join(OF_CHANCE)}) are no function of the rig's inputs and states, so that no term can predict them: "
        f"of the others it is {foretold} of {len(strangers) - of_chance}.",
        "",
    ]


def _wrong(seen: Rows) -> list[str]:
    right: dict[str, Callable[[dict[str, bool]], bool]] = {
        "none": lambda one: one["quiet"],
        "stranger": lambda one: one["refused"],
    }
    bad = [row for row in seen if not right.get(row["kind"], lambda one: one["family"])(row["right"])]
    body = [
        (
            row["name"], row["rig"], row["excitation"], row["noise"], f"{row['case']} ({row['kind']})",
            f"{row['gap_over_noise']:.1f}", row["verdict"], ", ".join(row["effects"]), row["seconds"],
            (row["sentence"] or row.get("message", "")).replace("|", "/"),
        )
        for row in bad
    ]  # fmt: skip
    return table(
        ("campaign", "rig", "excitation", "noise", "case", "gap / noise", "verdict", "named", "s", "said"), body
    )
