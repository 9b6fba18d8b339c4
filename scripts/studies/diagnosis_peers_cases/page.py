"""The page: one table of all peers, then who said what of every campaign."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from diagnosis_peers_cases.peer import PEERS
from diagnosis_peers_cases.score import holds, proposed, right
from other_rigs_cases.score import KINDS
from report_page import header, made_with, table

#: of the run with the default settings
READING = (
    "Where peers are better: a Gaussian process corrects a static stranger that mofit refuses (amplifier knee, dead "
    "band), and needs no library; a term that mofit may propose is not counted here. Where they are not: a static "
    "process removes little in rigs with a resonance, and what is sparse in a training test may fail on another kind "
    "of record. None of them tells a drift, which needs the time of the campaign. The test of whiteness takes coloured "
    "noise for a gap; the linear test of independence misses what shows in harmonics only. LISDD, with what is chosen "
    "here, asks for a part of the operating range where the model is right: a cause that acts everywhere bends the "
    "parameters that it fits there."
)
Rows = Sequence[Mapping[str, Any]]
Row = Mapping[str, Mapping[str, Any]]
TITLES = {"mofit": "mofit diagnose", **{key: peer.title for key, peer in PEERS.items()}}
PLACES = {"mofit": "frequency, input, rate, time", **{key: peer.where for key, peer in PEERS.items()}}
CAUSES = {"mofit": "by families and laws", **{key: peer.cause for key, peer in PEERS.items()}}


def page(rows: Sequence[Row], measured: Row | None, wanted: int, command: str, doc: str | None) -> str:
    """The page as Markdown, of the campaigns that there are of those wanted, and of a measured one."""
    seen = [row for row in rows if row["mofit"]["visible"]]
    lines = header("Peers of the diagnosis", doc, command)
    lines += [f"{len(rows)} of {wanted} campaigns so far." if len(rows) < wanted else f"{wanted} campaigns."]
    lines[-1] += f" {len(rows) - len(seen)} of them, whose effect does not stand out, are not counted."
    missing = [peer.title for key, peer in PEERS.items() if not peer.installed]
    lines += [f"Not installed, so without a row: {', '.join(missing)}."] if missing else []
    own = {key: [row[key] for row in seen if key in row] for key in TITLES}
    own = {key: each for key, each in own.items() if each}
    lines += ["", "## Who says what", "", *_verdicts(own), "## Whose shrinkage holds, and time", "", *_shrinkage(own)]
    lines += [READING, ""]
    lines += ["## A measured friction damper with play", "", *_measured(measured)]
    lines += ["## By campaign", "", *_campaigns(seen), made_with("pysindy", "sysidentpy", "scikit-learn")]
    return "\n".join(lines).rstrip() + "\n"


def _verdicts(own: Mapping[str, Rows]) -> list[str]:
    columns = (
        "", "says where", "names a cause", "gap said without one", "gap seen", "catalogue: family first (at all)",
        "own law: family first (at all)", "strangers refused (nothing named)",
    )  # fmt: skip
    body = []
    for key, rows in own.items():
        kinds = {
            kind: [row for row in rows if row["kind"] == kind] for kind in ("none", "library", "own law", "stranger")
        }
        gaps = [row for row in rows if row["kind"] != "none"]
        names = [f"{_count(kinds[kind], 'first')} ({_number(kinds[kind], 'named')})" for kind in ("library", "own law")]
        refused = f"{_count(kinds['stranger'], 'refused')} ({_number(kinds['stranger'], 'nameless')})"
        if CAUSES[key] == "no":
            names, refused = ["–", "–"], "–"
        body.append(
            (TITLES[key], PLACES[key], CAUSES[key], _count(kinds["none"], "gap"), _count(gaps, "gap"), *names, refused)
        )
    return table(columns, body)


def _shrinkage(own: Mapping[str, Rows]) -> list[str]:
    """Of campaigns with a gap."""
    names = {"same": "same kind", "group": "larger", "other": "another kind"}
    columns = (
        "",
        *(f"median share removed, {names[kind]}" for kind in KINDS),
        "corrections proposed",
        "made worse",
        "told and held",
        "s, median (most)",
    )
    body = []
    for key, rows in own.items():
        if not (gaps := [row for row in rows if row["kind"] != "none"]):
            continue
        shares = [proposed(row) for row in gaps]
        medians = [_percent(float(np.median([one.get(kind, 0.0) for one in shares]))) for kind in KINDS]
        made = [one for one in shares if any(one.values())]
        worse = sum(share < 0 for one in made for share in one.values())
        held = [one for row in gaps for one in holds(row)]
        seconds = np.array([row["seconds"] for row in rows])
        told = f"{sum(held)} of {len(held)}" if held else "–"
        counts = (f"{len(made)} of {len(gaps)}", f"{worse} of {sum(len(one) for one in made)} kinds", told)
        if not made and CAUSES[key] == "no" and not any(row["share"] for row in rows):
            medians, counts = ["–"] * len(KINDS), ("–", "–", "–")
        body.append((TITLES[key], *medians, *counts, f"{np.median(seconds):.1f} ({seconds.max():.1f})"))
    return table(columns, body)


def _measured(rows: Row | None) -> list[str]:
    """What is said of sine strokes, and the share of the gap on an earthquake."""
    if rows is None:
        return ["Its data were not there.", ""]
    body = []
    for key, row in rows.items():
        told = "–" if row["share"] is None else _percent(row["share"])
        share = _percent(proposed(row)["other"]) if proposed(row).get("other") else "–"
        named = ", ".join(row["families"]) or "–"
        body.append((TITLES[key], row["verdict"], named, told, share, f"{row['seconds']:.1f}"))
    return table(("", "verdict", "named", "told", "share of the gap removed on the earthquake", "s"), body)


def _campaigns(seen: Sequence[Row]) -> list[str]:
    body = []
    for rows in seen:
        label = rows["mofit"]
        place = f"{label['rig']}, {label['excitation']}, {label['noise']}"
        body.append(
            (place, f"{label['case']} ({label['kind']})", *(_said(rows[key]) if key in rows else "" for key in TITLES))
        )
    return table(("campaign", "hidden", *TITLES.values()), body)


def _said(row: Mapping[str, Any]) -> str:
    names = row["families"] or row.get("where") or ""
    words = ", ".join(names) if isinstance(names, list) else names.replace("|", "\\|")
    shares = proposed(row)
    removed = (
        f"; {', '.join(_percent(shares[kind]) for kind in KINDS if kind in shares)}" if any(shares.values()) else ""
    )
    return f"{row['verdict']}{': ' * bool(words)}{words}{removed}"


def _number(rows: Rows, what: str) -> int:
    return sum(right(row)[what] for row in rows)


def _count(rows: Rows, what: str) -> str:
    return f"{_number(rows, what)} of {len(rows)}"


def _percent(share: float) -> str:
    return "below −1000 %" if share < -10 else f"{100 * share:.0f} %".replace("-", "−")
