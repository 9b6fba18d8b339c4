"""How the numbers of the page come about, with the sources."""

from __future__ import annotations

from markupsafe import Markup

from mofit.identifiability.comparison import Comparison
from mofit.identifiability.points import AROUND
from mofit.identifiability.verdicts import SHARE_OF_BOX, SHARE_OF_VALUE
from mofit.report.page import Raw, Section, Text

_STEPS = (
    "<b>Sensitivities.</b> Exact derivatives of the discretised model by all parameters, at the samples that an "
    "identification judges: after the transient, at least one period of a periodic test.",
    "<b>Noise.</b> Of a plan, as it states it; of a campaign, level and spectrum of what does not repeat from period "
    "to period. Gaps of the model are not counted.",
    "<b>Spread.</b> mofit minimises weighted squares: with their curvature H and the covariance J of their slope the "
    "estimate has the precision H J<sup>−1</sup> H; calibration stages, whose parameters are nuisances, add theirs. "
    "The bound of Fisher information, which no estimate can pass, is in the numbers of <code>--json</code>. All "
    "parameters are confined by their bounds.",
    f"<b>Verdicts.</b> Identifiable: standard deviation at most {100 * SHARE_OF_VALUE:g} % of the value or "
    f"{100 * SHARE_OF_BOX:g} % of the box. Only in a combination: not so, but it would be if the other parameters were "
    "known. One-sided: neither, but one of the bounds is ruled out. The verdict is the most frequent one over the "
    f"parameter sets: the posterior of a run, or values in a box of ±{100 * AROUND:g} % of the bounds' width around "
    "those stated.",
    "<b>Confirmed.</b> Verdicts other than “identifiable” are checked by profile likelihoods [1] of the expected data "
    "at the stated values.",
    "<b>Collinearity.</b> Condition indices as in [2].",
)

_REFERENCES = (
    "Raue A, Kreutz C, Maiwald T, Bachmann J, Schilling M, Klingmüller U, Timmer J. Structural and practical "
    "identifiability analysis of partially observed dynamical models by exploiting the profile likelihood. "
    "Bioinformatics 25(15), 1923–1929, 2009.",
    "Belsley DA, Kuh E, Welsch RE. Regression diagnostics. Wiley, 1980.",
)


def method_section(comparison: Comparison) -> Section:
    """Steps and references."""
    items = Markup("").join(Markup("<li>{}</li>").format(text) for text in _REFERENCES)
    steps = [Text(Markup(step)) for step in _STEPS]
    return Section("method", "Method", [*steps, Raw(Markup("<ol>{}</ol>").format(items))])
