"""The benchmarks: mofit beside other ways to do the same, all competitors in one run."""

from __future__ import annotations

from importlib import import_module
from inspect import signature
from pathlib import Path
from typing import Any

from mofit.errors import InputError, Issue, did_you_mean, raise_errors

#: Name to module and function: ``run(**options)`` returns rows and settings. Modules may have ``draw_figures(folder)``.
BENCHMARKS = {
    "kernel": "kernel.run",
    "rastrigin": "rastrigin.run",
    "cec2013": "cec2013.run",
    "front": "front.run",
    "sampling": "sampling.run",
    "pipeline": "pipeline.run",
    "small_pipeline": "small_pipeline.run",
    "withheld_effects": "withheld_effects.run",
    "withheld_effects_paper": "withheld_effects.run_paper",
    "withheld_speed": "withheld_speed.run",
    "withheld_speed_bundled": "withheld_speed.run_bundled",
}

#: The least value of an option.
LEAST = {"runs": 1, "seed": 0, "jobs": 1, "limit": 0, "peers": 0}


def run_benchmark(name: str, **options: float | None) -> dict[str, Any]:
    """Run a benchmark: ``{"rows": one per competitor, "settings": what it was run with}``.

    Parameters
    ----------
    name
        One of `BENCHMARKS`.
    options
        Of the benchmark's function: runs, seed, jobs, limit, peers; None takes its default.

    Raises
    ------
    InputError
        If there is none of that name (names the closest one), or if it does not take an option or its value.
    """
    if name not in BENCHMARKS:
        raise InputError.of(f"bench {name}", "unknown benchmark", did_you_mean(name, tuple(BENCHMARKS)))
    module, function = BENCHMARKS[name].split(".")
    run = getattr(import_module(f"benchmarks.{module}"), function)
    given = {option: value for option, value in options.items() if value is not None}
    known = signature(run).parameters
    raise_errors(
        Issue(f"bench {name}, option --{option}", "it does not take this option", "Leave it out")
        for option in given
        if option not in known
    )
    raise_errors(
        Issue(f"bench {name}, option --{option}", f"{value:g} cannot be used", f"Give at least {LEAST[option]}")
        for option, value in given.items()
        if not value >= LEAST[option]
    )
    rows, settings = run(**given)
    return {"rows": rows, "settings": settings}


def draw_figures(name: str, folder: Path) -> dict[str, str]:
    """Write the figures of a benchmark into a folder: file name to caption, {} without any."""
    draw = getattr(import_module(f"benchmarks.{BENCHMARKS[name].split('.')[0]}"), "draw_figures", None)
    if draw is None:
        return {}
    folder.mkdir(parents=True, exist_ok=True)
    pictures: dict[str, str] = draw(folder)
    return pictures
