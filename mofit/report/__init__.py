"""The pages of a run, report and uncertainty: each reads a result tree and is one self-contained file."""

from mofit.report.build import (
    DATA_FOLDER,
    REPORT_FILE,
    UNCERTAINTY_FILE,
    UNCERTAINTY_FOLDER,
    Page,
    build_report,
    build_uncertainty,
    report_beside,
    report_page,
    write_report,
)

__all__ = [
    "DATA_FOLDER",
    "REPORT_FILE",
    "UNCERTAINTY_FILE",
    "UNCERTAINTY_FOLDER",
    "Page",
    "build_report",
    "build_uncertainty",
    "report_beside",
    "report_page",
    "write_report",
]
