"""The documentation: ``make docs`` builds it into build/docs, without network."""

import re
import sys
from pathlib import Path

from docutils import nodes
from latex2mathml.converter import convert

sys.path.insert(0, str(Path(__file__).parent))
import mofit

project = "mofit"
author = "the mofit developers"
release = version = mofit.__version__
extensions = ["myst_parser", "numpydoc", "sphinx.ext.autodoc", "sphinx.ext.viewcode", "commands_directive"]
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
    self.body.append(f'<div class="math">{convert(_one_row_each(node.astext()), display="block")}</div>')
    raise nodes.SkipNode


def _one_row_each(text: str) -> str:
    r"""Lines that end in \\ as rows of a table: what display mathematics means by it."""
    return rf"\begin{{aligned}}{text}\end{{aligned}}" if r"\\" in text and r"\begin" not in text else text


def _inside(app, name: str, source: list[str]) -> None:
    """Links to the reports and examples beside this folder, which links of its own lead into."""
    text = re.sub(
        r"\[([^\]]+)\]\(\.\./(reports/[\w/-]+)\.md\)",
        lambda found: f"{{doc}}`{found[1].replace('`', '')} </{found[2]}>`",
        source[0],
    )
    source[0] = text.replace("](../examples/", "](examples/")


def setup(app) -> None:
    """Formulas as MathML, which every browser draws by itself: nothing is fetched."""
    app.connect("source-read", _inside)
    app.add_html_math_renderer("mathml", inline_renderers=(_inline, None), block_renderers=(_block, None))
