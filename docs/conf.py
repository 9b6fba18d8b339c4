"""Build settings of the documentation: ``make docs`` writes it to build/docs, without network."""

import re
import sys
from pathlib import Path

from docutils import nodes
from latex2mathml.converter import convert

import mofit

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))  # commands_directive

# Sphinx reads below its own folder only. The links are made here because an sdist would store them as second copies.
for name in ("examples", "reports"):
    if not (HERE / name).is_symlink():
        (HERE / name).symlink_to(Path("..") / name)

project = "mofit"
author = "the mofit developers"
release = version = mofit.__version__
extensions = [
    "myst_parser",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.viewcode",
    "catalogue_directive",
    "commands_directive",
    "notebook_parser",
    "tables_directive",
]
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 3
exclude_patterns = ["build"]
html_theme = "furo"
html_title = f"mofit {release}"
html_math_renderer = "mathml"
autodoc_typehints = "none"
autodoc_member_order = "bysource"
numpydoc_show_class_members = False
nitpicky = False


def _inline(self, node: nodes.math) -> None:
    self.body.append(convert(node.astext()))
    raise nodes.SkipNode


def _block(self, node: nodes.math_block) -> None:
    # the browser draws a formula higher than its line: room in place of a scroll bar
    room = "overflow-y: hidden; padding-block: 0.4em"
    formula = convert(_one_row_each(node.astext()), display="block")
    self.body.append(f'<div class="math" style="{room}">{formula}</div>')
    raise nodes.SkipNode


def _one_row_each(text: str) -> str:
    r"""Rows of an aligned block (latex2mathml knows split, not aligned), one per line that ends in \\."""
    return rf"\begin{{split}}{text}\end{{split}}" if r"\\" in text and r"\begin" not in text else text


def _relink(app, name: str, source: list[str]) -> None:
    """Point links to ../reports and ../examples at the copies that Sphinx reads."""
    if name == "reports/README":  # links of the index lead to its own subfolders
        source[0] = source[0].replace("](", "](../reports/")
    text = re.sub(
        r"\[([^\]]+)\]\(\.\./((?:reports|examples)/[\w/-]+)\.(?:md|ipynb)\)",
        lambda found: f"{{doc}}`{found[1].replace('`', '')} </{found[2]}>`",
        source[0],
    )
    source[0] = text.replace("](../examples/", "](examples/")


def setup(app) -> None:
    """Write formulas as MathML: every browser draws it, and nothing is fetched."""
    app.connect("source-read", _relink)
    app.add_html_math_renderer("mathml", inline_renderers=(_inline, None), block_renderers=(_block, None))
