"""A proposed map as a file, with a picture of what was understood beside it: the work of ``mofit import --guess``."""

from __future__ import annotations

from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from mofit.data.importers.map_proposal import MapProposal, ProposedTest, map_proposal
from mofit.runtime.files import write_bytes, write_text
from mofit.runtime.output_file import PICTURE_MARK, output_file

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: tests and columns that a picture shows, and points per line
_TESTS, _COLUMNS, _POINTS = 4, 6, 4000
_COLOURS = {"input": "#0b62a4", "output": "#c8500a", "": "#8a8a8a"}


def write_map(sources: Sequence[Path], out: Path, force: bool = False) -> Path | None:
    """Write a proposed map to ``out``, and its picture beside it as PNG.

    Parameters
    ----------
    sources
        Files, and folders of files.
    out
        Map file (TOML) to write.
    force
        Replace a map and a picture that an earlier call wrote, and what was edited in them.

    Returns
    -------
    Path or None
        The picture; None where no test is a record of samples.

    Raises
    ------
    InputError
        If a file exists and may not be replaced, or nothing can be proposed.
    """
    picture = Path(out).with_suffix(".png")
    with (
        output_file(out, force=force, inputs=sources) as file,
        output_file(picture, force=force, inputs=sources) as drawing,
    ):
        proposal = map_proposal(sources)
        if proposal.tests:
            page = BytesIO()
            draw_map(proposal).savefig(page, format="png", dpi=110, metadata={"Software": PICTURE_MARK})
            write_bytes(drawing, page.getvalue())
        write_text(file, proposal.text)
    return picture if proposal.tests else None


def draw_map(proposal: MapProposal) -> Figure:
    """A row per test with an axes per column: in colour what a proposed map takes, in grey what it leaves out."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    shown = proposal.tests[:_TESTS]
    rows = [_columns(test) for test in shown]
    wide = max(len(columns) for columns in rows)
    figure = Figure(figsize=(3.4 * wide, 2.5 * len(shown) + 0.5), layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.subplots(len(shown), wide, squeeze=False)
    for test, columns, axes in zip(shown, rows, grid, strict=True):
        for ax in axes[len(columns) :]:
            ax.set_axis_off()
        for column, ax in zip(columns, axes, strict=False):
            _draw(test, column, ax)
    left_out = len(proposal.tests) - len(shown)
    more = f"; {left_out} more tests are like in the map" if left_out else ""
    figure.suptitle(f"Proposed: blue drives, orange responds, grey is not used{more}", fontsize=10)
    return figure


def _columns(test: ProposedTest) -> list[str]:
    """Columns to draw: channels, then what has a remark, then others of as many samples."""
    used = [guess.column for guess in test.channels.values()]
    rows = len(test.table.column(used[0]))
    time = test.time.column if test.time else None
    others = [
        name
        for name in (*test.remarks, *test.table.columns)
        if name not in (*used, time) and len(test.table.column(name)) == rows
    ]
    return list(dict.fromkeys([*used, *others]))[:_COLUMNS]


def _draw(test: ProposedTest, column: str, ax: Axes) -> None:
    from mofit.quantities import CHANNELS

    name, guess = next(((n, g) for n, g in test.channels.items() if g.column == column), ("", None))
    known = CHANNELS.get(name)
    role = (guess.role or (known.role if known else "") or "") if guess else ""
    values = test.table.column(column)
    kept = slice(None, None, max(len(values) // _POINTS, 1))
    time = test.table.column(test.time.column) if test.time else np.arange(len(values))
    ax.plot(time[kept], values[kept], color=_COLOURS[role], lw=0.8)
    if guess:
        title = f"{name} = '{column[:24]}'"
        ax.set_ylabel(f"{name} [{guess.unit}]")
    else:
        title = f"'{column[:24]}': {test.remarks.get(column, 'not used')}"
    ax.set_title(f"{test.name[:28]}: {title}" if ax.get_subplotspec().is_first_col() else title, fontsize=8)  # type: ignore[union-attr]
    ax.set_xlabel(f"time [{test.time.unit}]" if test.time else "sample")
    ax.tick_params(labelsize=7)
