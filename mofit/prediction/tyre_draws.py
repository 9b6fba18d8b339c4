"""What a run says of a tyre's stiffnesses, for a property file."""

from __future__ import annotations

import xarray as xr

from mofit.errors import InputError
from mofit.models import Model
from mofit.prediction.relaxation import parameter_draws
from mofit.results.fmu.values import condition_starts
from mofit.results.tir_entries import TyreDraws


def tyre_draws(tree: xr.DataTree, model: Model, load: float | None) -> TyreDraws:
    """Draws and verdicts of the parameters of a run, and the loads [N] that they belong to.

    ``load`` is that of the tests where the model does not read it.

    Raises
    ------
    InputError
        If the load is neither read by the model nor given, or both.
    """
    columns = parameter_draws(tree, model).T
    best = tree["modes/m1"].dataset
    found = best["verdict"].values if "verdict" in best else ["not sampled"] * best.sizes["parameter"]
    verdicts = {str(name): str(verdict) for name, verdict in zip(best["parameter"].values, found, strict=True)}
    draws = {parameter.name: column for parameter, column in zip(model.parameters, columns, strict=True)}
    read = "nominal_vertical_force" in {condition.name for condition in model.conditions}
    if read and load is not None:
        raise InputError.of("--load", f"model '{model.name}' reads the load of every test", "Leave it out")
    if read:
        nominal = condition_starts(tree, model)["nominal_vertical_force"].value
        loads: tuple[float, ...] = (nominal, 2 * nominal)
    elif load is None:
        hint = "Give that of the tests: --load '3600 N'"
        raise InputError.of("--to tir", f"model '{model.name}' does not read the vertical force", hint)
    elif not load > 0:
        raise InputError.of("--load", f"{load:g} N is not above 0", "Give the vertical force of the tests")
    else:
        loads = (load,)
    return TyreDraws(draws, verdicts, loads, str(tree.attrs["title"]))
