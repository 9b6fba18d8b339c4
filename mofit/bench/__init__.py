"""Shipped benchmarks, found by name and imported when asked for."""

from __future__ import annotations

from importlib import import_module
from inspect import signature
from pathlib import Path
from typing import Any

from mofit.errors import Fault, InputError, did_you_mean, raise_errors

BENCHMARKS = (
    "kernel",
    "rastrigin",
    "cec2013",
    "front",
    "sampling",
    "pipeline",
    "withheld-effects",
    "withheld-effects-paper",
)
#: Those with figures, drawn by ``<name>_figures``.
ILLUSTRATED = ("rastrigin",)


def run_benchmark(name: str, **options: float | None) -> dict[str, Any]:
    """Run a benchmark: ``{"rows": one per competitor, "settings": what it was run with}``.

    Parameters
    ----------
    name
        One of `BENCHMARKS`.
    options
        Of the benchmark's ``run``: runs, seed, jobs, limit; None takes its default.

    Raises
    ------
    InputError
        If there is none of that name (names the closest one), or if it does not take an option.
    """
    if name not in BENCHMARKS:
        raise InputError.of(f"bench {name}", "unknown benchmark", did_you_mean(name, BENCHMARKS))
    run = import_module(f"mofit.bench.{name.replace('-', '_')}").run
    given = {option: value for option, value in options.items() if value is not None}
    known = signature(run).parameters
    raise_errors(
        Fault(f"bench {name}, option --{option}", "it does not take this option", "Leave it out")
        for option in given
        if option not in known
    )
    rows, settings = run(**given)
    return {"rows": rows, "settings": settings}


def draw_figures(name: str, folder: Path) -> dict[str, str]:
    """Write the figures of a benchmark into a folder, made if it isn't there: file name to caption, {} without any."""
    if name not in ILLUSTRATED:
        return {}
    folder.mkdir(parents=True, exist_ok=True)
    pictures: dict[str, str] = import_module(f"mofit.bench.{name}_figures").draw_figures(folder)
    return pictures
