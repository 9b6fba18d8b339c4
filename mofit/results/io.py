"""The result file of a run: checked against the schema, written atomically, read whole."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import xarray as xr

from mofit.errors import Issue, did_you_mean, raise_errors
from mofit.results.schema import EARLIER, GROUPS, JSON_ATTRIBUTES, LEADS, SAMPLED, SCHEMA, group_at
from mofit.runtime.files import read_tree, write_tree

RESULT_FILE = "result.nc"
#: bytes from which a result is large
_LARGE = 50_000_000

#: predicted tests, which may have any name
_RECORDS = "/held_out/"
_FIREFLIES = "/fireflies/"
_HINT = "Write the run again with this version of mofit"


def is_large(tree: xr.DataTree) -> bool:
    """Whether a tree would take much memory more than once: what can be computed or read later, is then."""
    return sum(node.dataset.nbytes for node in tree.subtree) > _LARGE


def write_result(tree: xr.DataTree, folder: Path | str) -> Path:
    """Write ``result.nc`` (netCDF-4, compressed) of a ``mofit.result/2`` tree into a run folder; returns the file.

    The folder is created if it is not there.

    Raises
    ------
    InputError
        If the tree fails `check_result`; nothing is written then.
    """
    raise_errors(check_result(tree))
    target = Path(folder) / RESULT_FILE
    target.parent.mkdir(parents=True, exist_ok=True)
    # nearly the size of level 9 on sampled signals, several times faster
    write_tree(tree, target, level=1)
    return target


def open_result(source: Path | str) -> xr.DataTree:
    """Read a run wholly into memory; the file is closed again.

    Parameters
    ----------
    source
        A run folder, or its ``result.nc``.

    Raises
    ------
    InputError
        If the file is missing, damaged, or not a ``mofit.result/2`` tree; with all issues.
    """
    path = Path(source)
    if path.is_dir():
        path = path / RESULT_FILE
    loaded = read_tree(path, "Give the folder or result.nc of a finished run, or run the identification again")
    issues = check_result(loaded)
    raise_errors(Issue(f"{path.name}, {issue.where}", issue.message, issue.hint, issue.severity) for issue in issues)
    return loaded


def check_result(tree: xr.DataTree) -> list[Issue]:
    """Compare a tree with the layout of ``mofit.result/2``.

    Returns
    -------
    list of Issue
        Everything that is missing or has other dimensions, and every variable without unit or name; empty if the tree
        is good. Groups and variables beyond the layout are allowed.
    """
    schema = tree.attrs.get("schema", "none")
    if schema in EARLIER:
        return [Issue("result", f"an earlier version of mofit wrote it ('{schema}')", "Run the identification again")]
    if schema != SCHEMA:
        return [Issue("result", f"its schema is '{schema}', not '{SCHEMA}'", "Give the folder or result.nc of a run")]
    return [*_issues(tree)]


def _issues(tree: xr.DataTree) -> Iterator[Issue]:
    for path, group in GROUPS.items():
        if group.required and path != "/" and path[1:] not in tree.children:
            yield Issue(f"group '{path[1:]}'", "it is missing", _HINT)
    for name in JSON_ATTRIBUTES:
        try:
            json.loads(tree.attrs.get(name, "{}"))
        except (TypeError, ValueError) as error:
            yield Issue(f"attribute '{name}'", f"it is not JSON ({error})", _HINT)
    for node in tree.subtree:
        yield from _check_group(node)
        yield from _check_labels(node)
    for mode in tree["modes"].children.values() if "modes" in tree.children else ():
        yield from _check_mode(mode)
    yield from _check_signals(tree)


def _where(node: xr.DataTree) -> str:
    return f"group '{node.path.strip('/') or '/'}'"


def _labels(node: xr.DataTree, dim: str) -> list[str]:
    return [str(label) for label in node.coords[dim].values] if dim in node.coords else []


def _check_group(node: xr.DataTree) -> Iterator[Issue]:
    """Attributes, names and dimensions as the schema has them."""
    group, name_of_group = group_at(node.path)
    for name in group.attributes:
        if name not in node.attrs:
            yield Issue(_where(node), f"attribute '{name}' is missing", _HINT)
    for name, variable in group.variables.items():
        dims = variable.over(name_of_group, "output" in node.coords)
        if name not in node.variables:
            if variable.required:
                hint = did_you_mean(name, map(str, node.data_vars))
                yield Issue(_where(node), f"variable '{name}' is missing", hint)
        elif node[name].dims != dims:
            message = f"its dimensions are {node[name].dims}, not {dims}"
            yield Issue(f"{_where(node)}, variable '{name}'", message, _HINT)


def _check_mode(node: xr.DataTree) -> Iterator[Issue]:
    """With posterior draws a mode has their summary, too, and draws of every parameter."""
    if "posterior" not in node.children:
        return
    for name in SAMPLED:
        if name not in node.variables:
            yield Issue(_where(node), f"it has a posterior but no '{name}'", _HINT)
    posterior = node.children["posterior"]
    for name in _labels(node, "parameter"):
        if name not in posterior.data_vars:
            yield Issue(_where(posterior), f"parameter '{name}' is missing", _HINT)
    for variable_name, variable in posterior.data_vars.items():
        if variable.dims != ("chain", "draw"):
            yield Issue(_where(posterior), f"'{variable_name}' runs over {variable.dims}", _HINT)
    if "sample_stats" not in node.children:
        yield Issue(_where(node), "it has a posterior but no 'sample_stats'", _HINT)


def _check_signals(tree: xr.DataTree) -> Iterator[Issue]:
    """Signals of a test run over ``time_<test>``, and over the outputs where there are several."""
    tests, last = _labels(tree, "test"), ("output",) * ("output" in tree.coords)
    for node in tree.subtree:
        if node.name not in ("observed_data", "prediction", "posterior_predictive") or node.path.startswith(_RECORDS):
            continue
        lead = LEADS[2 if node.name == "posterior_predictive" else 1 if node.path.startswith(_FIREFLIES) else 0]
        for name, variable in node.data_vars.items():
            where = f"{_where(node)}, variable '{name}'"
            if name not in tests:
                yield Issue(where, "no test has this name", did_you_mean(str(name), tests))
            elif variable.dims != (dims := (*lead, f"time_{name}", *last)):
                yield Issue(where, f"its dimensions are {variable.dims}, not {dims}", _HINT)
    if "observed_data" in tree.children:
        for name in set(tests) - set(map(str, tree["observed_data"].data_vars)):
            yield Issue("group 'observed_data'", f"test '{name}' is missing", _HINT)


def _check_labels(node: xr.DataTree) -> Iterator[Issue]:
    """Every variable has a unit and a name, and holds numbers or strings."""
    dataset = node.to_dataset(inherit=False)
    for name, variable in dataset.variables.items():
        if name in dataset.dims and not str(name).startswith("time"):
            continue
        where = f"{_where(node)}, variable '{name}'"
        for label in ("units", "long_name"):
            if not isinstance(variable.attrs.get(label), str) or not variable.attrs[label]:
                yield Issue(where, f"it has no {label}", "Label it")
        if variable.dtype.kind == "O" and not all(isinstance(v, str) for v in np.ravel(variable.values)):
            yield Issue(where, "it holds Python objects", "Give numbers or strings")
