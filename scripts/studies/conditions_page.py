"""The page of the study of conditions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from conditions_cases import LAWS, PARAMETERS
from report_page import table

#: standard deviations of a 90 % interval
SIGMAS = 1.645
#: what is compared with the fits of the combinations alone
KINDS = {"sd": "standard deviation", "error": "error, root mean square"}


def page(
    rows: Sequence[dict[str, Any]],
    sampled: Sequence[dict[str, Any]],
    costs: dict[int, dict[str, Any]],
) -> list[str]:
    """The tables."""
    held = [abs(one) <= SIGMAS for row in rows for one in row["z"].values()]
    left = [one for row in rows for one in row["left"].values()]
    right = len(LAWS) * len(rows) - sum(len(row["wrong"]) for row in rows)
    squares = [row["chi_square"] for row in rows]
    alone = [
        abs(error) <= SIGMAS * sd
        for row in rows
        for own in row["beside"].values()
        for error, sd in zip(own["error alone"], own["sd alone"], strict=True)
    ]
    seconds = np.mean([sum(row["seconds"]) for row in rows])
    lines = [
        "## Laws recovered",
        "",
        *table(
            ("seeds", "laws as made", "intervals that hold the true coefficient", "seconds per seed"),
            [(len(rows), f"{right} of {len(LAWS) * len(rows)}", share(held), f"{seconds:.0f}")],
        ),
        "Wrong laws: " + ("; ".join(one for row in rows for one in row["wrong"]) or "none") + ".",
        "",
        "## The combination left out",
        "",
        *table(
            ("bands that hold the true parameter", "true output in its band", "measured samples in theirs"),
            [(share(left), *(mean_of([row["output"][key] for row in rows]) for key in ("true", "measured")))],
        ),
        "## Beside the fits of the combinations alone",
        "",
        f"Their own intervals hold the truth in {share(alone)}. That they scatter about the laws by more than their "
        f"errors is said of {sum(bool(row['said']) for row in rows)} of {len(rows)} seeds; chi square is "
        f"{np.sum(squares, axis=0)[0] / np.sum(squares, axis=0)[1]:.2f} per degree of freedom.",
        "",
        *table(
            ("by the laws, relative to alone", *PARAMETERS),
            [[what, *(f"{ratio(rows, name, key):.2f}" for name in PARAMETERS)] for key, what in KINDS.items()],
        ),
        *(sampling(rows, sampled) if sampled else []),
        "## Processor time over the number of loads",
        "",
        *table(
            ("loads", "each alone, s", "per load, s", "joint fit, s", "per load, s"),
            [[n, *(f"{c[key] / by:.2f}" for key in ("alone", "joint") for by in (1, n))] for n, c in costs.items()],
        ),
    ]  # fmt: skip
    return lines


def ratio(rows: Sequence[dict[str, Any]], name: str, key: str) -> float:
    """Root mean square of what the laws say of a parameter over seeds and combinations, relative to alone."""
    both = [[row["beside"][name][own] for row in rows if name in row["beside"]] for own in (key, f"{key} alone")]
    return float(np.sqrt(np.mean(np.square(both[0])) / np.mean(np.square(both[1]))))


def sampling(rows: Sequence[dict[str, Any]], sampled: Sequence[dict[str, Any]]) -> list[str]:
    """How far the samples are from the Laplace approximation of the same seeds."""
    found = []
    for seed, (own, other) in enumerate(zip(rows, sampled, strict=False)):
        shift = [abs(other["mean"][n] - own["mean"][n]) / own["sd"][n] for n in own["mean"]]
        sd = [other["sd"][n] / own["sd"][n] for n in own["mean"]]
        bands = [f"{100 * row['output'][key]:.1f} %" for key in ("true", "measured") for row in (own, other)]
        found.append((seed, f"{max(shift):.2f} sd", f"{min(sd):.2f} to {max(sd):.2f}", *bands))
    head = (
        "seed",
        "largest shift of a mean",
        "ratio of sd",
        "true output, Laplace",
        "sampled",
        "measured, Laplace",
        "sampled",
    )
    return ["## Sampled with emcee", "", *table(head, found)]


def mean_of(values: Sequence[float]) -> str:
    """A mean share with its standard error."""
    error = np.std(values, ddof=1) / np.sqrt(len(values)) if len(values) > 1 else np.nan
    return f"{100 * np.mean(values):.1f} ± {100 * error:.1f} %"


def share(flags: Sequence[bool]) -> str:
    """A share with its count."""
    return f"{sum(flags)} of {len(flags)} ({100 * sum(flags) / max(len(flags), 1):.0f} %)"
