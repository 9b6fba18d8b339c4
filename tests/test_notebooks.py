"""The notebooks of the documentation run from top to bottom, and show what is stored in them."""

import re
from pathlib import Path

import pytest

nbformat = pytest.importorskip("nbformat", reason="needs the packages of the development group")
pytest.importorskip("nbclient", reason="needs the packages of the development group")

from notebooks import FOLDER, executed, shown  # noqa: E402 - needs the packages above

ROOT = Path(__file__).resolve().parents[1]
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))


def kinds(notebook: "nbformat.NotebookNode") -> list[list[str]]:
    """Of every code cell, what its outputs are."""
    return [
        [kind for output in cell.outputs for kind in sorted(output.get("data", {output.output_type: ""}))]
        for cell in notebook.cells
        if cell.cell_type == "code"
    ]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_holds_its_outputs_and_is_in_the_index(path: Path) -> None:
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    found = [kind for cell in kinds(notebook) for kind in cell]
    assert "text/html" in found
    assert "error" not in found
    assert path.stat().st_size < 500_000
    index = (ROOT / "docs" / "index.md").read_text(encoding="utf-8")
    assert f"(../examples/notebooks/{path.name})" in index
    assert f"\nexamples/notebooks/{path.stem}\n" in index
    text = "".join(cell.source for cell in notebook.cells if cell.cell_type == "markdown")
    assert [link for link in re.findall(r"\]\(([^):#]+)", text) if not (FOLDER / link).exists()] == []


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs_and_shows_what_is_stored(path: Path, tmp_path: Path) -> None:
    stored = nbformat.read(path, as_version=4)
    assert kinds(shown(executed(path, tmp_path))) == kinds(stored)
