"""Commands as tools for programs: which options each has, their JSON Schema, and the command line of a call."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import NoneType
from typing import Any, get_args, get_origin

from cyclopts import Argument

from mofit.cli.app import app

#: The arguments of a command that its tool has, named as the options are. The rarer ones stay with the command line.
TOOLS: Mapping[str, tuple[str, ...]] = {
    "check": ("file",),
    "import": ("sources", "map", "guess", "out", "force"),
    "identify": tuple(
        "files all_freqs freq test hold_out model map effect search bounds fix per_test joint seed out no_sample "
        "time_limit".split()
    ),
    "diagnose": tuple("files model map effects test hold_out bounds fix per_test seed out time_limit".split()),
    "design": tuple(
        "files space model effect parameter criterion discriminate budget run samples plan out force seed "
        "time_limit".split()
    ),
    "predict": ("run", "file", "test", "model", "map", "effect", "out"),
}
_TYPES = {Path: "string", str: "string", bool: "boolean", int: "integer", float: "number"}


def description(tool: str) -> str:
    """What the command does, as its help says it."""
    return " ".join(app[tool].help.partition("Example:")[0].split())


def input_schema(tool: str) -> dict[str, Any]:
    """The JSON Schema of a tool's arguments: types, defaults and texts are those of the command."""
    found = _arguments(tool)
    return {
        "type": "object",
        "properties": {
            name: _type(argument.hint) | {"description": argument.parameter.help or ""}
            for name, argument in found.items()
        },
        "required": [name for name, argument in found.items() if argument.required],
        "additionalProperties": False,
    }


def command_line(tool: str, values: Mapping[str, Any]) -> list[str]:
    """The arguments of ``mofit`` for a call, with ``--json``; values that fit `input_schema`.

    A value never reads as an option: one of an option stands behind its ``=``, files stand behind ``--``.
    """
    options, files = ["--json"], list[str]()
    for name, argument in _arguments(tool).items():
        value = values.get(name)
        if value is None or value is False:
            continue
        entries = value if isinstance(value, list) else [value]
        if argument.index is not None:
            files += map(str, entries)
        elif value is True:
            options.append(argument.name)
        else:
            options += [f"{argument.name}={entry}" for entry in entries]
    return [tool, *options, *(["--", *files] if files else [])]


def _arguments(tool: str) -> dict[str, Argument]:
    """By the name that a program gives, in the order of the command line."""
    every = {_name(argument): argument for argument in app[tool].assemble_argument_collection(parse_docstring=True)}
    return {name: argument for name, argument in every.items() if name in TOOLS[tool]}


def _name(argument: Argument) -> str:
    return argument.name.removeprefix("--").replace("-", "_").lower()


def _type(hint: Any) -> dict[str, Any]:
    if get_origin(hint) is tuple:
        return {"type": "array", "items": _type(get_args(hint)[0])}
    (kind,) = [one for one in get_args(hint) if one is not NoneType] or [hint]
    return {"type": _TYPES[kind]}
