"""The pages of a run, report and uncertainty: each reads a result tree and is one self-contained file."""

from mofit.report.build import (
    DATA_FOLDER,
    REPORT_FILE,
    UNCERTAINTY_FILE,
    UNCERTAINTY_FOLDER,
    build_report,
    build_uncertainty,
    write_report,
)
from mofit.report.uncertainty.spread import spread_table

__all__ = [
    "DATA_FOLDER",
    "REPORT_FILE",
    "UNCERTAINTY_FILE",
    "UNCERTAINTY_FOLDER",
    "build_report",
    "build_uncertainty",
    "spread_table",
    "write_report",
]
