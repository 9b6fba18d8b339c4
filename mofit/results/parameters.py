"""The parameters of a result: bounds, scale and fixed values, as a layout."""

from __future__ import annotations

import json

import numpy as np
import xarray as xr

from mofit.parameters import Parameter, ParameterLayout, ParameterSpace


def parameter_layout(tree: xr.DataTree) -> ParameterLayout:
    """The free parameters of a result with their unit cube, and those that were fixed; free ones come first.

    Parameters
    ----------
    tree
        A ``mofit.result/2`` tree.
    """
    table = tree["parameters"].dataset
    texts = ("parameter", "unit", "scale", "description")
    columns = [[str(text) for text in table[name].values] for name in texts]
    bounds = np.stack([table[name].values for name in ("lower", "upper", "nominal")], axis=1)
    space = ParameterSpace(
        tuple(
            Parameter(name, unit, low, high, nominal, "log" if scale == "log" else "linear", description)
            for name, unit, scale, description, (low, high, nominal) in zip(*columns, bounds.tolist(), strict=True)
        )
    )
    fixed = fixed_values(tree)
    return ParameterLayout((*space.names, *fixed), space, fixed)


def fixed_values(tree: xr.DataTree) -> dict[str, float]:
    """Parameters that the run did not identify, with the values it fixed them at (``--fix``)."""
    return {name: float(value) for name, value in json.loads(tree.attrs["configuration"]).get("fixed", {}).items()}
