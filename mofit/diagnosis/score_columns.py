"""Columns of a score test: one per component of an effect's size, or one for each of its values per test.

A parameter per test that means nothing without the effect, such as an angle, is undefined at the neutral size. The
sensitivities at the values of its grid, each for its own tests, span what it can do to first order: cosine and sine of
every test, for an angle of any value. No supremum over angles is needed, and the test is exact in linear models.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mofit._typing import FloatArray
from mofit.data import Measurement
from mofit.diagnosis.scoped_layout import labels_of
from mofit.models import Effect
from mofit.parameters import ParameterSpace


@dataclass(frozen=True)
class ScoreColumns:
    """What the c columns of a score test are.

    Parameters
    ----------
    size, value
        Component of the size, (c,), and place on the grid of the effect's scoped parameters, (c,).
    tests
        Which tests the column acts on, (c, T).
    label
        Test or condition that the component of the size belongs to, empty for the campaign; (c,).
    """

    size: NDArray[np.intp]
    value: NDArray[np.intp]
    tests: NDArray[np.bool_]
    label: tuple[str, ...]

    @classmethod
    def of(cls, effect: Effect, measurements: Sequence[Measurement]) -> ScoreColumns:
        """Of an effect in some tests."""
        space = ParameterSpace(effect.parameters)
        labels = labels_of(space, measurements)
        grid = [space.index(name) for name in effect.scoped_grid]
        found = []
        for size, name in enumerate(effect.size):
            own = space.index(name)
            keys = [(test[own], *(test[k] for k in grid)) for test in labels]
            for key in dict.fromkeys(keys):
                here = [one == key for one in keys]
                found += [(size, value, here, key[0]) for value in range(len(effect.scoped_grid_points))]
        sizes, values, tests, names = zip(*found, strict=True)
        return cls(np.array(sizes), np.array(values), np.array(tests), names)

    @property
    def scoped(self) -> bool:
        """Whether any column belongs to less than the campaign."""
        return not bool(self.tests.all())

    def signs(self, effect: Effect) -> tuple[int, ...]:
        """Per column: 1 if its size cannot be below neutral, -1 if it cannot be above, else 0.

        Where a scoped parameter turns the direction any sign is possible.
        """
        size = [p for p in effect.parameters if p.neutral is not None]
        signs = [int(p.neutral == p.lower) - int(p.neutral == p.upper) for p in size]
        return tuple(0 if len(effect.scoped_grid_points) > 1 else signs[i] for i in self.size)

    def spread(self, rows: FloatArray, test: NDArray[np.int64]) -> FloatArray:
        """Sensitivities (values, m, q) as columns (m, c); ``test`` is that of every row."""
        return np.stack(
            [rows[v, :, i] * own[test] for i, v, own in zip(self.size, self.value, self.tests, strict=True)], axis=1
        )

    def shared(self, columns: FloatArray, sizes: FloatArray) -> FloatArray:
        """Columns (rows, c), turned where the score test expects them (c,), as one per component of the size.

        Each test keeps its own direction, and all have the same size.
        """
        if not self.scoped:
            return columns
        return np.stack(
            [columns[:, self.size == i] @ self._direction(sizes, i) for i in dict.fromkeys(self.size.tolist())], axis=1
        )

    def expected(self, sizes: FloatArray) -> FloatArray:
        """Expected sizes of the columns (c,) as those of the components, (q,): root mean squares over the tests."""
        if not self.scoped:
            return sizes
        lengths = [self._lengths(sizes, i) for i in dict.fromkeys(self.size.tolist())]
        return np.array([np.sqrt(np.mean(one[one > 0] ** 2)) if np.any(one > 0) else 0.0 for one in lengths])

    def values(self, effect: Effect, sizes: FloatArray) -> dict[str, float]:
        """Expected values of the size, by the names of its coordinates (`ScopedLayout.space`)."""
        found = {name: effect.neutral[name] + one for name, one in zip(effect.size, self.expected(sizes), strict=True)}
        single = len(effect.scoped_grid_points) == 1
        for i, label, size in zip(self.size, self.label, sizes, strict=True):
            name = effect.size[i]
            if label and single:
                found[f"{name} [{label}]"] = effect.neutral[name] + float(size)
            elif label:
                found[f"{name} [{label}]"] = found[name]
        return found

    def _lengths(self, sizes: FloatArray, component: int) -> FloatArray:
        """Length of the size over the grid's values, in every test (T,)."""
        here = self.size == component
        return np.sqrt(np.asarray((sizes[here] ** 2) @ self.tests[here]))

    def _direction(self, sizes: FloatArray, component: int) -> FloatArray:
        """Sizes of one component's columns, of unit length in every test."""
        here = self.size == component
        lengths = self._lengths(sizes, component)
        own = np.array([lengths[tests][0] for tests in self.tests[here]])
        return np.where(own > 0, sizes[here] / np.where(own > 0, own, 1.0), 0.0)
