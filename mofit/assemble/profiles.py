"""The profile likelihood of one mode as a group of the result tree."""

from __future__ import annotations

import numpy as np
import xarray as xr

from mofit.parameters import ParameterSpace
from mofit.profiles import Profile
from mofit.result import OWN_UNIT, parameter_axis, quantity


def profile_group(space: ParameterSpace, found: Profile) -> xr.Dataset:
    """What ``/clusters/<id>/profile`` holds: values and negative log posterior over (parameter, point).

    Parameters
    ----------
    space
        The free parameters.
    found
        Their profiles in its unit cube.
    """
    held = np.stack([space.from_unit(points)[:, k] for k, points in enumerate(found.points)])
    dims = ("parameter", "point")
    return xr.Dataset(
        {
            "value": quantity(dims, held, OWN_UNIT, "held value"),
            "nll": quantity(dims, found.nll, "1", "negative log posterior relative to the minimum, the others free"),
            "converged": quantity(dims, found.converged.astype(np.int8), "1", "1 where the others are at their best"),
        },
        parameter_axis(space.names, space.units),
    )
