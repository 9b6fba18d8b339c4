"""What studies and their pages share: title, method, the command, tables, versions."""

from __future__ import annotations

import platform
from collections.abc import Iterable, Sequence
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
#: Libraries that the numbers of a study depend on.
LIBRARIES = ("numpy", "scipy", "casadi", "llvmlite", "emcee")


def header(title: str, doc: str | None, command: str, note: str = "") -> list[str]:
    """First lines of a Markdown page; the method is the script's docstring without its first line and its usage."""
    method = (doc or "").partition("\n\n")[2].partition("\n\n")[2].strip()
    return [f"# {title}", "", method, "", f"Written by `python scripts/studies/{command}`. {note}".rstrip(), ""]


def table(columns: Sequence[str], rows: Iterable[Sequence[Any]]) -> list[str]:
    """A Markdown table with an empty line after it."""
    lines = [f"| {' | '.join(columns)} |", "|---" * len(columns) + "|"]
    return [*lines, *(f"| {' | '.join(map(str, row))} |" for row in rows), ""]


def versions(*libraries: str) -> dict[str, str]:
    """Versions of Python and of the libraries that are installed."""
    found = {"python": platform.python_version()}
    for name in libraries:
        with suppress(PackageNotFoundError):
            found[name] = version(name)
    return found


def made_with(*more: str) -> str:
    """Python and the libraries that the numbers depend on, in a sentence."""
    python, *libraries = versions(*LIBRARIES, *more).items()
    return f"Python {python[1]}, {', '.join(f'{name} {number}' for name, number in libraries)}."


def write_page(study: str, lines: Sequence[str], file: str = "README.md") -> None:
    """Write a page of ``reports/<study>`` and print it."""
    page = ROOT / "reports" / study / file
    page.parent.mkdir(parents=True, exist_ok=True)
    text = "\n".join(lines).rstrip() + "\n"
    page.write_text(text, encoding="utf-8")
    print(text)
