"""The directives ``import-formats`` and ``result-groups``: tables from the registry and the result schema."""

from collections.abc import Callable

from docutils import nodes
from sphinx.util.docutils import SphinxDirective


def import_formats() -> str:
    """One row per format that ``mofit import`` reads."""
    from mofit.data.importers.registry import import_formats as formats

    lines = ["| format | versions | endings | what becomes a column | units |", "|---|---|---|---|---|"]
    for known in formats():
        endings = ", ".join(f"`{ending}`" for ending in known.endings)
        needs = f"; needs `pip install 'mofit[{known.extra}]'`" if known.extra else ""
        cells = (known.name, known.versions + needs, endings, known.columns, known.units)
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def result_groups() -> str:
    """One table per group of a result file that has variables of its own."""
    from mofit.results.schema import GROUPS

    lines: list[str] = []
    for path, group in GROUPS.items():
        if not group.variables:
            continue
        lines += ["", f"`{path}`", "", "| variable | over | unit | what it is |", "|---|---|---|---|"]
        for name, variable in group.variables.items():
            over = ", ".join(f"`{dim}`" for dim in variable.dims.split())
            about = (f"`{name}`", over, variable.units or "of the channel", variable.long_name or "signal of the stage")
            lines.append(f"| {' | '.join(about)} |")
    return "\n".join(lines)


class _Table(SphinxDirective):
    """Markdown that a function writes, parsed in place."""

    text: Callable[[], str]

    def run(self) -> list[nodes.Node]:
        """Parse the tables."""
        return self.parse_text_to_nodes(self.text())


class ImportFormats(_Table):
    """Table of the import formats."""

    text = staticmethod(import_formats)


class ResultGroups(_Table):
    """Tables of the result file."""

    text = staticmethod(result_groups)


def setup(app) -> dict[str, bool]:
    """Register the directives."""
    app.add_directive("import-formats", ImportFormats)
    app.add_directive("result-groups", ResultGroups)
    return {"parallel_read_safe": True}
