"""The diagnosis page: verdict first, then where, which, how far, what was ruled out, what to test next."""

from mofit.report.diagnosis.build import DIAGNOSIS_DATA, DIAGNOSIS_FILE, write_diagnosis

__all__ = ["DIAGNOSIS_DATA", "DIAGNOSIS_FILE", "write_diagnosis"]
