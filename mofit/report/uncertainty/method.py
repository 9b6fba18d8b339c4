"""How the numbers of the uncertainty page come about, with the sources."""

from __future__ import annotations

from markupsafe import Markup

from mofit.report.page import Raw, Section, Text
from mofit.report.posterior import FLAT, STRONG
from mofit.report.run import Run

_STEPS = (
    "<b>Draws.</b> The posterior (likelihood of the residuals times prior, uniform within the bounds in the scale of "
    "the search, with what calibration stages know) is sampled around each minimum by independent ensembles of walkers "
    "[1]. Means, standard deviations and intervals are those of the draws; a 90 % interval runs from their 5 % to "
    "their 95 % quantile.",
    "<b>Contraction and verdict.</b> Contraction is 1 − posterior sd / prior sd, both in the box of the prior. "
    "A verdict says “identified” above 50 %, “not identifiable” below 10 %, and “limit only” where the posterior leans "
    "on a bound.",
    "<b>Profile likelihood.</b> One parameter is held at a grid of values within three standard deviations and all "
    "others are minimised again, with exact gradients [2]. The 90 % interval ends where the negative log posterior has "
    "risen by 1.35, half the quantile of χ² with one degree of freedom.",
    f"<b>Flat directions.</b> Eigenvectors of the covariance of the draws in the box of the prior. A direction that "
    f"keeps more than {100 * FLAT:.0f} % of the prior's standard deviation is called flat; pairs correlated by more "
    f"than {STRONG} are named.",
    "<b>Predictive bands.</b> The model is simulated at some of the draws. A band for a new measurement adds the "
    "test's noise to their spread. Amplitude and phase of the fundamental are least-squares fits over whole periods; "
    "how well they are measured follows from their scatter from period to period.",
    "<b>Heterogeneity.</b> Estimates of single tests, with the standard deviation of the curvature at their minimum, "
    "are pooled by inverse variance; Cochran's Q [3] is compared with χ², and I² [4] is the share of the scatter that "
    "the spread of the estimates doesn't explain. Estimates at a bound, or about as wide as the box, are left out: "
    "their distribution is no Gaussian.",
    "<b>Convergence.</b> R-hat is rank-normalised and split, effective sample sizes are bulk values [5]; "
    "autocorrelation times are the integrated ones of the ensembles [1].",
)

_REFERENCES = (
    "Foreman-Mackey D, Hogg DW, Lang D, Goodman J. emcee: The MCMC Hammer. Publications of the Astronomical Society of "
    "the Pacific 125, 306–312, 2013.",
    "Raue A, Kreutz C, Maiwald T, Bachmann J, Schilling M, Klingmüller U, Timmer J. Structural and practical "
    "identifiability analysis of partially observed dynamical models by exploiting the profile likelihood. "
    "Bioinformatics 25(15), 1923–1929, 2009.",
    "Cochran WG. The combination of estimates from different experiments. Biometrics 10(1), 101–129, 1954.",
    "Higgins JPT, Thompson SG. Quantifying heterogeneity in a meta-analysis. Statistics in Medicine 21(11), 1539–1558, "
    "2002.",
    "Vehtari A, Gelman A, Simpson D, Carpenter B, Bürkner PC. Rank-normalization, folding, and localization: an "
    "improved R-hat for assessing convergence of MCMC. Bayesian Analysis 16(2), 667–718, 2021.",
)


def method_section(run: Run) -> Section:
    """Steps and references."""
    items = Markup("").join(Markup("<li>{}</li>").format(text) for text in _REFERENCES)
    steps = [Text(Markup(step)) for step in _STEPS]
    return Section("method", "Method", [*steps, Raw(Markup("<ol>{}</ol>").format(items))])
