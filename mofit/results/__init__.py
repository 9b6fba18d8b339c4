"""The result of a run: one labelled tree (``mofit.result/2``), checked, written, read as a whole, and exported."""

from mofit.results.cochran_q import cochran
from mofit.results.io import open_result, write_result
from mofit.results.reading import findings, green, parameter_layout, summary
from mofit.results.schema import OWN_UNIT, SCHEMA
from mofit.results.variables import (
    Signal,
    axis,
    draw_axes,
    draws_dataset,
    group_dataset,
    parameter_axis,
    quantity,
    signal_dataset,
)

__all__ = [
    "OWN_UNIT",
    "SCHEMA",
    "Signal",
    "axis",
    "cochran",
    "draw_axes",
    "draws_dataset",
    "findings",
    "green",
    "group_dataset",
    "open_result",
    "parameter_axis",
    "parameter_layout",
    "quantity",
    "signal_dataset",
    "summary",
    "write_result",
]
