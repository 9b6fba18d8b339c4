"""Scopes of parameters: which have a value of their own in each test or under each condition."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mofit._typing import FloatArray
from mofit.data import Measurement
from mofit.errors import Issue, raise_errors
from mofit.parameters import PER_CAMPAIGN, PER_TEST, ParameterSpace
from mofit.simulation.requirements import all_conditions


@dataclass(frozen=True)
class Scopes:
    """Parameters that do not belong to the whole campaign; tests with the same label share a value."""

    space: ParameterSpace
    """These parameters, L."""
    labels: Mapping[str, tuple[str, ...]]
    """By test, the label of every parameter."""
    known: Mapping[str, FloatArray] | None = None
    """By test, values (L,) near which the best ones lie; None: not known yet."""

    @classmethod
    def of(cls, space: ParameterSpace, measurements: Sequence[Measurement]) -> Scopes:
        """From the scope that each parameter says (`mofit.parameters.Parameter.per`).

        Raises
        ------
        InputError
            With every condition that a test lacks.
        """
        labels, issues = {}, []
        for measurement in measurements:
            conditions = all_conditions(measurement.experiment)
            own = []
            for parameter in space.parameters:
                names = parameter.per.split(",")
                if parameter.per == PER_TEST:
                    own.append(measurement.name)
                elif all(name in conditions for name in names):
                    own.append(", ".join(f"{name} = {conditions[name]:g}" for name in names))
                else:
                    where = f"test '{measurement.name}'"
                    message = (
                        f"parameter '{parameter.name}' has a value per {parameter.per}, which the test does not say"
                    )
                    issues.append(Issue(where, message, f"It has {', '.join(conditions)}; or choose 'test'"))
            labels[measurement.name] = tuple(own)
        raise_errors(issues)
        return cls(space, labels)

    def near(self, tests: Sequence[str], values: FloatArray) -> Scopes:
        """The same with known values (T, L)."""
        return replace(self, known=dict(zip(tests, values, strict=True)))

    def unknowns(self, tests: Sequence[str]) -> Unknowns:
        """The values to be found for some tests."""
        return unknowns_of([self.labels[test] for test in tests])


@dataclass(frozen=True)
class Unknowns:
    """The scoped values of T tests, in groups of tests that share some of them."""

    group: NDArray[np.intp]
    """Group of every test, (T,)."""
    place: NDArray[np.intp]
    """Place of every parameter's value among those of its group, (T, L)."""
    used: NDArray[np.bool_]
    """Which places each group has, (G, m): m is that of the largest."""
    parameter: NDArray[np.intp]
    """Parameter of every place, (G, m); 0 where there is none."""
    first_test: NDArray[np.intp]
    """A test that has the value of the place, (G, m)."""

    def by_test(self, values: FloatArray) -> FloatArray:
        """Values (N, G, m, ...) of the groups as those of the tests, (N, T, L, ...)."""
        return values[:, self.group[:, None], self.place]

    def by_group(self, values: FloatArray) -> FloatArray:
        """Values of the tests (T, L) as those of the groups, (G, m); 0.5 where there is none."""
        result = np.full(self.used.shape, 0.5)
        result[self.group[:, None], self.place] = values
        return result

    def summed(self, objective_test: NDArray[np.intp], values: FloatArray) -> FloatArray:
        """Sum over the objectives (N, K) of each group, (N, G); ``objective_test`` (K,) is the test of each."""
        return _summed(values, len(self.used), at=[self.group[objective_test]])

    def summed_vectors(self, objective_test: NDArray[np.intp], values: FloatArray) -> FloatArray:
        """The same of vectors over the parameters (N, K, L, ...), (N, G, m, ...)."""
        at = [self.group[objective_test][:, None], self.place[objective_test]]
        return _summed(values, *self.used.shape, *values.shape[3:], at=at)

    def summed_matrices(self, objective_test: NDArray[np.intp], values: FloatArray) -> FloatArray:
        """The same of matrices (N, K, L, L), (N, G, m, m)."""
        place = self.place[objective_test]
        at = [self.group[objective_test][:, None, None], place[:, :, None], place[:, None, :]]
        return _summed(values, *self.used.shape, self.used.shape[1], at=at)


def _summed(values: FloatArray, *shape: int, at: Sequence[NDArray[np.intp]]) -> FloatArray:
    """Values (N, ...) added at places of arrays (N, *shape)."""
    result = np.zeros((len(values), *shape))
    where: Any = (slice(None), *at)
    np.add.at(result, where, values)
    return result


def unknowns_of(labels: Sequence[tuple[str, ...]]) -> Unknowns:
    """Tests that share a label are joined, and those that these share one with."""
    group = list(range(len(labels)))
    first: dict[tuple[int, str], int] = {}
    for test, own in enumerate(labels):
        for cell in enumerate(own):
            joined, here = group[first.setdefault(cell, test)], group[test]
            group = [joined if one == here else one for one in group]
    numbers = {one: number for number, one in enumerate(dict.fromkeys(group))}
    places: list[dict[tuple[int, str], int]] = [{} for _ in numbers]
    groups = np.array([numbers[one] for one in group], dtype=np.intp)
    place = [
        [places[g].setdefault(cell, len(places[g])) for cell in enumerate(own)]
        for g, own in zip(groups, labels, strict=True)
    ]
    sizes = np.array([len(cells) for cells in places])
    used = np.arange(sizes.max(initial=0)) < sizes[:, None]
    table = np.array(place, dtype=np.intp).reshape(len(labels), -1)
    parameter, first_test = np.zeros(used.shape, dtype=np.intp), np.zeros(used.shape, dtype=np.intp)
    parameter[groups[:, None], table] = np.arange(table.shape[1])
    first_test[groups[:, None], table] = np.arange(len(labels))[:, None]
    return Unknowns(groups, table, used, parameter, first_test)


def scoped(space: ParameterSpace) -> tuple[ParameterSpace, ParameterSpace]:
    """The parameters of the campaign, and those with another scope."""
    shared = [p.name for p in space.parameters if p.per == PER_CAMPAIGN]
    return space.subset(shared), space.subset([name for name in space.names if name not in shared])
