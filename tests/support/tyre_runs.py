"""Runs of tyre models with known draws, valid as results; their simulations mean nothing."""

import json
from collections.abc import Mapping, Sequence

import numpy as np
import xarray as xr
from result_trees import make_result
from synthetic_rigs import Rig, Trial

from mofit.models import build_system, find_model
from mofit.results import quantity

TRUE = {
    "dF0": 62e3, "s_M": 0.13, "F_M": 3100.0, "c_y": 121_819.0, "p_y": -7.547, "d_y": 281.0, "c_M": 19_910.0,
    "d_M": 7_535.0, "dF0_N": 66e3, "dF0_2N": 115e3, "c_y_N": 120e3, "c_y_2N": 132e3,
    "dF0_x": 95e3, "c_x": 300e3,
}  # fmt: skip
SPEED = 60 / 3.6


def tyre_run(
    name: str, conditions: Sequence[Mapping[str, float]], not_identified: Sequence[str] = (), sd: float = 0.01
) -> xr.DataTree:
    """A run of a tyre model at its `TRUE` values with independent draws of a relative standard deviation.

    One test per entry of ``conditions``; slip goes up to 0.07.
    """
    model = find_model(name)
    time = np.arange(0.0, 2.0, 0.05)
    slip = 0.07 * np.sin(np.pi * time)
    tests = tuple(Trial(f"test_{k}", "free", np.nan, np.nan, time, slip) for k in range(len(conditions)))
    source, output, free = model.inputs[0], model.outputs[0], model.parameters
    truth = np.array([TRUE.get(p.name, p.nominal) for p in free])
    rig = Rig(
        "Tyre rig", (source.name, source.unit), (output.name, output.unit), tests,
        tuple(p.name for p in free), tuple(p.unit for p in free), tuple(p.scale for p in free),
        np.array([p.lower for p in free]), np.array([p.upper for p in free]), truth,
        lambda trial, p: trial.input * p[0],
    )  # fmt: skip
    tree = make_result(rig, clusters=1, optional=False, steps=12)
    configuration = {"equations": build_system(model).hash(), "fixed": {}}
    tree.attrs |= {"model": name, "title": "tyre $ rig", "configuration": json.dumps(configuration)}
    mode = tree["modes/m1"]
    verdicts = ["not identifiable" if p.name in not_identified else "identified" for p in free]
    mode["verdict"] = mode["verdict"].copy(data=verdicts)
    rng, draws = np.random.default_rng(1), mode["posterior"].dataset
    for k, parameter in enumerate(free):
        values = truth[k] * (1 + sd * rng.normal(size=draws[parameter.name].shape))
        mode[f"posterior/{parameter.name}"] = draws[parameter.name].copy(data=values)
    given = [[own.get(c.name, c.default) for c in model.conditions] for own in conditions]
    axes = {
        "test": quantity("test", [one.name for one in tests], "1", "test"),
        "condition": quantity("condition", [c.name for c in model.conditions], "1", "condition"),
        "unit": quantity("condition", [c.unit for c in model.conditions], "1", "SI unit of the condition"),
    }
    values = quantity(("test", "condition"), given, "1", "value in this test")
    tree["conditions"] = xr.DataTree(xr.Dataset({"value": values}, axes))
    return tree
