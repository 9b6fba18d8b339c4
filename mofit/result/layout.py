"""What a ``mofit.result/1`` tree holds: its groups, variables and dimensions, and the check against them."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
import xarray as xr

from mofit.errors import Fault, did_you_mean

SCHEMA = "mofit.result/1"

_CURE = "Write the run again with this version of mofit"


@dataclass(frozen=True)
class Group:
    """Required and optional variables of a group (name to dimensions) and its required attributes."""

    required: dict[str, tuple[str, ...]] = field(default_factory=dict)
    optional: dict[str, tuple[str, ...]] = field(default_factory=dict)
    attributes: tuple[str, ...] = ()


def _over(dims: str, names: str) -> dict[str, tuple[str, ...]]:
    return {name: tuple(dims.split()) for name in names.split()}


ROOT = Group(
    required=_over("test", "kind frequency amplitude period periods transient noise_sd noise_floor range weight"),
    attributes=tuple(
        "schema title mofit_version created seed model model_title campaign_title campaign_source configuration "
        "configuration_hash campaign_hash library_versions converged seconds evaluations warnings".split()
    ),
)
JSON_ATTRIBUTES = ("configuration", "library_versions", "seconds", "evaluations", "warnings")
PARAMETERS = Group(required=_over("parameter", "lower upper nominal unit scale role description"))
SEARCH = Group(
    required=_over("evaluation parameter", "points") | _over("evaluation objective", "nrmsd"),
    optional=_over("stored parameter", "stored")
    | _over("stored", "stored_cost")
    | _over("checkpoint", "hypervolume best")
    | _over("firefly parameter", "fireflies"),
    attributes=("method", "evaluations"),
)
FRONT = Group(required=_over("point objective", "nrmsd") | _over("point parameter", "parameters"))
CLUSTER = Group(
    required=_over("parameter", "value at_bound") | _over("test", "nrmsd"),
    optional=_over("parameter", "laplace_sd mean sd q05 q50 q95 ess r_hat tau contraction verdict")
    | _over("parameter parameter_", "laplace_correlation")
    | _over("test parameter", "pull"),
    attributes=("log_evidence", "weight", "log_posterior", "converged", "evaluations"),
)
SAMPLED = tuple("mean sd q05 q50 q95 ess r_hat tau contraction verdict".split())
MIXTURE = Group(required=_over("parameter", "mean sd q05 q50 q95"))
PROFILE = Group(required=_over("parameter point", "value nll"))
SAMPLE_STATS = Group(required=_over("chain draw", "lp walker step"), attributes=("acceptance",))
PER_FREQUENCY = Group(
    required=_over("test minimum parameter", "value") | _over("test minimum", "nrmsd"),
    optional=_over("test minimum parameter", "sd"),
)
BASELINE = Group(
    required=_over("parameter_baseline", "value") | _over("test", "nrmsd"), attributes=("model", "model_title")
)


def calibration_group(stage: str) -> Group:
    """Layout of one calibration stage; its parameter dimension carries the stage's name."""
    return Group(
        required=_over(f"parameter_{stage}", "value sd") | _over("sample", "x measured fitted") | _over("", "nrmsd"),
        attributes=("model", "tests"),
    )


def check_result(tree: xr.DataTree) -> list[Fault]:
    """Compare a tree with the layout of ``mofit.result/1``.

    Returns
    -------
    list of Fault
        Everything that is missing or has other dimensions, and every variable without unit or name; empty if the tree
        is good. Groups and variables beyond the layout are welcome.
    """
    schema = tree.attrs.get("schema", "none")
    if schema != SCHEMA:
        return [Fault("result", f"its schema is '{schema}', not '{SCHEMA}'", "Give the folder or result.nc of a run")]
    return [*_faults(tree)]


def _faults(tree: xr.DataTree) -> Iterator[Fault]:
    yield from _check_group(tree, "", ROOT)
    yield from _check_json(tree)
    for path, group, needed in (
        ("parameters", PARAMETERS, True),
        ("search", SEARCH, False),
        ("front", FRONT, False),
        ("per_frequency", PER_FREQUENCY, False),
        ("baseline", BASELINE, False),
        ("mixture", MIXTURE, False),
        ("clusters", Group(), True),
        ("observed_data", Group(), True),
        ("constant_data", Group(), True),
    ):
        if path in tree.children:
            yield from _check_group(tree.children[path], path, group)
        elif needed:
            yield Fault(f"group '{path}'", "it is missing", _CURE)
    for name, cluster in _children(tree, "clusters"):
        yield from _check_cluster(cluster, f"clusters/{name}")
    for name, stage in _children(tree, "calibration"):
        yield from _check_group(stage, f"calibration/{name}", calibration_group(name))
    yield from _check_signals(tree)
    yield from _check_labels(tree)


def _children(tree: xr.DataTree, path: str) -> list[tuple[str, xr.DataTree]]:
    return list(tree[path].children.items()) if path in tree.children else []


def _labels(node: xr.DataTree, dim: str) -> list[str]:
    return [str(label) for label in node.coords[dim].values] if dim in node.coords else []


def _check_group(node: xr.DataTree, path: str, group: Group) -> Iterator[Fault]:
    where = f"group '{path or '/'}'"
    for name in group.attributes:
        if name not in node.attrs:
            yield Fault(where, f"attribute '{name}' is missing", _CURE)
    for name, dims in (group.required | group.optional).items():
        if name not in node.variables:
            if name in group.required:
                yield Fault(where, f"variable '{name}' is missing", did_you_mean(name, map(str, node.data_vars)))
        elif node[name].dims != dims:
            yield Fault(f"{where}, variable '{name}'", f"its dimensions are {node[name].dims}, not {dims}", _CURE)


def _check_json(tree: xr.DataTree) -> Iterator[Fault]:
    for name in JSON_ATTRIBUTES:
        try:
            json.loads(tree.attrs.get(name, "{}"))
        except (TypeError, ValueError) as error:
            yield Fault(f"attribute '{name}'", f"it is not JSON ({error})", _CURE)


def _check_cluster(node: xr.DataTree, path: str) -> Iterator[Fault]:
    yield from _check_group(node, path, CLUSTER)
    if "posterior" not in node.children:
        return
    for name in SAMPLED:
        if name not in node.variables:
            yield Fault(f"group '{path}'", f"it has a posterior but no '{name}'", _CURE)
    posterior = node.children["posterior"]
    for name in _labels(node, "parameter"):
        if name not in posterior.data_vars:
            yield Fault(f"group '{path}/posterior'", f"parameter '{name}' is missing", _CURE)
    for variable_name, variable in posterior.data_vars.items():
        if variable.dims != ("chain", "draw"):
            yield Fault(f"group '{path}/posterior'", f"'{variable_name}' runs over {variable.dims}", _CURE)
    if "sample_stats" in node.children:
        yield from _check_group(node.children["sample_stats"], f"{path}/sample_stats", SAMPLE_STATS)
    else:
        yield Fault(f"group '{path}'", "it has a posterior but no 'sample_stats'", _CURE)
    if "profile" in node.children:
        yield from _check_group(node.children["profile"], f"{path}/profile", PROFILE)


def _check_signals(tree: xr.DataTree) -> Iterator[Fault]:
    """Signals of a test run over ``time_<test>``, which has the unit s."""
    tests = _labels(tree, "test")
    for node in tree.subtree:
        if node.name not in ("observed_data", "prediction", "posterior_predictive"):
            continue
        lead = ("chain", "draw") if node.name == "posterior_predictive" else ()
        for name, variable in node.data_vars.items():
            where = f"group '{node.path}', variable '{name}'"
            if name not in tests:
                yield Fault(where, "no test has this name", did_you_mean(str(name), tests))
            elif variable.dims != (*lead, f"time_{name}"):
                yield Fault(where, f"its dimensions are {variable.dims}, not {(*lead, f'time_{name}')}", _CURE)
    if "observed_data" in tree.children:
        for name in set(tests) - set(map(str, tree["observed_data"].data_vars)):
            yield Fault("group 'observed_data'", f"test '{name}' is missing", _CURE)


def _check_labels(tree: xr.DataTree) -> Iterator[Fault]:
    for node in tree.subtree:
        dataset = node.to_dataset(inherit=False)
        for name, variable in dataset.variables.items():
            if name in dataset.dims and not str(name).startswith("time"):
                continue
            for label in ("units", "long_name"):
                if not isinstance(variable.attrs.get(label), str) or not variable.attrs[label]:
                    yield Fault(f"group '{node.path}', variable '{name}'", f"it has no {label}", "Label it")
            if variable.dtype.kind == "O" and not all(isinstance(v, str) for v in np.ravel(variable.values)):
                yield Fault(
                    f"group '{node.path}', variable '{name}'", "it holds Python objects", "Give numbers or strings"
                )
