"""The objectives of a result: its tests, or of several outputs the pairs of a test and an output measured in it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr

from mofit._typing import FloatArray


@dataclass(frozen=True)
class Objective:
    """A test, and its output where the model has several; by place and by name."""

    test: int
    name_of_test: str
    output: int | None = None
    name_of_output: str = ""

    @property
    def name(self) -> str:
        """``test``, or ``test / output``."""
        return f"{self.name_of_test} / {self.name_of_output}" if self.name_of_output else self.name_of_test


def objectives(tree: xr.DataTree) -> list[Objective]:
    """All objectives of a ``mofit.result/2`` tree, test by test."""
    tests = [str(label) for label in tree.coords["test"].values]
    if "output" not in tree.coords:
        return [Objective(k, test) for k, test in enumerate(tests)]
    measured = np.isfinite(np.asarray(tree.dataset["range"].values, dtype=float))
    outputs = [str(label) for label in tree.coords["output"].values]
    return [Objective(int(k), tests[k], int(i), outputs[i]) for k, i in np.argwhere(measured)]


def per_objective(tree: xr.DataTree, values: xr.DataArray) -> FloatArray:
    """Numbers over tests (and outputs) of a tree, per objective: (objectives, ...), the other dimensions in order."""
    if "output" not in tree.coords:
        return np.asarray(values.transpose("test", ...).values, dtype=float)
    ordered = np.asarray(values.transpose("test", "output", ...).values, dtype=float)
    return np.array([ordered[one.test, one.output] for one in objectives(tree)])
