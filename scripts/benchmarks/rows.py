"""Rows of a benchmark: a competitor that cannot run here has one with the reason, those of a long study are kept."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import mofit

Row = dict[str, Any]


class Absent(Exception):
    """A competitor cannot run here; the message says why."""


def imported(module: str) -> Any:
    """A module of an optional package.

    Raises
    ------
    Absent
        If the package is not installed.
    """
    try:
        return import_module(module)
    except ImportError:
        raise Absent(f"{module.partition('.')[0]} is not installed (extra 'bench')") from None


def row(head: Row, make: Callable[[], Row]) -> Row:
    """``head`` and what ``make`` gives, or ``skipped`` with the reason where the competitor is absent."""
    try:
        return {**head, **make()}
    except Absent as reason:
        return {**head, "skipped": str(reason)}


class KeptRows:
    """The rows of a long benchmark with these options and this code; an interrupted one resumes.

    Parameters
    ----------
    name
        Of the benchmark.
    options
        What its rows depend on.
    folder
        Where they are kept until the benchmark is done.
    """

    def __init__(self, name: str, options: dict[str, Any], folder: Path = Path("runs/bench")) -> None:
        digest = hashlib.sha256(json.dumps(options, sort_keys=True).encode())
        for package in (Path(mofit.__file__).parent / "optimize", Path(__file__).parent):
            for file in sorted(package.rglob("*.py")):
                digest.update(file.read_bytes())
        self.path = folder / f"{name}-{digest.hexdigest()[:16]}.jsonl"
        self.rows: list[Row] = []
        self._known: list[Row] = []
        if self.path.exists():
            lines = self.path.read_text(encoding="utf-8").splitlines(keepends=True)
            self._known = [json.loads(line) for line in lines if line.endswith("\n")]  # an incomplete last line is none

    def add(self, head: Row, make: Callable[[], Row]) -> None:
        """One more row: the kept one that begins with ``head``, or a new one."""
        for known in self._known:
            if known.items() >= head.items():
                self.rows.append(known)
                return
        self.rows.append(row(head, make))
        self.path.parent.mkdir(parents=True, exist_ok=True)
        with self.path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(self.rows[-1]) + "\n")

    def done(self) -> list[Row]:
        """All rows; nothing is kept any longer."""
        self.path.unlink(missing_ok=True)
        return self.rows
