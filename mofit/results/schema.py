"""What a ``mofit.result/2`` tree holds: the names, dimensions, units and descriptions of its variables."""

from __future__ import annotations

from collections.abc import Mapping

from mofit.results.layout import OWN_UNIT, Group, Variable
from mofit.results.layout import optional as _optional
from mofit.results.prediction_schema import HELD_OUT, RECORD

SCHEMA = "mofit.result/2"
EARLIER = ("mofit.result/1",)

#: what the labels along a dimension are
AXES = {
    "parameter": "parameter of the model",
    "parameter_": "parameter of the model, second axis of a matrix",
    "parameter_baseline": "parameter of the baseline model",
    "parameter_scoped": "parameter with a value per test or condition",
    "condition": "condition of the tests that the model reads",
    "test": "test of the campaign",
    "output": "output of the model",
    "objective": "test whose NRMSD is an objective of the search",
    "chain": "independent ensemble of walkers",
    "draw": "draw from the posterior within its ensemble",
    "checkpoint": "evaluations of the search so far",
    "record": "predicted test",
    "law": "parameter over a condition",
    "candidate": "law that could be",
    "firefly": "firefly of the last generation, the best first",
    "cell": "combination of conditions",
}

#: dimensions of a signal before its time, by their number
LEADS = ((), ("firefly",), ("chain", "draw"))
#: attributes of the root that hold JSON
JSON_ATTRIBUTES = ("configuration", "library_versions", "seconds", "evaluations", "warnings")

_ROOT = Group(
    {
        "excitation": Variable("test", "1", "type of excitation"),
        "frequency": Variable("test", "Hz", "frequency on the label"),
        "amplitude": Variable("test", "", "amplitude on the label"),
        "period": Variable("test", "s", "period found in the data"),
        "periods": Variable("test", "1", "whole periods"),
        "transient": Variable("test", "s", "time at the start that is not used"),
        "noise_sd": Variable("test [output]", "", "standard deviation of the output's noise"),
        "noise_floor": Variable("test [output]", "1", "NRMSD of the noise alone"),
        "range": Variable("test [output]", "", "peak-to-peak of the output"),
        "weight": Variable("test [output]", "1", "weight in the search"),
        "gap": _optional("", "1", "NRMSD that the model misses, common to all tests"),
        "effective_samples": _optional("test [output]", "1", "number of independent residuals"),
    },
    (
        *("schema", "title", "mofit_version", "created", "seed", "model", "model_title", "campaign_title"),
        *("campaign_source", "configuration_hash", "campaign_hash", "converged", *JSON_ATTRIBUTES),
    ),
    required=True,
)
_PARAMETERS = Group(
    {
        "lower": Variable("parameter", OWN_UNIT, "lower bound"),
        "upper": Variable("parameter", OWN_UNIT, "upper bound"),
        "nominal": Variable("parameter", OWN_UNIT, "nominal value"),
        "unit": Variable("parameter", "1", "SI unit of the parameter"),
        "scale": Variable("parameter", "1", "scale that is searched: linear or log"),
        "role": Variable("parameter", "1", "stage that identifies it first"),
        "description": Variable("parameter", "1", "meaning"),
    },
    required=True,
)
_CONDITIONS = Group({"value": Variable("test condition", OWN_UNIT, "value in this test")})
_SEARCH = Group(
    {
        "points": Variable("evaluation parameter", OWN_UNIT, "evaluated points"),
        "nrmsd": Variable("evaluation objective", "1", "NRMSD per test"),
        "archived": _optional("archive parameter", OWN_UNIT, "archived minima"),
        "archived_cost": _optional("archive", "1", "weighted mean NRMSD"),
        "found_by": _optional("archive", "1", "stage of the search that found it"),
        "minimises": _optional("archive", "1", "objective of which it is a minimum; empty for the weighted mean"),
        "population": _optional("member parameter", OWN_UNIT, "final population"),
        "generations": _optional("generation member parameter", OWN_UNIT, "fireflies of every generation"),
        "cluster": _optional("generation member", "1", "cluster of the firefly, the best one 0, -1 for none"),
        "best": _optional("checkpoint", "1", "least weighted mean NRMSD"),
        "hypervolume": _optional(
            "checkpoint", "1", "dominated share of the box from best to median of every objective"
        ),
    },
    ("method", "evaluations"),
)
_FRONT = Group(
    {
        "nrmsd": Variable("point objective", "1", "NRMSD per test"),
        "parameters": Variable("point parameter", OWN_UNIT, "non-dominated points"),
    }
)
_FIREFLIES = Group(
    {
        "value": Variable("firefly parameter", OWN_UNIT, "place of the firefly"),
        "nrmsd": Variable("firefly objective", "1", "NRMSD per test"),
    }
)
_MINIMA = Group(
    {
        "value": Variable("minimum parameter", OWN_UNIT, "refined minimum"),
        "nrmsd": Variable("minimum test [output]", "1", "NRMSD per test"),
        "log_posterior": Variable("minimum", "1", "log posterior density"),
        "at_bound": Variable("minimum parameter", "1", "-1 at the lower, 1 at the upper bound"),
        "found_by": _optional("minimum", "1", "stage of the search that found it"),
    }
)
#: what a mode with posterior draws must have
SAMPLED = ("mean", "sd", "q05", "q50", "q95", "ess", "r_hat", "tau", "contraction", "verdict")
_MODE = Group(
    {
        "value": Variable("parameter", OWN_UNIT, "MAP estimate"),
        "at_bound": Variable("parameter", "1", "-1 at the lower, 1 at the upper bound"),
        "nrmsd": Variable("test [output]", "1", "NRMSD at the MAP estimate"),
        "laplace_sd": _optional("parameter", OWN_UNIT, "standard deviation (Laplace)"),
        "laplace_correlation": _optional("parameter parameter_", "1", "correlation (Laplace)"),
        "noise_sd": _optional("parameter", OWN_UNIT, "standard deviation by noise alone, without gap (Laplace)"),
        "mean": _optional("parameter", OWN_UNIT, "posterior mean"),
        "sd": _optional("parameter", OWN_UNIT, "posterior standard deviation"),
        "q05": _optional("parameter", OWN_UNIT, "5 % quantile"),
        "q50": _optional("parameter", OWN_UNIT, "median"),
        "q95": _optional("parameter", OWN_UNIT, "95 % quantile"),
        "ess": _optional("parameter", "1", "effective sample size"),
        "r_hat": _optional("parameter", "1", "split R-hat between ensembles"),
        "tau": _optional("parameter", "1", "integrated autocorrelation time in steps"),
        "contraction": _optional("parameter", "1", "1 - posterior sd / prior sd"),
        "verdict": _optional("parameter", "1", "identifiability"),
        "leverage": _optional(
            "test [output] parameter", "1", "relative change of NRMSD per standard deviation of the parameter"
        ),
    },
    ("log_evidence", "probability", "log_posterior", "converged", "evaluations"),
)
_SCOPED = Group(
    {
        "value": Variable("test parameter_scoped", OWN_UNIT, "estimate in this test"),
        "sd": Variable("test parameter_scoped", OWN_UNIT, "standard deviation (Laplace)"),
        "at_bound": Variable("test parameter_scoped", "1", "-1 at the lower, 1 at the upper end of the range"),
        "label": Variable("test parameter_scoped", "1", "what has this value: a test, or a condition with its value"),
        "lower": Variable("parameter_scoped", OWN_UNIT, "lower end of the range"),
        "upper": Variable("parameter_scoped", OWN_UNIT, "upper end of the range"),
        "description": Variable("parameter_scoped", "1", "meaning"),
    }
)
_PROFILE = Group(
    {
        "value": Variable("parameter point", OWN_UNIT, "fixed value"),
        "neg_log_posterior": Variable("parameter point", "1", "negative log posterior above that of the MAP estimate"),
        "converged": _optional("parameter point", "1", "1 where the minimisation over the others converged"),
    }
)
_SAMPLE_STATS = Group(
    {
        "lp": Variable("chain draw", "1", "log posterior density"),
        "walker": Variable("chain draw", "1", "walker in its ensemble"),
        "step": Variable("chain draw", "1", "step of the ensemble"),
    },
    ("acceptance",),
)
_MIXTURE = Group(
    {
        "mean": Variable("parameter", OWN_UNIT, "mean over all modes"),
        "sd": Variable("parameter", OWN_UNIT, "standard deviation over all modes"),
        "q05": Variable("parameter", OWN_UNIT, "5 % quantile over all modes"),
        "q50": Variable("parameter", OWN_UNIT, "median over all modes"),
        "q95": Variable("parameter", OWN_UNIT, "95 % quantile over all modes"),
    }
)
_PER_FREQUENCY = Group(
    {
        "value": Variable("test minimum parameter", OWN_UNIT, "minimum of this test alone"),
        "nrmsd": Variable("test minimum [output]", "1", "NRMSD of this test"),
        "sd": _optional("test minimum parameter", OWN_UNIT, "standard deviation (Laplace)"),
    }
)
_BASELINE = Group(
    {
        "value": Variable("parameter_baseline", OWN_UNIT, "MAP estimate"),
        "nrmsd": Variable("test [output]", "1", "NRMSD per test"),
    },
    ("model", "model_title"),
)
_CALIBRATION = Group(
    {
        "value": Variable("parameter_{stage}", OWN_UNIT, "estimate"),
        "sd": Variable("parameter_{stage}", OWN_UNIT, "standard deviation"),
        "x": Variable("sample", "", ""),
        "measured": Variable("sample", "", ""),
        "fitted": Variable("sample", "", ""),
        "nrmsd": Variable("", "1", "mean NRMSD of the stage"),
    },
    ("model", "tests"),
)
_LAWS = Group(
    {
        "parameter": Variable("law", "1", "parameter"),
        "condition": Variable("law", "1", "condition"),
        "form": Variable("law", "1", "law"),
        "centre": Variable("law", OWN_UNIT, "middle of the condition's range"),
        "half_range": Variable("law", OWN_UNIT, "half the width of the condition's range"),
        "log_evidence": Variable("law candidate", "1", "log evidence relative to the law"),
    },
    ("conditions", "chi_square", "freedom", "evaluations"),
)
_CELLS = Group(
    {
        "value": Variable("cell parameter", OWN_UNIT, "estimate of this combination alone"),
        "sd": Variable("cell parameter", OWN_UNIT, "its standard deviation (Laplace)"),
        "law_low": Variable("cell parameter", OWN_UNIT, "5 % quantile of the law here"),
        "law_median": Variable("cell parameter", OWN_UNIT, "median of the law here"),
        "law_high": Variable("cell parameter", OWN_UNIT, "95 % quantile of the law here"),
        "tests": Variable("cell", "1", "tests of this combination"),
    }
)
_CURVE = Group(
    {
        "at": Variable("point", "", ""),
        "low": Variable("point", "", "5 % quantile"),
        "median": Variable("point", "", "median"),
        "high": Variable("point", "", "95 % quantile"),
    },
    ("title",),
)
_MAP = Group(
    {
        "x": Variable("column", "", ""),
        "y": Variable("row", "", ""),
        "low": Variable("row column", "", "5 % quantile"),
        "median": Variable("row column", "", "median"),
        "high": Variable("row column", "", "95 % quantile"),
    },
    ("x", "y"),
)
_POPULATIONS = Group(
    {
        "mean": Variable("parameter", OWN_UNIT, "mean over the specimens"),
        "mean_low": Variable("parameter", OWN_UNIT, "5 % quantile of the mean"),
        "mean_high": Variable("parameter", OWN_UNIT, "95 % quantile of the mean"),
        "spread": Variable("parameter", OWN_UNIT, "standard deviation over the specimens; 1 of a logarithm"),
        "spread_low": Variable("parameter", OWN_UNIT, "5 % quantile of the spread"),
        "spread_high": Variable("parameter", OWN_UNIT, "95 % quantile of the spread"),
        "of_logarithm": Variable("parameter", "1", "1 where the spread is that of the logarithm"),
    },
    ("specimens", "outliers"),
)
#: every group by its path; ``*`` is the name of a mode, of a calibration stage or of a predicted test
GROUPS: Mapping[str, Group] = {
    "/": _ROOT,
    "/parameters": _PARAMETERS,
    "/conditions": _CONDITIONS,
    "/search": _SEARCH,
    "/front": _FRONT,
    "/fireflies": _FIREFLIES,
    "/minima": _MINIMA,
    "/per_frequency": _PER_FREQUENCY,
    "/baseline": _BASELINE,
    "/calibration/*": _CALIBRATION,
    "/laws": _LAWS,
    "/laws/cells": _CELLS,
    "/laws/populations": _POPULATIONS,
    "/laws/curves/*/*": _CURVE,
    "/laws/maps/*": _MAP,
    "/modes": Group(required=True),
    "/modes/*": _MODE,
    "/modes/*/scoped": _SCOPED,
    "/modes/*/profile": _PROFILE,
    "/modes/*/sample_stats": _SAMPLE_STATS,
    "/mixture": _MIXTURE,
    "/mixture/sample_stats": Group({"mode": Variable("chain draw", "1", "number of the mode: 2 is m2")}),
    "/held_out": HELD_OUT,
    "/held_out/tests/*": RECORD,
    "/observed_data": Group(required=True),
    "/constant_data": Group(required=True),
}


def group_at(path: str) -> tuple[Group, str]:
    """The group of a path, and the name of its mode or stage; an unknown group is empty."""
    parts = path.strip("/").split("/")
    if parts[:2] == ["held_out", "tests"] and len(parts) == 3:
        return RECORD, parts[2]
    if parts[:2] == ["laws", "curves"] and len(parts) == 4:
        return _CURVE, parts[2]
    if parts[:2] == ["laws", "maps"] and len(parts) == 3:
        return _MAP, parts[2]
    name = parts[1] if parts[0] in ("modes", "calibration") and len(parts) > 1 else ""
    key = "/" + "/".join([parts[0], "*", *parts[2:]] if name else parts)
    return GROUPS.get(key, Group()), name
