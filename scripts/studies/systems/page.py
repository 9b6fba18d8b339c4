"""The page: a summary first, then what was said and what was true of every system."""

from __future__ import annotations

from typing import Any

from report_page import header, made_with, table
from systems.judge import NINETY, coverage, far
from systems.running import LIMIT

COLUMNS = (
    "system",
    "model",
    "misfit / noise",
    "s",
    "s of processor",
    "exit code",
    "said: identified",
    "said: other verdict",
    "warnings",
    "true: not determined",
    "true: outside 99.9 %",
    "90 % hold",
    "green",
    "verdict on it",
)


def page(rows: list[dict[str, Any]], command: str, doc: str | None) -> list[str]:
    """The page as Markdown lines."""
    ended = sum(row["ended"] and row["cpu_seconds"] <= LIMIT for row in rows)
    wrong, green = sum(row["green_but_wrong"] for row in rows), sum(row["green"] for row in rows)
    (held, counted), sound = coverage(rows), [row for row in rows if row["kind"] == "right" and not row["narrow"]]
    share = f"{100 * held / counted:.0f} % ({held} of {counted})" if counted else "not counted"
    first = (
        f"**{ended} of {len(rows)} runs ended within {LIMIT:g} s with a result. {green} were green, {wrong} of them "
        f"wrongly. The 90 % intervals hold {share} of the true values where model and box are right.**"
    )
    trusted = sum(row["green"] and not row["green_but_wrong"] for row in sound)
    second = f"Of {len(sound)} systems with the right model and box, {trusted} were green and right."
    lines = header("Sixty systems", doc, command)
    return [lines[0], "", first, "", second, "", *lines[2:], *table(COLUMNS, map(cells, rows)), made_with()]


def cells(row: dict[str, Any]) -> list[str]:
    """One line of the table."""
    entries = row["parameters"]
    sure = [name for name, entry in entries.items() if "identified" in entry["verdict"]]
    others = [
        f"{name}: {entry['verdict'][0]}" for name, entry in entries.items() if entry["verdict"] and name not in sure
    ]
    outside = [name for name, entry in entries.items() if far(entry["away"])]
    held = [entry["away"] <= NINETY for entry in entries.values() if entry["away"] is not None]
    beyond = [name for name, entry in entries.items() if entry["outside"]]
    about = row["label"] or "right"
    if beyond:
        about += f"; box without {', '.join(beyond)}"
    warned = str(len(row["warnings"])) if row["warnings"] else ""
    return [
        f"{row['name'][:2]} {row['title']}",
        about,
        f"{row['misfit']:.1f}" if row["kind"] == "wrong" else "",
        f"{row['seconds']:.0f}",
        f"{row['cpu_seconds']:.0f}",
        "time is up" if row["code"] is None else str(row["code"]),
        ", ".join(sure),
        ", ".join(others),
        warned,
        ", ".join(name for name, entry in entries.items() if entry["undetermined"]),
        ", ".join(outside),
        f"{sum(held)} of {len(held)}" if held else "",
        "yes" if row["green"] else "no",
        verdict(row),
    ]


def verdict(row: dict[str, Any]) -> str:
    """A word or two on what was said."""
    if not row["ended"]:
        return "no result"
    if row["green_but_wrong"]:
        return f"**green, wrong**{': ' if row['false'] else ''}{', '.join(row['false'])}"
    return "right" if row["green"] or row["kind"] != "right" or row["narrow"] else "not green, though right"
