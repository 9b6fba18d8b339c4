"""What every section needs to know of a run: its tests, parameters and clusters as plain arrays."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mofit.report.display import percent

Array = NDArray[np.float64]

SHOWN = 4
"""Clusters that get figures of their own; tables list all."""

_HALF = ("weak", "limit")
"""Words of a verdict that says something of the parameter, but not its value."""

PLAUSIBLE = 0.01
"""Posterior weight from which a solution counts as plausible."""


def numbers(node: xr.DataTree, name: str) -> Array:
    """A numeric variable or coordinate of a group."""
    return np.asarray(node.dataset[name].values, dtype=float)


def labels(node: xr.DataTree, name: str) -> list[str]:
    """A variable or coordinate of strings."""
    return [str(label) for label in node.dataset[name].values]


@dataclass(frozen=True)
class Cluster:
    """One mode: its refined minimum, its posterior and its diagnostics."""

    name: str
    index: int
    node: xr.DataTree

    @property
    def weight(self) -> float:
        """Share of the posterior mass."""
        return float(self.node.attrs["weight"])

    @property
    def converged(self) -> bool:
        """Whether its chains agree."""
        return bool(self.node.attrs["converged"])

    @cached_property
    def parameters(self) -> list[str]:
        """Names of its free parameters."""
        return labels(self.node, "parameter")

    def array(self, name: str) -> Array:
        """One of its summary variables; NaN throughout where the run has none."""
        if name in self.node.data_vars:
            return numbers(self.node, name)
        return np.full(len(self.parameters), np.nan)

    @cached_property
    def draws(self) -> Array | None:
        """Posterior draws, shape (chain, draw, parameter)."""
        if "posterior" not in self.node.children:
            return None
        return np.stack([numbers(self.node.children["posterior"], name) for name in self.parameters], axis=-1)

    @cached_property
    def verdicts(self) -> list[str]:
        """Verdict per parameter, empty where the run gives none."""
        if "verdict" not in self.node.data_vars:
            return [""] * len(self.parameters)
        return labels(self.node, "verdict")

    @cached_property
    def grades(self) -> list[str]:
        """Whether the data pin each parameter: ``good``, ``fair``, ``bad``, or ``unknown`` where nothing was sampled.

        The verdict speaks where there is one; otherwise the contraction does (the posterior must be less than half as
        wide as the prior), and a bound that is hit.
        """
        grades = []
        for verdict, contraction, bound in zip(
            self.verdicts, self.array("contraction"), self.array("at_bound"), strict=True
        ):
            if bound:
                grades.append("bad")
            elif verdict:
                half = any(word in verdict.lower() for word in _HALF)
                grades.append("good" if verdict.lower().startswith("identified") else "fair" if half else "bad")
            elif np.isnan(contraction):
                grades.append("unknown")
            else:
                grades.append("bad" if contraction < 0.5 else "good")
        return grades


@dataclass(frozen=True)
class Run:
    """A result tree, read for the report."""

    tree: xr.DataTree

    @cached_property
    def tests(self) -> list[str]:
        """Names of the tests."""
        return labels(self.tree, "test")

    def of_tests(self, name: str) -> Array:
        """A numeric root variable over the tests."""
        return numbers(self.tree, name)

    @cached_property
    def kinds(self) -> list[str]:
        """Kind of excitation per test."""
        return labels(self.tree, "kind")

    def input_of(self, test: str) -> xr.DataArray | None:
        """The first input signal of a test, or None where the run holds none."""
        for name, signal in self.tree.children["constant_data"].data_vars.items():
            if signal.dims == (f"time_{test}",) and name != f"{test}_weight":
                return signal
        return None

    @cached_property
    def clusters(self) -> list[Cluster]:
        """Clusters, best first (c1, c2, …, c10)."""
        nodes = self.tree.children["clusters"].children
        names = sorted(nodes, key=lambda name: (len(name), name))
        return [Cluster(name, index, nodes[name]) for index, name in enumerate(names)]

    def group(self, name: str) -> xr.DataTree | None:
        """A group of the tree, or None where the run has none."""
        return self.tree.children.get(name)

    @cached_property
    def baseline_title(self) -> str:
        """Title of the baseline model; empty where the run has none."""
        node = self.group("baseline")
        return "" if node is None else str(node.attrs["model_title"])

    @cached_property
    def baseline_nrmsd(self) -> Array:
        """NRMSD of the baseline per test; NaN where the run has none."""
        node = self.group("baseline")
        return np.full(len(self.tests), np.nan) if node is None else numbers(node, "nrmsd")

    @property
    def shown(self) -> list[Cluster]:
        """The clusters that get figures."""
        return self.clusters[:SHOWN]

    @cached_property
    def plausible(self) -> list[Cluster]:
        """The clusters that carry posterior weight worth naming."""
        return [cluster for cluster in self.clusters if not cluster.weight < PLAUSIBLE]

    @property
    def converged(self) -> bool:
        """Whether the run as a whole converged."""
        return bool(self.tree.attrs["converged"])

    @cached_property
    def parameters(self) -> list[str]:
        """All parameters of the model."""
        return labels(self.tree.children["parameters"], "parameter")

    def of_parameters(self, name: str, parameters: list[str]) -> NDArray[Any]:
        """A variable of the parameter table, for these parameters."""
        return self.tree.children["parameters"].dataset[name].sel(parameter=parameters).values

    def unit(self, parameter: str) -> str:
        """SI unit of a parameter."""
        return str(self.of_parameters("unit", [parameter])[0])

    def is_log(self, parameters: list[str]) -> NDArray[np.bool_]:
        """Whether the parameters are searched by their logarithm."""
        return np.asarray(self.of_parameters("scale", parameters) == "log")

    def to_unit(self, values: Array, parameters: list[str]) -> Array:
        """Place in the prior box, 0 to 1 per parameter (by logarithm where the scale is log)."""
        log = self.is_log(parameters)
        lower = np.asarray(self.of_parameters("lower", parameters), dtype=float)
        upper = np.asarray(self.of_parameters("upper", parameters), dtype=float)
        tiny = np.finfo(float).tiny

        def scaled(x: Array) -> Array:
            return np.where(log, np.log(np.maximum(x, tiny)), x)

        return (scaled(values) - scaled(lower)) / (scaled(upper) - scaled(lower))

    def from_unit(self, places: Array, parameters: list[str]) -> Array:
        """Values at places in the prior box; the inverse of `to_unit`."""
        lower = np.asarray(self.of_parameters("lower", parameters), dtype=float)
        upper = np.asarray(self.of_parameters("upper", parameters), dtype=float)
        log = self.is_log(parameters)
        low, high = np.where(log, lower, 1.0), np.where(log, upper, 1.0)
        return np.where(log, low * (high / low) ** places, lower + places * (upper - lower))

    def moved(self, points: Array, names: list[str]) -> list[int]:
        """Places of the parameters that differ between points by over a thousandth of the box (all if none does)."""
        spread = np.ptp(self.to_unit(points, names), axis=0) if len(points) else np.zeros(len(names))
        return [k for k in range(len(names)) if spread[k] > 1e-3] or [*range(len(names))]

    def json(self, attribute: str) -> Any:
        """A root attribute that holds JSON."""
        return json.loads(self.tree.attrs[attribute])


def tab_title(cluster: Cluster) -> str:
    """Name and weight of a cluster, for tabs."""
    return f"{cluster.name} ({percent(cluster.weight)})"
