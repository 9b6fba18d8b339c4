"""Parameters of a hypothesis with a unit coordinate for each of their values: one, or one per test or condition."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mofit._typing import FloatArray
from mofit.data import Measurement
from mofit.parameters import ParameterLayout, ParameterSpace
from mofit.simulation.scopes import Scopes, scoped


def labels_of(space: ParameterSpace, measurements: Sequence[Measurement]) -> tuple[tuple[str, ...], ...]:
    """What the value of every parameter belongs to in every test, (T, f): empty for the campaign."""
    own = scoped(space)[1]
    known = Scopes.of(own, measurements).labels
    found = (dict(zip(own.names, known[measurement.name], strict=True)) for measurement in measurements)
    return tuple(tuple(labels.get(name, "") for name in space.names) for labels in found)


@dataclass(frozen=True)
class ScopedLayout:
    """All parameters of a system: f free ones, d unit coordinates of theirs, and the others at fixed values.

    A parameter of the campaign has one coordinate, another one has one per test or per value of its condition. They
    are all solved for at once, densely: with T tests d grows as T, and the work as T³; good for a few hundred.

    Parameters
    ----------
    names
        All p parameters, in the order in which the system takes them.
    parameters
        The free ones, each once.
    fixed
        Values of the others.
    labels
        What the value of every free parameter belongs to in every test, (T, f); see `labels_of`.
    """

    names: tuple[str, ...]
    parameters: ParameterSpace
    fixed: Mapping[str, float]
    labels: tuple[tuple[str, ...], ...]

    @cached_property
    def cells(self) -> tuple[tuple[str, str], ...]:
        """Name and label of every coordinate, those of a parameter side by side; (d,)."""
        by_parameter = zip(self.parameters.names, zip(*self.labels, strict=True), strict=True)
        return tuple((name, label) for name, labels in by_parameter for label in dict.fromkeys(labels))

    @cached_property
    def space(self) -> ParameterSpace:
        """The coordinates as parameters: ``F_0 [2 Hz]`` is the value of F_0 in the test 2 Hz."""
        cells = ((self.parameters[name], label) for name, label in self.cells)
        return ParameterSpace(tuple(replace(p, name=f"{p.name} [{label}]") if label else p for p, label in cells))

    @cached_property
    def place(self) -> NDArray[np.intp]:
        """Coordinate of every free parameter in every test, (T, f)."""
        at = {cell: i for i, cell in enumerate(self.cells)}
        rows = [[at[cell] for cell in zip(self.parameters.names, labels, strict=True)] for labels in self.labels]
        return np.array(rows, dtype=np.intp).reshape(len(self.labels), len(self.parameters))

    @cached_property
    def shared(self) -> NDArray[np.bool_]:
        """Which coordinates belong to the campaign, (d,)."""
        return np.array([not label for _, label in self.cells], dtype=bool)

    @cached_property
    def only_test(self) -> NDArray[np.intp]:
        """The test that a scoped coordinate acts on where that is a single one, else -1; (d,)."""
        found = np.full(len(self.cells), -1, dtype=np.intp)
        for coordinate in np.flatnonzero(~self.shared):
            tests = np.flatnonzero((self.place == coordinate).any(axis=1))
            found[coordinate] = tests[0] if len(tests) == 1 else -1
        return found

    def coordinates(self, name: str) -> list[int]:
        """Coordinates of a parameter."""
        return [i for i, (own, _) in enumerate(self.cells) if own == name]

    @property
    def by_name(self) -> ParameterLayout:
        """The layout of a single test."""
        return ParameterLayout(self.names, self.parameters, self.fixed)

    def full(self, u: FloatArray) -> FloatArray:
        """Values of all parameters at points u (K, d): (K, p), or by test (K, T, p) where tests have their own."""
        one = self.by_name
        if self.shared.all():
            return one.full(u)
        return np.stack([one.full(u[:, place]) for place in self.place], axis=1)

    def in_new_test(self, u: FloatArray) -> FloatArray:
        """Points u (K, d) as those of a test that does not exist yet, (K, f): scoped values are means over theirs."""
        return np.stack([u[:, self.coordinates(name)].mean(axis=1) for name in self.parameters.names], axis=1)

    def in_columns_of_new_test(self, columns: FloatArray) -> FloatArray:
        """Columns by parameter (n, f) of such a test as those by coordinate and by its own values, (n, d + l)."""
        own = np.array([name not in dict(cell for cell in self.cells if not cell[1]) for name in self.parameters.names])
        wide = np.zeros((len(columns), len(self.cells)))
        wide[:, self.shared] = columns[:, ~own]
        return np.concatenate([wide, columns[:, own]], axis=1)

    def values_by_test(self, point: FloatArray) -> list[dict[str, float]]:
        """Values of all parameters in every test, by name, at a point (d,)."""
        found = np.broadcast_to(self.full(point[None])[0], (len(self.labels), len(self.names)))
        return [dict(zip(self.names, map(float, values), strict=True)) for values in found]

    def spread(self, columns: FloatArray, test: NDArray[np.int64]) -> FloatArray:
        """Columns by parameter (K, m, f) as those by coordinate (K, m, d); ``test`` is that of every row (m,)."""
        if self.shared.all():
            return columns
        wide = np.zeros((*columns.shape[:2], len(self.cells)))
        wide[:, np.arange(len(test))[:, None], self.place[test]] = columns
        return wide

    def farther(self, sides: NDArray[np.int64]) -> ScopedLayout:
        """With wider ranges of parameters at whose ends some coordinate is; -1 or 1 in ``sides`` (d,)."""
        low, high = ([name for (name, _), side in zip(self.cells, sides, strict=True) if side == at] for at in (-1, 1))
        space = self.parameters
        for names, side in ((low, -1), (high, 1)):
            space = space.farther([side if name in names else 0 for name in space.names])
        return self if space == self.parameters else replace(self, parameters=space)
