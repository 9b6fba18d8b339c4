"""The uncertainty of a run as one JSON object: what ``mofit uncertainty --json`` prints."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import xarray as xr

from mofit.errors import Fault, did_you_mean, raise_errors
from mofit.report.per_frequency import extract_per_test
from mofit.report.run import Run
from mofit.report.uncertainty.heterogeneity import extract_homogeneity
from mofit.report.uncertainty.table import Line, extract_lines

UNIDENTIFIABLE = "not identifiable"
"""Verdict of a parameter of which the data say nothing."""


def spread_table(tree: xr.DataTree, asked: Sequence[str] = ()) -> dict[str, Any]:
    """Every parameter's spread, solution by solution; numbers that are not finite become None.

    Parameters
    ----------
    tree
        A ``mofit.result/1`` tree.
    asked
        Parameters for which it is asked whether the data identify them.

    Returns
    -------
    dict
        ``converged``; ``modes``, best first, with ``id``, ``weight`` and ``parameters`` by name; ``heterogeneity`` by
        name; ``not_identifiable``, those of `asked` that a plausible solution leaves unidentified.

    Raises
    ------
    InputError
        If one of `asked` is no free parameter of the run.
    """
    run = Run(tree)
    known = run.clusters[0].parameters
    raise_errors(
        Fault(f"--parameter {name}", "the run has no free parameter of this name", did_you_mean(name, known))
        for name in asked
        if name not in known
    )
    lost = {n for c in run.plausible for n, v in zip(c.parameters, c.verdicts, strict=True) if v == UNIDENTIFIABLE}
    return {
        "converged": run.converged,
        "modes": [
            {
                "id": cluster.name,
                "weight": _number(cluster.weight),
                "parameters": {line.estimate.parameter: _entry(line) for line in extract_lines(run, cluster)},
            }
            for cluster in run.clusters
        ],
        "heterogeneity": _heterogeneity(run),
        "not_identifiable": [name for name in dict.fromkeys(asked) if name in lost],
    }


def _entry(line: Line) -> dict[str, Any]:
    e = line.estimate
    return {
        **{name: _number(getattr(e, name)) for name in ("value", "mean", "sd", "q05", "q95", "contraction")},
        "noise_sd": _number(line.noise_sd),
        "unit": e.unit,
        "at_bound": e.at_bound,
        "verdict": e.verdict,
        "sentence": line.plain,
    }


def _heterogeneity(run: Run) -> dict[str, Any]:
    found = extract_per_test(run)
    if found is None:
        return {}
    return {
        r.parameter: {
            "tests": len(r.used),
            "q": _number(r.q),
            "p": _number(r.p),
            "i_squared": _number(r.i_squared),
            "agree": r.agree,
        }
        for r in extract_homogeneity(run, found)
    }


def _number(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None
