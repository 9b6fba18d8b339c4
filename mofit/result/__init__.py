"""The result of a run: one labelled tree (``mofit.result/1``), checked, written and read as a whole."""

from mofit.result.layout import SCHEMA, check_result
from mofit.result.quantities import Signal, quantity, signal_dataset
from mofit.result.store import RESULT_FILE, atomic_path, open_result, write_result

__all__ = [
    "RESULT_FILE",
    "SCHEMA",
    "Signal",
    "atomic_path",
    "check_result",
    "open_result",
    "quantity",
    "signal_dataset",
    "write_result",
]
