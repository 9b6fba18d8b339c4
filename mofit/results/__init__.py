"""The result of a run: one labelled tree (``mofit.result/2``), checked, written, read as a whole, and exported."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mofit.runtime.late_imports import at_first_use

if TYPE_CHECKING:
    from mofit.results.cochran_q import cochran
    from mofit.results.io import is_large, open_result, write_result
    from mofit.results.laws import laws_summary
    from mofit.results.layout import OUTPUT_UNIT, OWN_UNIT
    from mofit.results.objective_values import Objective, objectives, per_objective
    from mofit.results.predictions import SCOPED_SOURCES, parts_of_band, prediction_rows, prediction_summary
    from mofit.results.reading import findings, green, parameter_layout, summary
    from mofit.results.schema import SCHEMA
    from mofit.results.sentences import outcome_sentences
    from mofit.results.simulation_counts import simulations, simulations_line
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

# most need xarray, whose import takes a fifth of a second
__getattr__ = at_first_use(
    __name__,
    {
        "Computed": "variables",
        "OUTPUT_UNIT": "layout",
        "OWN_UNIT": "layout",
        "Objective": "objective_values",
        "SCHEMA": "schema",
        "SCOPED_SOURCES": "predictions",
        "Signal": "variables",
        "axis": "variables",
        "cochran": "cochran_q",
        "draw_axes": "variables",
        "draws_dataset": "variables",
        "findings": "reading",
        "green": "reading",
        "group_dataset": "variables",
        "is_large": "io",
        "laws_summary": "laws",
        "objectives": "objective_values",
        "open_result": "io",
        "outcome_sentences": "sentences",
        "parameter_axis": "variables",
        "parameter_layout": "reading",
        "parts_of_band": "predictions",
        "per_objective": "objective_values",
        "prediction_rows": "predictions",
        "prediction_summary": "predictions",
        "predictive_places": "variables",
        "quantity": "variables",
        "signal_dataset": "variables",
        "simulations": "simulation_counts",
        "simulations_line": "simulation_counts",
        "summary": "reading",
        "write_result": "io",
    },
)
