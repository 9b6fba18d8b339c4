"""The result of a run: one labelled tree (``mofit.result/2``), checked, written, read as a whole, and exported."""

from mofit.results.cochran_q import cochran
from mofit.results.io import is_large, open_result, write_result
from mofit.results.laws import laws_summary
from mofit.results.layout import OUTPUT_UNIT, OWN_UNIT
from mofit.results.objectives import Objective, objectives, per_objective
from mofit.results.predictions import SCOPED_SOURCES, parts_of_band, prediction_rows, prediction_summary
from mofit.results.reading import findings, green, parameter_layout, summary
from mofit.results.schema import SCHEMA
from mofit.results.sentences import outcome_sentences
from mofit.results.simulations import simulations, simulations_line
from mofit.results.variables import (
    Computed,
    Signal,
    axis,
    draw_axes,
    draws_dataset,
    group_dataset,
    parameter_axis,
    predictive_places,
    quantity,
    signal_dataset,
)

__all__ = [
    "OUTPUT_UNIT",
    "OWN_UNIT",
    "SCHEMA",
    "SCOPED_SOURCES",
    "Computed",
    "Objective",
    "Signal",
    "axis",
    "cochran",
    "draw_axes",
    "draws_dataset",
    "findings",
    "green",
    "group_dataset",
    "is_large",
    "laws_summary",
    "objectives",
    "open_result",
    "outcome_sentences",
    "parameter_axis",
    "parameter_layout",
    "parts_of_band",
    "per_objective",
    "prediction_rows",
    "prediction_summary",
    "predictive_places",
    "quantity",
    "signal_dataset",
    "simulations",
    "simulations_line",
    "summary",
    "write_result",
]
