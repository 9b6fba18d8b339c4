"""What was said about a system, and what was true."""

from __future__ import annotations

import math
from typing import Any

from systems.design import VISIBLE, System

#: Exit codes of a result: done, done but not to be trusted, done but not identifiable.
RESULT_CODES = (0, 3, 4)
#: Half-widths of a 90 % and a 99.9 % interval of a normal distribution, in standard deviations.
NINETY, FAR = 1.645, 3.29
#: Probability of a mode below which it is none.
PLAUSIBLE = 0.05


def said(answer: dict[str, Any] | None, code: int | None) -> dict[str, Any]:
    """What mofit said; the only place that reads fields of its JSON.

    Parameters
    ----------
    answer
        The JSON object; None where there was none.
    code
        Exit code; None where the time was up.
    """
    answer = answer or {}
    warnings = answer.get("warnings") or []
    modes = [
        {
            "probability": mode.get("probability"),
            "parameters": {
                name: {key: entry.get(key) for key in ("value", "q05", "q50", "q95", "sd", "verdict")}
                for name, entry in mode.get("parameters", {}).items()
            },
        }
        for mode in answer.get("modes", [])
    ]
    return {"green": bool(answer.get("green")) and code == 0, "warnings": warnings, "modes": modes}


def judged(system: System, answer: dict[str, Any] | None, code: int | None) -> dict[str, Any]:
    """Parameters by what was said and what was true, and whether a green banner was wrong."""
    told = said(answer, code)
    modes = [mode for mode in told["modes"] if (mode["probability"] or 0) >= PLAUSIBLE] or told["modes"]
    tied, entries = system.tied, {}
    for name, truth in system.truth.items():
        log = name not in system.draw.boxes
        found = [mode["parameters"][name] for mode in modes if name in mode["parameters"]]
        away = [departure(entry, truth, log) for entry in found]
        known = [value for value in away if value is not None]
        low, high = system.boxes[name]
        entries[name] = {
            "truth": truth,
            "value": [entry["value"] for entry in found],
            "verdict": [entry["verdict"] for entry in found],
            "away": min(known) if known else None,
            "undetermined": name in tied,
            "outside": not low <= truth <= high,
        }
    sure = {name: entry for name, entry in entries.items() if "identified" in entry["verdict"]}
    false = [name for name, entry in sure.items() if entry["undetermined"] or far(entry["away"])]
    lacking = system.case.kind == "wrong" and system.misfit >= VISIBLE
    if system.case.kind == "wrong" and not lacking:  # nobody can see it, and the parameters are what they amount to
        false = []
    return {
        "green": told["green"],
        "warnings": told["warnings"],
        "modes": len(told["modes"]),
        "parameters": entries,
        "false": false,
        "green_but_wrong": told["green"] and bool(false or lacking),
    }


def departure(entry: dict[str, Any], truth: float, log: bool) -> float | None:
    """Distance of the truth from the median, in standard deviations of its side of the posterior.

    The side's standard deviation comes from the 90 % interval, on a logarithmic axis for a scale parameter. Without
    an interval there is none.
    """
    points = [entry[key] for key in ("q05", "q50", "q95")]
    if any(point is None for point in points):
        return None
    if log and min(points) > 0:
        truth, points = math.log(truth), [math.log(point) for point in points]
    low, middle, high = points
    side = (high - middle if truth > middle else middle - low) / NINETY
    return abs(truth - middle) / max(side, 1e-300)


def far(away: float | None) -> bool:
    """Whether the truth is outside of the 99.9 % interval."""
    return away is not None and away > FAR


def coverage(rows: list[dict[str, Any]]) -> tuple[int, int]:
    """How many 90 % intervals hold the truth, of how many, where model and box are right and the data tell."""
    held = [
        entry["away"] <= NINETY
        for row in rows
        if row["kind"] == "right" and not row["narrow"]
        for entry in row["parameters"].values()
        if entry["away"] is not None and not entry["undetermined"]
    ]
    return sum(held), len(held)
