"""What the conventions of xarray and ArviZ ask of every variable that is stored."""

import xarray as xr

from mofit.results import OWN_UNIT


def unlabelled(tree: xr.DataTree) -> list[str]:
    """Variables and coordinates of a tree, at any depth, whose unit or name says nothing."""
    return [
        f"{node.path} {name}: {complaint}"
        for node in tree.subtree
        for dataset in [node.to_dataset(inherit=False)]
        for name, variable in dataset.variables.items()
        if (complaint := _complaint(str(name), variable, dataset))
    ]


def _complaint(name: str, variable: xr.Variable, dataset: xr.Dataset) -> str:
    units, words = variable.attrs.get("units"), variable.attrs.get("long_name")
    if not (isinstance(units, str) and units):
        return "no units"
    if not (isinstance(words, str) and words):
        return "no long_name"
    if words == name and ("_" in name or len(name) < 4):  # a plain word such as time means itself
        return "its long_name only repeats its name"
    if units == OWN_UNIT and not set(dataset.coords["unit"].dims) <= set(variable.dims):
        return "no unit beside it"
    return ""
