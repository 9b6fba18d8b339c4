"""Shipped benchmarks, found by name and imported when asked for."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from mofit.errors import InputError, did_you_mean

BENCHMARKS = ("kernel",)


def run_benchmark(name: str) -> dict[str, Any]:
    """Run a benchmark: ``{"rows": one per competitor, "settings": what it was run with}``.

    Raises
    ------
    InputError
        If there is none of that name; names the closest one.
    """
    if name not in BENCHMARKS:
        raise InputError.of(f"bench {name}", "unknown benchmark", did_you_mean(name, BENCHMARKS))
    rows, settings = import_module(f"mofit.bench.{name}").run()
    return {"rows": rows, "settings": settings}
