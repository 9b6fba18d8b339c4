"""A TOML file that a user wrote, checked against a schema: every fault at once."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from mofit.errors import Fault, InputError

Schema = TypeVar("Schema", bound=BaseModel)


def read_toml(
    path: Path,
    what: str,
    schema: type[Schema],
    arrange: Callable[[Mapping[str, Any]], Mapping[str, Any]],
    explain: Callable[[str, Mapping[str, Any]], Fault],
) -> Schema:
    """Read and check a file.

    Parameters
    ----------
    path
        The file.
    what
        What it is, for messages: ``"map"``, ``"plan"``.
    schema
        What it must hold.
    arrange
        Turns the file's content into what the schema expects (defaults spread over entries …).
    explain
        Makes a fault of one of pydantic's errors; called with the place and the error.

    Raises
    ------
    InputError
        With every fault: no file, no TOML, unknown or missing keys, values of the wrong kind.
    """
    where = f"{what} '{path.name}'"
    if not path.is_file():
        raise InputError.of(where, f"there is no file '{path}'", "Check the path")
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError.of(where, f"no valid TOML: {error}", "Mend that line") from error
    try:
        return schema.model_validate(arrange(content))
    except ValidationError as error:
        raise InputError([explain(where, dict(problem)) for problem in error.errors()]) from error
