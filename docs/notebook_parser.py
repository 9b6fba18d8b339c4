"""Notebooks as pages: Sphinx reads ``.ipynb`` files with the outputs that are stored in them, and runs nothing."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from typing import Any

from docutils import nodes
from myst_parser.parsers.sphinx_ import MystParser

#: Kinds of an output, the richest first.
_KINDS = ("text/html", "image/png", "text/plain")


class NotebookParser(MystParser):
    """Markdown cells as they are, code cells with their outputs below."""

    supported = ("ipynb",)

    def parse(self, inputstring: str, document: nodes.document) -> None:
        """Parse a notebook."""
        super().parse("\n\n".join(_blocks(json.loads(inputstring))), document)


def _blocks(notebook: dict[str, Any]) -> Iterator[str]:
    for cell in notebook["cells"]:
        source = "".join(cell["source"])
        if cell["cell_type"] == "markdown":
            yield _linked(source)
            continue
        magic, _, rest = source.partition("\n")
        if magic.startswith("%%writefile "):
            yield _fenced("{code-block} toml", f":caption: {magic.split()[1]}\n\n{rest}")
        else:
            yield _fenced("python", source)
            yield from map(_output, cell["outputs"])


def _linked(text: str) -> str:
    """Links to pages and to other notebooks as Sphinx knows them: it reads this page through the link docs/examples."""
    text = re.sub(r"\[([^\]]+)\]\(\.\./\.\./docs/(\w+)\.md\)", r"{doc}`\1 </\2>`", text)
    return re.sub(r"\[([^\]]+)\]\((\w+)\.ipynb\)", r"{doc}`\1 </examples/notebooks/\2>`", text)


def _output(output: dict[str, Any]) -> str:
    if output["output_type"] == "stream":
        return _fenced("text", "".join(output["text"]).rstrip())
    kind = next(kind for kind in _KINDS if kind in output["data"])
    content = "".join(output["data"][kind])
    if kind == "text/plain":
        return _fenced("text", content)
    if kind == "image/png":
        content = f'<img alt="figure of the cell above" src="data:image/png;base64,{content.strip()}">'
    return _fenced("{raw} html", f'<div style="overflow-x: auto">{content}</div>')


def _fenced(language: str, text: str) -> str:
    return f"````{language}\n{text}\n````"


def setup(app) -> dict[str, bool]:
    """Register the parser."""
    app.add_source_suffix(".ipynb", "ipynb")
    app.add_source_parser(NotebookParser)
    return {"parallel_read_safe": True}
