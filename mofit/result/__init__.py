"""The result of a run: one labelled tree (``mofit.result/1``), checked, written and read as a whole."""

from mofit.result.layout import SCHEMA, check_result
from mofit.result.quantities import AXES, OWN_UNIT, Signal, axis, parameter_axis, quantity, signal_dataset
from mofit.result.store import RESULT_FILE, atomic_path, open_result, write_result

__all__ = [
    "AXES",
    "OWN_UNIT",
    "RESULT_FILE",
    "SCHEMA",
    "Signal",
    "atomic_path",
    "axis",
    "check_result",
    "open_result",
    "parameter_axis",
    "quantity",
    "signal_dataset",
    "write_result",
]
