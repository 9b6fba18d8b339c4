"""The report of a run: reads a result tree, writes one self-contained page."""

from mofit.report.build import DATA_FOLDER, REPORT_FILE, build_report, write_report

__all__ = ["DATA_FOLDER", "REPORT_FILE", "build_report", "write_report"]
