"""Results as tables for pandas, and how a result shows itself in a notebook."""

from __future__ import annotations

import base64
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from functools import partial
from html import escape
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import xarray as xr

from mofit.errors import InputError
from mofit.results import open_result
from mofit.results import summary as run_summary

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

    from mofit.diagnosis.result import Diagnosis
    from mofit.experimental_design.comparison_result import Comparison
    from mofit.experimental_design.design_job import Proposal

#: columns of the table of a run
COLUMNS = ("value", "mean", "sd", "q05", "q95", "unit", "verdict")


class Result(xr.DataTree):
    """A result tree (``mofit.result/2``) that a notebook shows with its table and two figures.

    It is xarray's tree in everything else; each ``modes/<id>`` is laid out for ArviZ.
    """

    __slots__ = ()

    @classmethod
    def of(cls, tree: xr.DataTree) -> Result:
        """The same tree; nothing is copied."""
        return tree if isinstance(tree, cls) else cls(tree.to_dataset(), children=dict(tree.children), name=tree.name)

    def _repr_html_(self) -> str:
        if "modes" not in self.children:
            return str(super()._repr_html_())
        title = str(self.attrs.get("title", self.attrs.get("model", "")))
        said = [finding["text"] for finding in run_summary(self, Path())["findings"]]
        whole = f"<details><summary>The tree</summary>{super()._repr_html_()}</details>"
        return view(title, said, [summary(self)], _figures(self), whole)


def view(
    title: str, said: Iterable[str], tables: Iterable[pd.DataFrame], figures: Iterable[tuple[str, str]], more: str = ""
) -> str:
    """What a notebook shows of a result: sentences, tables, pictures (description and address), and more HTML."""
    sentences = "".join(f"<p><b>{escape(sentence)}</b></p>" for sentence in said)
    shown = "".join(table.to_html(float_format=lambda value: f"{value:.4g}", na_rep="–") for table in tables)
    pictures = "".join(f'<img style="max-width: 48%" alt="{escape(alt)}" src="{src}">' for alt, src in figures)
    return f"<div><h4>{escape(title)}</h4>{sentences}{shown}{pictures}{more}</div>"


def summary(found: xr.DataTree | str | Path | Comparison | Proposal | Diagnosis) -> pd.DataFrame:
    """The numbers of a result as a table.

    Parameters
    ----------
    found
        A run (its tree or folder): a row per mode and parameter with ``value`` (MAP), ``mean``, ``sd``, ``q05``,
        ``q95``, ``unit`` and ``verdict``; parameters with a value per test or condition have a row for each. What
        `mofit.compare` returns: a row per experiment and parameter. `mofit.design`: a row per parameter, before and
        after. `mofit.diagnose`: a row per effect. `mofit.predict`: a row per test and output.

    Raises
    ------
    InputError
        If there is no such run.
    """
    import pandas as pd

    from mofit.diagnosis.result import Diagnosis
    from mofit.experimental_design.comparison_result import Comparison
    from mofit.experimental_design.design_job import Proposal

    if isinstance(found, Comparison):
        from mofit.experimental_design.summary import comparison_summary

        return _indexed(
            {
                (row["name"], name): entry
                for row in comparison_summary(found)["experiments"]
                for name, entry in row["parameters"].items()
            },
            ("experiment", "parameter"),
        )
    if isinstance(found, Proposal):
        from mofit.experimental_design.summary import design_summary

        return _indexed({(name,): entry for name, entry in design_summary(found)["parameters"].items()}, ("parameter",))
    if isinstance(found, Diagnosis):
        from mofit.diagnosis.result import summary as plain

        return pd.DataFrame(plain(found)["effects"])
    tree = found if isinstance(found, xr.DataTree) else open_result(found)
    if "modes" not in tree.children:
        from mofit.results import prediction_summary

        return pd.DataFrame(prediction_summary(tree)["tests"])
    return _of_run(tree)


def _of_run(tree: xr.DataTree) -> pd.DataFrame:
    rows: dict[tuple[str, ...], Mapping[str, Any]] = {}
    for mode in run_summary(tree, Path())["modes"]:
        for name, entry in mode["parameters"].items():
            rows[mode["id"], name, ""] = entry
        for name, entry in mode.get("scoped", {}).items():
            for label, own in entry["values"].items():
                rows[mode["id"], name, label] = {**own, "unit": entry["unit"], "verdict": own.get("verdict", "")}
    names: tuple[str, ...] = ("mode", "parameter", "of")
    if not any(label for _, _, label in rows):
        rows, names = {key[:2]: entry for key, entry in rows.items()}, names[:2]
    return _indexed(rows, names).reindex(columns=list(COLUMNS))


def _indexed(rows: Mapping[tuple[str, ...], Mapping[str, Any]], names: tuple[str, ...]) -> pd.DataFrame:
    import pandas as pd

    index = pd.MultiIndex.from_tuples(list(rows), names=names) if len(names) > 1 else [key[0] for key in rows]
    frame = pd.DataFrame(list(rows.values()), index=index)
    frame.index.names = list(names)
    return frame


def _figures(tree: xr.DataTree) -> list[tuple[str, str]]:
    """Errors of all tests, and the loop of the first that has an input, as pictures within the page."""
    from mofit import plots

    pictures = [("errors per test", picture(lambda ax: plots.errors(tree, ax=ax)))]
    for test in map(str, tree.coords["test"].values):
        with suppress(InputError):  # a free decay has no input
            pictures.append((f"measured and simulated: {test}", picture(partial(_loop, tree, test))))
            break
    return pictures


def _loop(tree: xr.DataTree, test: str, ax: Axes) -> None:
    from mofit import plots

    plots.loop(tree, test, ax=ax)


def picture(draw: Callable[[Axes], object]) -> str:
    """What is drawn into an axes, as the address of a picture."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(5.5, 3.6), layout="constrained")
    FigureCanvasAgg(figure)
    draw(figure.subplots())
    page = BytesIO()
    figure.savefig(page, format="png", dpi=100)
    return f"data:image/png;base64,{base64.b64encode(page.getvalue()).decode()}"
