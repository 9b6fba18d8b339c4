"""Notebooks of the documentation: ``python scripts/notebooks.py [NAME ...]`` runs examples/notebooks/NAME.ipynb.

Each runs from top to bottom in an empty folder, and its outputs are written into it, for the documentation to show.
Without names all run.
"""

from __future__ import annotations

import os
import sys
import tempfile
from pathlib import Path

import nbformat
from nbclient import NotebookClient

FOLDER = Path(__file__).resolve().parents[1] / "examples" / "notebooks"
#: Seconds that one cell may take.
TIMEOUT = 500


def executed(path: Path, folder: Path) -> nbformat.NotebookNode:
    """A notebook with the outputs that its cells give in a folder; a cell that fails raises."""
    notebook = nbformat.read(path, as_version=4)
    client = NotebookClient(notebook, timeout=TIMEOUT, resources={"metadata": {"path": str(folder)}})
    # figures show themselves as in any notebook, whatever backend runs this
    environment = {name: value for name, value in os.environ.items() if name != "MPLBACKEND"}
    return client.execute(env=environment)


def shown(notebook: nbformat.NotebookNode) -> nbformat.NotebookNode:
    """The notebook without what was seen for a moment (times, progress, warnings), and without text beside HTML."""
    for cell in notebook.cells:
        cell.metadata = {}
        if cell.cell_type == "code":
            cell.outputs = [one for one in cell.outputs if not _passing(one)]
            for one in cell.outputs:
                if "text/html" in one.get("data", {}):
                    one.data.pop("text/plain", None)
    return notebook


def _passing(output: nbformat.NotebookNode) -> bool:
    if output.output_type == "stream":
        return bool(output.name == "stderr")
    return output.output_type == "display_data" and "<progress" in output.data.get("text/html", "")


def main(names: list[str]) -> None:
    """Run the notebooks named, or all."""
    for path in [FOLDER / f"{name}.ipynb" for name in names] or sorted(FOLDER.glob("*.ipynb")):
        with tempfile.TemporaryDirectory() as folder:
            found = shown(executed(path, Path(folder)))
        path.write_text(nbformat.writes(found, indent=1) + "\n", encoding="utf-8")
        print(f"examples/notebooks/{path.name}: {path.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main(sys.argv[1:])
