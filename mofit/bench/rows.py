"""Rows of a long benchmark, kept as they come: an interrupted one goes on where it was."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

Row = dict[str, Any]


class Rows:
    """The finished rows of one benchmark with these options and this code.

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
        package = Path(__file__).parents[1]
        for file in sorted([*(package / "search").glob("*.py"), *(package / "bench").rglob("*.py")]):
            digest.update(file.read_bytes())
        self.path = folder / f"{name}-{digest.hexdigest()[:16]}.jsonl"
        self.rows: list[Row] = []
        self._known: list[Row] = []
        if self.path.exists():
            lines = self.path.read_text(encoding="utf-8").splitlines(keepends=True)
            self._known = [json.loads(line) for line in lines if line.endswith("\n")]  # a torn last line is no row

    def add(self, head: Row, make: Callable[[], Row]) -> None:
        """One more row: the kept one that begins with ``head``, or else head and what ``make`` gives."""
        for row in self._known:
            if row.items() >= head.items():
                self.rows.append(row)
                return
        self.rows.append({**head, **make()})
        self.path.parent.mkdir(parents=True, exist_ok=True)
        with self.path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(self.rows[-1]) + "\n")

    def done(self) -> list[Row]:
        """All rows; nothing is kept any longer."""
        self.path.unlink(missing_ok=True)
        return self.rows
