"""The folder of a prediction: netCDF file, page, and the numbers behind it."""

from __future__ import annotations

from itertools import count
from pathlib import Path

import xarray as xr
from markupsafe import Markup

from mofit.report.predicted import extract_predicted, predicted_figures, predicted_table
from mofit.report.toolkit.blocks import Block, Section, banner, bullets, cards, method_section
from mofit.report.toolkit.formatting import number, percent, unit_text
from mofit.report.toolkit.page import draw_sections, write_data, write_page
from mofit.results import parts_of_band, prediction_rows
from mofit.runtime.files import write_tree
from mofit.runtime.run_directory import RunFolder

PREDICTION_FILE = "prediction.nc"
PAGE_FILE = "prediction.html"
DATA_FOLDER = "prediction_data"
#: Folder of predictions in that of their run.
PREDICTIONS = "predictions"


def write_prediction(tree: xr.DataTree, folder: Path) -> Path:
    """Write ``prediction.nc``, ``prediction.html`` and ``prediction_data/*.json`` into a folder; returns the page."""
    write_tree(tree, folder / PREDICTION_FILE, level=1)
    sections = draw_sections((_summary, _signals, _method), tree)
    write_data(folder / DATA_FOLDER, sections)
    attrs = tree.attrs
    subtitle = f"{attrs['campaign_title']} ({attrs['campaign_source']}) · {attrs['created']}"
    return write_page(folder / PAGE_FILE, f"Prediction: {attrs['run_title']}", subtitle, sections)


def free_folder(run: Path, stem: str) -> Path:
    """The next free folder for a prediction in that of a run, or beside the ``result.nc`` that is named instead."""
    parent = (run.parent if run.is_file() else run) / PREDICTIONS
    names = (stem if k == 1 else f"{stem}-{k}" for k in count(1))
    return next(path for path in (parent / name for name in names) if RunFolder.at(path).is_free)


def _summary(tree: xr.DataTree) -> Section:
    rows, blocks = prediction_rows(tree), list[Block]()
    if not tree.attrs["converged"]:
        blocks.append(banner("The run did not converge, or was not sampled: the parameters' part may be wrong.", "bad"))
    errors = [row["nrmsd"] for row in rows if row["nrmsd"] is not None]
    inside = [row["coverage"] for row in rows if row["coverage"] is not None]
    if errors:
        blocks.append(
            cards(
                [
                    (percent(max(errors)), "largest NRMSD"),
                    (percent(sum(inside) / len(inside)), "of the samples in the 90 % band, mean of the tests"),
                ]
            )
        )
    blocks += predicted_table(tree)
    return Section("summary", "Errors and bands", blocks, {"tests": rows, "band": parts_of_band(tree)})


def _signals(tree: xr.DataTree) -> Section:
    return Section("signals", "Predicted and measured", predicted_figures(tree), {"signals": extract_predicted(tree)})


def _method(tree: xr.DataTree) -> Section:
    found = parts_of_band(tree)
    draws = "posterior draws" if found["spread"] == "sampled" else "draws from the Laplace approximation"
    noise = bullets(
        Markup("{}: {} {}").format(
            name.replace("_", " "),
            number(own["value"]) if own["as"] == "units" else percent(own["value"]),
            unit_text(own["unit"]) if own["as"] == "units" else "of the range",
        )
        for name, own in found["noise"].items()
    )
    steps = {
        "Parameters": f"{found['draws']} {draws} of all modes by their probability are simulated from the first sample "
        "of the record on. The dark band holds 90 % of them.",
        "Noise": "Its standard deviation in units or as a share of the range, whichever differs less between the "
        "identified tests: the root mean square of those.",
        "Model error": f"What the model misses in the identified tests beyond their noise, {percent(found['gap'])} of "
        "the range, times the range of the prediction.",
        "Band": "The light band has the 5 and 95 % quantile of the mixture of all draws, each with a Gaussian of noise "
        "and model error.",
        "Score": "Samples count as in an identification: a periodic test is scored after its transient, or its first "
        "period; any other record from its first sample.",
    }
    return method_section(steps, more=[noise])
