"""A result tree as the sections of a page read it: tests, parameters and posterior modes as plain arrays."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import xarray as xr

from mofit._typing import FloatArray
from mofit.parameters import ParameterSpace
from mofit.report.toolkit.figures import mode_colour
from mofit.report.toolkit.formatting import percent
from mofit.results import Objective, findings, objectives, parameter_layout, per_objective

SHOWN = 4
"""Modes that get figures of their own; tables list all."""

PLAUSIBLE = 0.01
"""Probability from which a mode counts as plausible."""

_PARTLY = ("weak", "limit")
"""Words of a verdict that reports a range of the parameter, but not a value."""


def numbers(node: xr.DataTree, name: str) -> FloatArray:
    """A numeric variable or coordinate of a group."""
    return np.asarray(node.dataset[name].values, dtype=float)


def labels(node: xr.DataTree, name: str) -> list[str]:
    """A variable or coordinate of strings."""
    return [str(label) for label in node.dataset[name].values]


@dataclass(frozen=True)
class Mode:
    """One posterior mode: its MAP estimate, its samples and its diagnostics."""

    name: str
    index: int
    node: xr.DataTree

    @property
    def probability(self) -> float:
        """Posterior probability of the mode."""
        return float(self.node.attrs["probability"])

    @property
    def title(self) -> str:
        """Name and probability, for tabs."""
        return f"{self.name} ({percent(self.probability)})"

    @property
    def colour(self) -> str:
        """Its colour in every figure."""
        return mode_colour(self.index)

    @property
    def converged(self) -> bool:
        """Whether its chains agree."""
        return bool(self.node.attrs["converged"])

    @cached_property
    def parameters(self) -> list[str]:
        """Names of its free parameters."""
        return labels(self.node, "parameter")

    def array(self, name: str) -> FloatArray:
        """One of its variables per parameter; NaN throughout where the run has none."""
        if name in self.node.data_vars:
            return numbers(self.node, name)
        return np.full(len(self.parameters), np.nan)

    @cached_property
    def draws(self) -> FloatArray:
        """Posterior draws, shape (chain, draw, parameter)."""
        return np.stack([numbers(self.node.children["posterior"], name) for name in self.parameters], axis=-1)

    @property
    def flat_draws(self) -> FloatArray:
        """Posterior draws of all chains, shape (draw, parameter)."""
        return self.draws.reshape(-1, len(self.parameters))

    @property
    def sampled(self) -> bool:
        """Whether the run holds draws of it."""
        return "posterior" in self.node.children

    @cached_property
    def verdicts(self) -> list[str]:
        """Verdict per parameter, empty where the run gives none."""
        return labels(self.node, "verdict") if "verdict" in self.node.data_vars else [""] * len(self.parameters)

    @cached_property
    def grades(self) -> list[str]:
        """Whether the data identify each parameter: ``good``, ``fair``, ``bad``, or ``unknown`` if nothing was sampled.

        By the verdict; where there is none, the posterior must be less than half as wide as the prior. A parameter at
        a bound is ``bad``.
        """
        return [
            _grade(verdict.lower(), contraction, bool(bound))
            for verdict, contraction, bound in zip(
                self.verdicts, self.array("contraction"), self.array("at_bound"), strict=True
            )
        ]


def _grade(verdict: str, contraction: float, bound: bool) -> str:
    if bound:
        return "bad"
    if verdict:
        partly = any(word in verdict for word in _PARTLY)
        return "good" if verdict.startswith("identified") else "fair" if partly else "bad"
    if np.isnan(contraction):
        return "unknown"
    return "bad" if contraction < 0.5 else "good"


@dataclass(frozen=True)
class Run:
    """A result tree, read for the pages."""

    tree: xr.DataTree

    @cached_property
    def tests(self) -> list[str]:
        """Names of the tests."""
        return labels(self.tree, "test")

    def of_tests(self, name: str) -> FloatArray:
        """A numeric root variable over the tests."""
        return numbers(self.tree, name)

    @cached_property
    def objectives(self) -> list[Objective]:
        """The tests, or of several outputs the pairs of a test and an output measured in it."""
        return objectives(self.tree)

    @property
    def objective_names(self) -> list[str]:
        """Names of the objectives."""
        return [one.name for one in self.objectives]

    @property
    def outputs(self) -> list[str]:
        """Names of the outputs where there are several."""
        return list(dict.fromkeys(one.name_of_output for one in self.objectives if one.name_of_output))

    def of_objectives(self, name: str, node: xr.DataTree | None = None) -> FloatArray:
        """A numeric variable per objective, shape (objectives, ...); of the root, or of another group.

        What the group has per test only is repeated for the outputs of each.
        """
        values = (self.tree if node is None else node).dataset[name]
        if self.outputs and "output" not in values.dims:
            return np.asarray(values.values, dtype=float)[[one.test for one in self.objectives]]
        return per_objective(self.tree, values)

    @cached_property
    def excitations(self) -> list[str]:
        """Type of excitation per test."""
        return labels(self.tree, "excitation")

    def input_of(self, test: str) -> xr.DataArray | None:
        """The first input signal of a test, or None where the run holds none."""
        for name, signal in self.tree["constant_data"].data_vars.items():
            if signal.dims == (f"time_{test}",) and name != f"{test}_weight":
                return signal
        return None

    @cached_property
    def modes(self) -> list[Mode]:
        """Posterior modes, best first (m1, m2, …, m10)."""
        nodes = self.tree["modes"].children
        names = sorted(nodes, key=lambda name: (len(name), name))
        return [Mode(name, index, nodes[name]) for index, name in enumerate(names)]

    @property
    def best(self) -> Mode:
        """The most probable mode."""
        return self.modes[0]

    @property
    def shown(self) -> list[Mode]:
        """The modes that get figures."""
        return self.modes[:SHOWN]

    @property
    def sampled(self) -> list[Mode]:
        """Those of them that hold draws."""
        return [mode for mode in self.shown if mode.sampled]

    @cached_property
    def plausible(self) -> list[Mode]:
        """The modes with a probability that counts (all where it is not known)."""
        return [mode for mode in self.modes if not mode.probability < PLAUSIBLE]

    def group(self, name: str) -> xr.DataTree | None:
        """A group of the tree, or None where the run has none."""
        return self.tree.children.get(name)

    @cached_property
    def baseline_title(self) -> str:
        """Title of the baseline model; empty where the run has none."""
        node = self.group("baseline")
        return "" if node is None else str(node.attrs["model_title"])

    @cached_property
    def baseline_nrmsd(self) -> FloatArray:
        """NRMSD of the baseline per objective; NaN where the run has none."""
        node = self.group("baseline")
        return np.full(len(self.objectives), np.nan) if node is None else self.of_objectives("nrmsd", node)

    @property
    def converged(self) -> bool:
        """Whether the run as a whole converged."""
        return bool(self.tree.attrs["converged"])

    @property
    def findings(self) -> list[dict[str, str]]:
        """What to know before the numbers."""
        return findings(self.tree)

    @property
    def parameters(self) -> tuple[str, ...]:
        """All parameters of the model."""
        return self._space.names

    def unit(self, parameter: str) -> str:
        """SI unit of a parameter; ``"1"`` if it is not one of the model."""
        return self._space[parameter].unit if parameter in self._space.names else "1"

    def space(self, names: list[str]) -> ParameterSpace:
        """The prior box of these parameters."""
        return self._space.subset(names)

    @cached_property
    def _space(self) -> ParameterSpace:
        return parameter_layout(self.tree).space

    def json(self, attribute: str) -> Any:
        """A root attribute that holds JSON."""
        return json.loads(self.tree.attrs[attribute])
