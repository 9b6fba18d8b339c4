"""The sections of each page in order; one that finds nothing to show returns None.

A section is a function from `Run` to `Section` or None, in a module of its own; its page lists it here.
"""

from mofit.report.calibration import calibration_section
from mofit.report.convergence import convergence_section
from mofit.report.corner import corner_section
from mofit.report.directions import directions_section, posterior_section
from mofit.report.errors import errors_section
from mofit.report.estimates import estimates_section
from mofit.report.laws import laws_section
from mofit.report.method import provenance_section, run_method_section, uncertainty_method_section
from mofit.report.per_test import per_test_section
from mofit.report.predicted import held_out_section
from mofit.report.search import search_section
from mofit.report.signals import signals_section
from mofit.report.summary import summary_section
from mofit.report.uncertainty.fundamental import frequency_section
from mofit.report.uncertainty.homogeneity import homogeneity_section
from mofit.report.uncertainty.loops import loops_section
from mofit.report.uncertainty.marginals import marginals_section, mixture_section
from mofit.report.uncertainty.table import table_section

CONTENTS = {
    "report": (
        summary_section,
        estimates_section,
        laws_section,
        errors_section,
        signals_section,
        held_out_section,
        search_section,
        per_test_section,
        posterior_section,
        calibration_section,
        convergence_section,
        provenance_section,
        run_method_section,
    ),
    "uncertainty": (
        table_section,
        mixture_section,
        marginals_section,
        directions_section,
        corner_section,
        loops_section,
        frequency_section,
        homogeneity_section,
        convergence_section,
        uncertainty_method_section,
    ),
}

LONGEST = (posterior_section, signals_section, corner_section)
"""More than half of the work: two processes end together if these begin first."""
