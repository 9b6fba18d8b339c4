"""The method in a few words, with its sources."""

from __future__ import annotations

from markupsafe import Markup

from mofit.report.page import Raw, Section, Text
from mofit.report.run import Run

_STEPS = (
    Markup(
        "<b>Error measure.</b> Every test is one objective: NRMSD = √(mean of (measured − simulated)²) / (max − "
        "min of the measured "
        "output), eq. (10) of [1]. Samples before the steady oscillation are dropped."
    ),
    Markup(
        "<b>Noise floor.</b> The noise is estimated from the differences between repeated periods (or by local "
        "smoothing where "
        "a test does not repeat); the noise floor is the NRMSD of that noise alone."
    ),
    Markup(
        "<b>Search.</b> The search covers the whole box of parameters and keeps every good region, after the "
        "enhanced firefly "
        "algorithm of [1]: moves within clusters, and an archive of the best point of each."
    ),
    Markup(
        "<b>Refinement.</b> Each cluster's best is refined with exact derivatives of the simulation (CasADi [4]) "
        "inside the bounds."
    ),
    Markup(
        "<b>Uncertainty.</b> Around each minimum the posterior is sampled by several independent ensembles of "
        "walkers with the "
        "affine-invariant sampler emcee [2], until they are many autocorrelation times long. R-hat is "
        "rank-normalised and "
        "split, effective sample sizes are bulk values, after [3]. Weights of the solutions come from their "
        "evidences."
    ),
)

_REFERENCES = (
    "Hackl A, Hirschberg W, Lex C, Magele C. Parametrisation of a Maxwell model for transient tyre forces by means "
    "of an "
    "extended firefly algorithm. 2016.",
    "Foreman-Mackey D, Hogg DW, Lang D, Goodman J. emcee: The MCMC Hammer. Publications of the Astronomical "
    "Society of the Pacific "
    "125, 306–312, 2013.",
    "Vehtari A, Gelman A, Simpson D, Carpenter B, Bürkner PC. Rank-normalization, folding, and localization: an "
    "improved R-hat for "
    "assessing convergence of MCMC. Bayesian Analysis 16(2), 667–718, 2021.",
    "Andersson JAE, Gillis J, Horn G, Rawlings JB, Diehl M. CasADi: a software framework for nonlinear "
    "optimization and optimal "
    "control. Mathematical Programming Computation 11(1), 1–36, 2019.",
)


def method_section(run: Run) -> Section:
    """Steps and references."""
    items = Markup("").join(Markup("<li>{}</li>").format(text) for text in _REFERENCES)
    return Section("method", "Method", [*(Text(step) for step in _STEPS), Raw(Markup("<ol>{}</ol>").format(items))])
