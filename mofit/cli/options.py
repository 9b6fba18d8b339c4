"""Options that several commands share, and how ``NAME=VALUE`` is read."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from typing import Annotated, TypeVar

from cyclopts import Parameter

from mofit.errors import Issue, raise_errors
from mofit.identification.search_registry import search_help

T = TypeVar("T")

ModelName = Annotated[
    str | None,
    Parameter(help="Name of a shipped model, or path/to/file.py:Name. By default the channels decide."),
]
Effects = Annotated[
    tuple[str, ...],
    Parameter(help="Effect to add to the model: a shipped name, or path/to/file.py:Name; repeatable."),
]
Tests = Annotated[tuple[str, ...], Parameter(help="Use only the test of this name; repeatable.")]
Bounds = Annotated[
    tuple[str, ...],
    Parameter(help="Bounds of a parameter in place of the model's, NAME=LOWER:UPPER in SI units; repeatable."),
]
Fixed = Annotated[tuple[str, ...], Parameter(help="Fix a parameter, NAME=VALUE in SI units; repeatable.")]
Joint = Annotated[bool, Parameter(help="Estimate calibration and dynamic parameters at once.")]
Search = Annotated[str, Parameter(help=search_help())]
Seed = Annotated[int, Parameter(help="Seed of every random draw.")]
Json = Annotated[bool, Parameter(name="--json", help="Print one JSON object on standard output.")]
Jobs = Annotated[int | None, Parameter(help="Threads; results do not depend on it. By default all cores.")]


def cores(jobs: int | None) -> int:
    """The threads or processes asked for; by default one per core."""
    return jobs or os.cpu_count() or 1


def by_name(option: str, entries: Iterable[str]) -> dict[str, float]:
    """``["a=1", "b=2"]`` to ``{"a": 1.0, "b": 2.0}``.

    Raises
    ------
    InputError
        With every entry that is not NAME=NUMBER.
    """
    return _named(option, entries, float, "NUMBER", "1.5")


def range_by_name(option: str, entries: Iterable[str]) -> dict[str, tuple[float, float]]:
    """``["a=1:2"]`` to ``{"a": (1.0, 2.0)}``.

    Raises
    ------
    InputError
        With every entry that is not NAME=LOWER:UPPER.
    """

    def bounds(text: str) -> tuple[float, float]:
        lower, _, upper = text.partition(":")
        return float(lower), float(upper)

    return _named(option, entries, bounds, "LOWER:UPPER", "1:2")


def tests_by_name(option: str, entries: Iterable[str]) -> dict[str, tuple[str, ...]]:
    """``["low=a,b"]`` to ``{"low": ("a", "b")}``.

    Raises
    ------
    InputError
        With every entry that is not NAME=TEST,TEST, and names used twice.
    """
    entries = list(entries)

    def tests(text: str) -> tuple[str, ...]:
        found = tuple(test.strip() for test in text.split(",") if test.strip())
        if not found:
            raise ValueError
        return found

    names = [entry.partition("=")[0].strip() for entry in entries]
    raise_errors(
        Issue(f"{option} {name}=…", "the name is used twice", "Rename one of them")
        for name in dict.fromkeys(names)
        if names.count(name) > 1
    )
    return _named(option, entries, tests, "TEST,TEST", "sine_a,sine_b")


def _named(option: str, entries: Iterable[str], read: Callable[[str], T], form: str, example: str) -> dict[str, T]:
    found: dict[str, T] = {}
    issues = []
    for entry in entries:
        name, _, text = entry.partition("=")
        try:
            value = read(text)
        except ValueError:
            value = None
        if value is not None and name.strip():
            found[name.strip()] = value
        else:
            issues.append(Issue(f"{option} {entry}", f"is not NAME={form}", f"Write {option} name={example}"))
    raise_errors(issues)
    return found
