"""The uncertainty page: how far each number of a run can be trusted, and why."""

from mofit.report.convergence import convergence_section
from mofit.report.corner import corner_section
from mofit.report.uncertainty.directions import directions_section
from mofit.report.uncertainty.frequency import frequency_section
from mofit.report.uncertainty.heterogeneity import heterogeneity_section
from mofit.report.uncertainty.loops import loops_section
from mofit.report.uncertainty.marginals import marginals_section
from mofit.report.uncertainty.method import method_section
from mofit.report.uncertainty.mixture import mixture_section
from mofit.report.uncertainty.table import table_section

UNCERTAINTY_SECTIONS = (
    table_section,
    mixture_section,
    marginals_section,
    directions_section,
    corner_section,
    loops_section,
    frequency_section,
    heterogeneity_section,
    convergence_section,
    method_section,
)
"""In the order of the page; a section that finds nothing to show returns None."""

__all__ = ["UNCERTAINTY_SECTIONS"]
