"""Rows of a study on disk: made once, and anew where the code that decides them has changed."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mofit
from report_page import made_with

#: What an identification runs, of mofit.
DECIDING = ("data", "identification", "models", "optimize", "parameters.py", "problem", "sampling", "simulation")


def code_digest() -> str:
    """Digest of the code that decides an identification, as it is now."""
    package, digest = Path(mofit.__file__).parent, hashlib.sha256()
    for name in DECIDING:
        for file in sorted([package / name] if name.endswith(".py") else (package / name).rglob("*.py")):
            digest.update(file.read_bytes())
    return digest.hexdigest()[:12]


#: That of this process, which goes on with the code that it began with.
CODE = code_digest()


def kept(path: Path, make: Callable[[], dict[str, Any]]) -> dict[str, Any]:
    """A row from its file; made where there is none, or one of other code."""
    row = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    if row.get("code") != CODE:
        row = {**make(), "code": CODE}
        path.write_text(json.dumps(row), encoding="utf-8")
    return {name: value for name, value in row.items() if name != "code"}


def made_by(*more: str) -> str:
    """Python, the libraries and the code that the numbers depend on."""
    return f"{made_with(*more)} Digest of the code: {CODE}."
