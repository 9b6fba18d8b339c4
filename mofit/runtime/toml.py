"""TOML files: read and checked against a schema, every issue at once, and written."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, ClassVar, TypeVar, get_args

from pydantic import BaseModel, ConfigDict, ValidationError

from mofit.errors import InputError, Issue, did_you_mean


class Strict(BaseModel):
    """A table of a file: unknown keys are refused, and values do not change."""

    #: new name of each key that once had another, for the hint
    renamed: ClassVar[Mapping[str, str]] = {}

    model_config = ConfigDict(extra="forbid", frozen=True, populate_by_name=True)


Schema = TypeVar("Schema", bound=Strict)
Table = Mapping[str, Any]


def read_toml(
    path: Path,
    what: str,
    schema: type[Schema],
    docs: str,
    with_defaults: Callable[[Table, Table], Table],
) -> Schema:
    """Read a file and check it against the ``schema``.

    Messages name ``what`` it is (``"map"``, ``"plan"``) and the ``docs`` that list its keys.
    ``with_defaults(defaults, test)`` merges the file's table ``defaults`` into one of its ``tests``.

    Raises
    ------
    InputError
        With every issue: no file, no TOML, unknown or missing keys, values of the wrong kind.
    """
    where = f"{what} '{path.name}'"
    if not path.is_file():
        raise InputError.of(where, f"there is no file '{path}'", "Check the path")
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError.of(where, f"no valid TOML: {error}", "Correct that line") from error
    defaults, tests = content.pop("defaults", {}), content.get("tests")
    if not isinstance(defaults, dict):
        raise InputError.of(f"{where}, defaults", "not a table", f"Write [defaults]; {docs} lists every key")
    if isinstance(tests, list):
        content["tests"] = [with_defaults(defaults, test) if isinstance(test, dict) else test for test in tests]
    try:
        return schema.model_validate(content)
    except ValidationError as error:
        raise InputError([_issue(where, dict(problem), schema, docs) for problem in error.errors()]) from error


def _issue(where: str, problem: Table, schema: type[BaseModel], docs: str) -> Issue:
    """One of pydantic's errors with its place in the file and a hint; items of lists are counted from 1."""
    parts = [str(part + 1) if isinstance(part, int) else str(part) for part in problem["loc"]]
    place = f"{where}, {'.'.join(parts)}" if parts else where
    if problem["type"] == "extra_forbidden":
        table = _table_at(schema, problem["loc"][:-1])
        known = [*table.model_fields, *(["defaults"] if table is schema else [])]
        new = table.renamed.get(parts[-1]) if issubclass(table, Strict) else None
        return Issue(place, "unknown key", f"It is called '{new}' now" if new else did_you_mean(parts[-1], known))
    if problem["type"] == "missing":
        return Issue(place, "missing", f"Add it; {docs} lists every key")
    return Issue(place, str(problem["msg"]).removeprefix("Value error, "), f"Correct it; {docs} lists every key")


def _table_at(table: type[BaseModel], loc: tuple[str | int, ...]) -> type[BaseModel]:
    """The table at a place; numbers, names of entries and of the alternatives of a union are passed over."""
    for part in loc:
        if part in table.model_fields:
            table = next(_tables(table.model_fields[str(part)].annotation), table)
    return table


def _tables(annotation: Any) -> Iterator[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for argument in get_args(annotation):
        yield from _tables(argument)


def toml_key(key: str) -> str:
    """A key, in quotes where TOML needs them."""
    return key if key and all(c.isascii() and (c.isalnum() or c in "-_") for c in key) else toml_value(key)


def toml_value(value: Any) -> str:
    """A number (NumPy's too), text, list or table, on one line.

    JSON writes numbers, booleans and texts as TOML does, but for DEL.
    """
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{toml_key(key)} = {toml_value(item)}" for key, item in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(toml_value, value)) + "]"
    plain = value.item() if hasattr(value, "item") else value
    return json.dumps(plain, ensure_ascii=False).replace("\x7f", "\\u007f")
