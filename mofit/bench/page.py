"""The table of a benchmark as a Markdown page, with what made it."""

from __future__ import annotations

import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any


def headings(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Every key of any row, in the order of first appearance."""
    return list(dict.fromkeys(key for row in rows for key in row))


def cell(value: Any) -> str:
    """A value as text: four digits of a float, nothing for None."""
    if value is None:
        return ""
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def write_page(name: str, result: Mapping[str, Any], folder: Path, pictures: Mapping[str, str]) -> Path:
    """Write ``README.md`` into a folder; or copy the ``report`` that the settings name.

    Parameters
    ----------
    name
        Of the benchmark.
    result
        Its ``rows`` and ``settings``.
    folder
        Made if it isn't there.
    pictures
        File name in the folder to caption.
    """
    settings = result["settings"]
    if "report" in settings:
        shutil.copytree(settings["report"], folder, dirs_exist_ok=True)
        return folder / "README.md"
    columns = headings(result["rows"])
    folder.mkdir(parents=True, exist_ok=True)
    options = "".join(f" --{key} {settings[key]}" for key in ("runs", "seed", "limit") if key in settings)
    lines = [
        f"# Benchmark: {name}",
        "",
        f"Written by `mofit bench {name}{options} --report {folder.as_posix()}`.",
        "",
        f"| {' | '.join(column.replace('_', ' ') for column in columns)} |",
        "|---" * len(columns) + "|",
        *(f"| {' | '.join(cell(row.get(column)) for column in columns)} |" for row in result["rows"]),
        "",
        *(f"- {key.replace('_', ' ')}: {value}" for key, value in settings.items()),
        "",
        *(f"![{caption}]({file})\n\n{caption}\n" for file, caption in pictures.items()),
    ]
    page = folder / "README.md"
    page.write_text("\n".join(lines), encoding="utf-8")
    return page
