"""The directive ``commands``: every command with its help, from the program itself."""

import os
import subprocess
import sys

from docutils import nodes
from sphinx.util.docutils import SphinxDirective


class Commands(SphinxDirective):
    """A section per command, in the order of the program's own help."""

    def run(self) -> list[nodes.Node]:
        """Ask the program."""
        from mofit.cli import app

        names = sorted(name for name in app if not name.startswith("-"))
        sections = []
        for name in names:
            section = nodes.section(ids=[f"command-{name}"])
            section += nodes.title(text=f"mofit {name}")
            text = _help(name)
            section += nodes.literal_block(text, text, language="text")
            sections.append(section)
        return sections


def _help(name: str) -> str:
    told = subprocess.run(
        [sys.executable, "-m", "mofit", name, "--help"],
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, "COLUMNS": "100", "NO_COLOR": "1"},
    )
    return told.stdout.strip()


def setup(app) -> dict[str, bool]:
    """Register the directive."""
    app.add_directive("commands", Commands)
    return {"parallel_read_safe": True}
