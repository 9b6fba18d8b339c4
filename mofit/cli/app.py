"""What all commands share: the application, exit codes, options, how ``NAME=VALUE`` is read, how they print."""

from __future__ import annotations

import json
import os
import re
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Annotated, Any, TypeVar

from cyclopts import App, Parameter

from mofit import __version__
from mofit.errors import InputError, Issue, raise_errors
from mofit.identification.search_registry import search_help

T = TypeVar("T")

DONE, UNEXPECTED, UNUSABLE, NOT_CONVERGED, NOT_IDENTIFIABLE = 0, 1, 2, 3, 4
INTERRUPTED = 130


def _shown(default: Any) -> str | None:
    """A default worth showing in the help: not a flag that is off, nor what is left out."""
    return None if default is None or default is False or default == () else str(default)


app = App(
    name="mofit",
    version=__version__,
    help="Identify dynamic models from test-bench data, with every plausible solution and calibrated uncertainty.",
    suppress_keyboard_interrupt=False,
    default_parameter=Parameter(negative="", show_default=_shown),
)

ModelName = Annotated[
    str | None,
    Parameter(
        help="Name of a shipped model, path/to/file.py:Name, or path/to/model.fmu. By default the channels decide."
    ),
]
MapFile = Annotated[
    Path | None,
    Parameter(name="--map", help="TOML file that maps the variables of an FMU to channels, conditions, parameters."),
]
Free = Annotated[
    tuple[str, ...],
    Parameter(help="Parameters of an FMU to identify, as k,d; the others keep their values. By default all."),
]
Effects = Annotated[
    tuple[str, ...],
    Parameter(
        help="Effect to add to the model: a shipped name, path/to/file.py:Name, or start:STATE, which lets a state "
        "start at a value of its own in every test; repeatable."
    ),
]
Tests = Annotated[tuple[str, ...], Parameter(help="Use only the test of this name; repeatable.")]
Bounds = Annotated[
    tuple[str, ...],
    Parameter(help="Bounds of a parameter in place of the model's, NAME=LOWER:UPPER in SI units; repeatable."),
]
Fixed = Annotated[tuple[str, ...], Parameter(help="Fix a parameter, NAME=VALUE in SI units; repeatable.")]
Joint = Annotated[bool, Parameter(help="Estimate calibration and dynamic parameters at once.")]
Force = Annotated[bool, Parameter(help="Replace an output of an earlier call; never another file.")]
Search = Annotated[
    str | None, Parameter(help=f"{search_help()} By default effa, and surrogate for a simulator of your own.")
]
Simulations = Annotated[
    int | None,
    Parameter(help="Most simulations of a simulator of your own, one record each. By default 2000."),
]
Evaluations = Annotated[
    int | None, Parameter(help="Budget of the global search in evaluations. By default the search's own.")
]
Over = Annotated[
    tuple[str, ...],
    Parameter(help="Conditions over which parameters follow laws, as vertical_force,inflation_pressure; repeatable."),
]
Laws = Annotated[
    tuple[str, ...],
    Parameter(
        help="Law of a parameter over the conditions of --over, PARAMETER=LAW, or over one, PARAMETER@CONDITION=LAW: "
        "constant, shared, linear, quadratic, exponential, power, arrhenius, wlf, free; of several by commas the "
        "evidence chooses, by default of constant, linear, quadratic and free. PARAMETER others: all not said; "
        "repeatable."
    ),
]
SetPoints = Annotated[
    tuple[str, ...],
    Parameter(
        help="CONDITION=NUMBER: neighbouring values of a condition of --over that differ by no more, in SI units, are "
        "one set point; 0 keeps all apart. By default those that span a tenth of the distance to the next; repeatable."
    ),
]
Seed = Annotated[int, Parameter(help="Seed of every random draw.")]
Json = Annotated[bool, Parameter(name="--json", help="Print one JSON object on standard output.")]
Jobs = Annotated[int | None, Parameter(help="Threads; results do not depend on it. By default one per core.")]
Timeout = Annotated[
    str | None, Parameter(help="Time that one simulation of a simulator of your own may take. By default 60 s.")
]
Dask = Annotated[
    str | None,
    Parameter(
        help="Address of a Dask scheduler, tcp://host:port, on whose workers a simulator of your own runs, "
        "and with --over every combination of the conditions."
    ),
]
TimeLimit = Annotated[
    str | None, Parameter(help="Time after which the command ends with what there is, as in 60s or 5min; exit code 3.")
]
FinishedRun = Annotated[Path, Parameter(help="Folder of a finished run.")]


def cores(jobs: int | None) -> int:
    """The threads or processes asked for; by default one per core."""
    if jobs is not None and jobs < 1:
        raise InputError.of(f"--jobs {jobs}", "cannot be used", "Give at least 1, or leave it out: one per core")
    return jobs or os.cpu_count() or 1


def seconds(option: str, text: str | None) -> float | None:
    """``"60s"``, ``"5 min"`` or ``"60"`` in s; None stays None; an `InputError` if it is no time."""
    from mofit.units import parse_quantity  # late: NumPy comes with it, see `mofit.cli.main`

    if text is None:
        return None
    number, unit = re.fullmatch(r"\s*([-+.\d]*(?:[eE][-+]?\d+)?)\s*(.*?)\s*", text, re.DOTALL).groups()  # type: ignore[union-attr]
    return parse_quantity(option, f"{number} {unit or 's'}", "s")[0]


def by_name(option: str, entries: Iterable[str]) -> dict[str, float]:
    """``["a=1", "b=2"]`` to ``{"a": 1.0, "b": 2.0}``; an `InputError` has every entry that is not NAME=NUMBER."""
    return _named(option, entries, float, "NUMBER", "1.5")


def range_by_name(option: str, entries: Iterable[str]) -> dict[str, tuple[float, float]]:
    """``["a=1:2"]`` to ``{"a": (1.0, 2.0)}``; an `InputError` has every entry that is not NAME=LOWER:UPPER."""

    def bounds(text: str) -> tuple[float, float]:
        lower, _, upper = text.partition(":")
        return float(lower), float(upper)

    return _named(option, entries, bounds, "LOWER:UPPER", "1:2")


def text_by_name(option: str, entries: Iterable[str]) -> dict[str, str]:
    """``["a=b"]`` to ``{"a": "b"}``; an `InputError` has every entry that is not NAME=NAME."""

    def name(text: str) -> str:
        if not text.strip():
            raise ValueError
        return text.strip()

    return _named(option, entries, name, "NAME", "vertical_force")


def names(entries: Iterable[str]) -> tuple[str, ...]:
    """``["a,b", "c"]`` to ``("a", "b", "c")``."""
    return tuple(name.strip() for entry in entries for name in entry.split(",") if name.strip())


def tests_by_name(option: str, entries: Iterable[str]) -> dict[str, tuple[str, ...]]:
    """``["low=a,b"]`` to ``{"low": ("a", "b")}``; an `InputError` has every entry that is not NAME=TEST,TEST."""

    def tests(text: str) -> tuple[str, ...]:
        found = tuple(test.strip() for test in text.split(",") if test.strip())
        if not found:
            raise ValueError
        return found

    return _named(option, entries, tests, "TEST,TEST", "sine_a,sine_b")


def _named(option: str, entries: Iterable[str], read: Callable[[str], T], form: str, example: str) -> dict[str, T]:
    found: dict[str, T] = {}
    issues = []
    for entry in entries:
        name, _, text = entry.partition("=")
        name = name.strip()
        try:
            value = read(text) if name else None
        except ValueError:
            value = None
        if value is None:
            issues.append(Issue(f"{option} {entry}", f"is not NAME={form}", f"Write {option} name={example}"))
        elif name in found:
            issues.append(Issue(f"{option} {name}=…", "the name is used twice", "Give it once"))
        else:
            found[name] = value
    raise_errors(issues)
    return found


def say(text: str) -> None:
    """To standard error."""
    print(text, file=sys.stderr)


def print_json(data: Any) -> None:
    """One object on standard output."""
    print(json.dumps(data, allow_nan=False))
