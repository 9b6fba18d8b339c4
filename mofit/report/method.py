"""How a result came about: the provenance of the run, and the method of both pages with its sources."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from markupsafe import Markup

from mofit.report.convergence import ESS_LIMIT, LENGTH_LIMIT, R_HAT_LIMIT
from mofit.report.directions import FLAT, STRONG
from mofit.report.run import Run
from mofit.report.toolkit.blocks import Block, Column, Details, Section, Table, method_section, words
from mofit.report.toolkit.formatting import count, number, whole_percent

_FACTS = {
    "model": "Model",
    "campaign_title": "Campaign",
    "campaign_source": "Source of the data",
    "campaign_hash": "Campaign hash",
    "configuration_hash": "Configuration hash",
    "seed": "Seed",
    "mofit_version": "mofit version",
    "created": "Created",
}
_EMCEE = (
    "Foreman-Mackey D, Hogg DW, Lang D, Goodman J. emcee: The MCMC Hammer. Publications of the Astronomical Society of "
    "the Pacific 125, 306–312, 2013."
)
_R_HAT = (
    "Vehtari A, Gelman A, Simpson D, Carpenter B, Bürkner PC. Rank-normalization, folding, and localization: an "
    "improved R-hat for assessing convergence of MCMC. Bayesian Analysis 16(2), 667–718, 2021."
)


def _flattened(value: Any, path: str = "") -> Iterator[tuple[str, str]]:
    """Nested settings as (dotted name, text) pairs."""
    if isinstance(value, Mapping):
        for name, item in value.items():
            yield from _flattened(item, f"{path}.{name}" if path else str(name))
    elif isinstance(value, list):
        yield path, ", ".join(map(str, value)) or "–"
    else:
        yield path, "–" if value is None else str(value)


def provenance_section(run: Run) -> Section:
    """Facts, seconds and evaluations per stage, settings, versions."""
    facts = {name: str(run.tree.attrs[name]) for name in _FACTS}
    seconds, evaluations = run.json("seconds"), run.json("evaluations")
    configuration, versions = run.json("configuration"), run.json("library_versions")
    stages = list(dict.fromkeys([*seconds, *evaluations]))
    work = Table(
        [
            Column("Stage", stages),
            Column("Seconds", [number(float(seconds[stage])) if stage in seconds else "–" for stage in stages]),
            Column("Evaluations", [count(evaluations[s]) if s in evaluations else "–" for s in stages]),
        ],
        "Wall time and model evaluations (one evaluation: all tests once).",
    )
    blocks: list[Block] = [
        _pairs("", "", zip(_FACTS.values(), facts.values(), strict=True)),
        work,
        Details("Settings", [_pairs("Setting", "Value", _flattened(configuration))]),
        Details("Library versions", [_pairs("Library", "Version", _flattened(versions))]),
    ]
    data = {"facts": facts, "seconds": seconds, "evaluations": evaluations, "configuration": configuration}
    return Section("provenance", "Provenance", blocks, data | {"versions": versions})


def _pairs(name: str, value: str, rows: Iterable[tuple[str, str]]) -> Table:
    """A table of two columns, of which the second may break into lines anywhere."""
    cell = Markup('<span style="white-space:normal;overflow-wrap:anywhere">{}</span>')
    names, values = zip(*rows, strict=True)
    return Table([Column(name, names), words(value, [cell.format(text) for text in values])])


def run_method_section(run: Run) -> Section:
    """Of the report."""
    return method_section(
        {
            "Error measure": "Every test is one objective: NRMSD = √(mean of (measured − simulated)²) / (max − min of "
            "the measured output), eq. (10) of [1]. Samples before the steady oscillation are left out.",
            "Noise floor": "The noise is estimated from the differences between repeated periods, or by local "
            "smoothing where a test does not repeat. The noise floor is the NRMSD of that noise alone.",
            **_search_method(run),
            "Refinement": "Each archived minimum is refined with exact derivatives of the simulation (CasADi [4]) "
            "inside the bounds. The result is a MAP estimate; distinct ones are the posterior modes.",
            "Uncertainty": "Around each mode several independent ensembles of walkers sample the posterior with the "
            f"affine-invariant sampler emcee [2], until they are {count(LENGTH_LIMIT)} autocorrelation times long, "
            f"with {count(ESS_LIMIT)} effective samples and R-hat below {R_HAT_LIMIT}. R-hat is rank-normalised and "
            "split, effective sample sizes are bulk values, after [3]."
            " The probability of a mode follows from its evidence.",
        },
        (
            "Hackl A, Hirschberg W, Lex C, Magele C. Parametrisation of a Maxwell model for transient tyre forces by "
            "means of an extended firefly algorithm. 2016.",
            _EMCEE,
            _R_HAT,
            "Andersson JAE, Gillis J, Horn G, Rawlings JB, Diehl M. CasADi: a software framework for nonlinear "
            "optimization and optimal control. Mathematical Programming Computation 11(1), 1–36, 2019.",
        ),
    )


def _search_method(run: Run) -> dict[str, str]:
    """What the search of this run does."""
    node = run.group("search")
    if node is None:
        return {}
    text = f"{node.attrs['method']}: {node.attrs.get('description', '')} It searches the whole prior box."
    if "generations" in node.data_vars:
        text += (
            " Fireflies start on a Sobol sample. Each sees the error of a point with its own weights over the tests, "
            "and flies towards the centre of its cluster, after [1]. Gradient descents start from the centres of the "
            "clusters of all points. The completion draws more points and starts descents outside of the basins that "
            "are known, until the expected number of undiscovered minima falls below 0.01 or the budget is spent."
        )
    return {"Search": text}


def uncertainty_method_section(run: Run) -> Section:
    """Of the uncertainty page."""
    return method_section(
        {
            "Draws": "The posterior is the likelihood of the residuals times the prior: uniform within the bounds in "
            "the scale of the search, and Gaussian for what calibration stages estimated. Independent ensembles of "
            "walkers [1] sample it around each mode. Means, standard deviations and intervals are those of the draws; "
            "a 90 % interval runs from their 5 % to their 95 % quantile.",
            "Contraction and verdict": "Contraction is 1 − posterior sd / prior sd, both in the prior box. A verdict "
            "is “identified” above 50 %, “not identifiable” below 10 %, and “limit only” where a bound truncates the "
            "posterior.",
            "Profile likelihood": "One parameter is fixed at a grid of values within three standard deviations, and "
            "all others are optimised again with exact gradients [2]. The 90 % interval ends where the negative log "
            "posterior has risen by 1.35, half the quantile of χ² with one degree of freedom.",
            "Directions": "Eigenvectors of the covariance of the draws in the prior box. The data do not identify a "
            f"direction that keeps more than {whole_percent(FLAT)} of the prior's standard deviation. Pairs correlated "
            f"by more than {STRONG} are listed.",
            "Predictive bands": "The model is simulated at some of the draws. A band for a new measurement adds the "
            "noise of the test to their standard deviation. Amplitude and phase of the fundamental are least-squares "
            "fits over whole periods; their uncertainty follows from the scatter from period to period.",
            "Homogeneity": "Estimates of single tests, with the standard deviation from the curvature at their "
            "minimum, are pooled by inverse variance. Cochran's Q [3] is compared with χ²; I² [4] is the share of the "
            "scatter that the standard deviations do not explain. Estimates at a bound, or about as wide as the prior "
            "box, are left out: their distribution is not Gaussian.",
            "Convergence": "R-hat is rank-normalised and split, effective sample sizes are bulk values [5]; "
            "autocorrelation times are the integrated ones of the ensembles [1].",
        },
        (
            _EMCEE,
            "Raue A, Kreutz C, Maiwald T, Bachmann J, Schilling M, Klingmüller U, Timmer J. Structural and practical "
            "identifiability analysis of partially observed dynamical models by exploiting the profile likelihood. "
            "Bioinformatics 25(15), 1923–1929, 2009.",
            "Cochran WG. The combination of estimates from different experiments. Biometrics 10(1), 101–129, 1954.",
            "Higgins JPT, Thompson SG. Quantifying heterogeneity in a meta-analysis. Statistics in Medicine 21(11), "
            "1539–1558, 2002.",
            _R_HAT,
        ),
    )
