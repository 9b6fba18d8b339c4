"""The directive ``commands``: every command with its help, from the program itself."""

from io import StringIO

from docutils import nodes
from rich.console import Console
from sphinx.util.docutils import SphinxDirective

#: Columns of the help; more would scroll sideways on the page.
WIDTH = 100


class Commands(SphinxDirective):
    """A section per command, by name."""

    def run(self) -> list[nodes.Node]:
        """Make the sections."""
        from mofit.cli.app import app

        sections = []
        for name in sorted(name for name in app if not name.startswith("-")):
            text = StringIO()
            app.help_print([name], console=Console(file=text, width=WIDTH, color_system=None))
            section = nodes.section(ids=[f"command-{name}"])
            section += nodes.title(text=f"mofit {name}")
            section += nodes.literal_block(text.getvalue(), text.getvalue().strip(), language="text")
            sections.append(section)
        return sections


def setup(app) -> dict[str, bool]:
    """Register the directive."""
    app.add_directive("commands", Commands)
    return {"parallel_read_safe": True}
