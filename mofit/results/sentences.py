"""What is said of a result before its numbers: terminal and page say it in the same words and order."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

CONVERGED = "The sampling converged: independent ensembles agree{figures}."
NOT_CONVERGED = (
    "The sampling did not converge{figures}. Read the intervals below as preliminary: they may be too narrow or in the "
    "wrong place. Identify again with another --seed; if that does not converge either, --fix a parameter that is not "
    "identified, or narrow its --bounds."
)
NOT_SAMPLED = "Nothing was sampled: standard deviations are those of the Laplace approximation."
ALL_IDENTIFIED = "The data identify all {count} parameters."
NOT_IDENTIFIED = "The data do not identify {names}: read the interval, not the value{bounds}."
AT_BOUND = " ({names} at a bound of the prior box: widen the box, or check the model)"
UNKNOWN = "Nothing was sampled. Whether the data identify the parameters is not known."


def outcome_sentences(summary: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Whether the sampling converged and which parameters the data identify, each with a style for the terminal.

    Parameters
    ----------
    summary
        What ``mofit identify --json`` prints; see `mofit.results.summary`.
    """
    if not summary["modes"]:
        return []
    entries = summary["modes"][0]["parameters"]
    sampled = any(entry["spread"] != "Laplace" for entry in entries.values())
    at_bound = [name for name, entry in entries.items() if entry["at_bound"]]
    open_ones = [name for name, entry in entries.items() if _not_identified(entry)]
    if not sampled:
        first = NOT_SAMPLED, "bold red"
    elif summary["converged"]:
        first = CONVERGED.format(figures=""), ""
    else:
        first = NOT_CONVERGED.format(figures=""), "bold red"
    bounds = AT_BOUND.format(names=_listed(at_bound)) if at_bound else ""
    if open_ones:
        return [first, (NOT_IDENTIFIED.format(names=_listed(open_ones), bounds=bounds), "bold yellow")]
    return [first, (ALL_IDENTIFIED.format(count=len(entries)) if sampled else UNKNOWN, "")]


def _not_identified(entry: Mapping[str, Any]) -> bool:
    sampled = entry["verdict"] != "not sampled"
    return bool(entry["at_bound"]) or (sampled and not entry["verdict"].startswith("identified"))


def _listed(names: Sequence[str]) -> str:
    return " and ".join(filter(None, (", ".join(names[:-1]), names[-1])))
