"""What every report of a script says of itself: title, method, command, versions."""

from __future__ import annotations

import platform
from importlib.metadata import version

LIBRARIES = ("numpy", "scipy", "casadi", "llvmlite", "emcee")


def header(title: str, doc: str | None, command: str, note: str = "") -> list[str]:
    """First lines of a Markdown page; the method is the script's docstring without its first line and its usage."""
    method = (doc or "").partition("\n\n")[2].partition("\n\n")[2].strip()
    return [f"# {title}", "", method, "", f"Written by `python scripts/{command}`. {note}".rstrip(), ""]


def versions() -> str:
    """Of Python and of the libraries that the numbers depend on."""
    libraries = ", ".join(f"{name} {version(name)}" for name in LIBRARIES)
    return f"Python {platform.python_version()}, {libraries}."
