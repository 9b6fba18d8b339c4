"""The diagnosis page: verdict, where the gap lies, which effect causes it, how far it shrinks, what is ruled out."""

from mofit.diagnosis.pages.page import diagnosis_page, write_diagnosis, write_files

__all__ = ["diagnosis_page", "write_diagnosis", "write_files"]
