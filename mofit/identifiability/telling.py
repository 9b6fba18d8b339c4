"""What the tests of a source tell, at several parameter sets, and what they tell together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mofit.identifiability.fisher import Sensitivity, sensitivities
from mofit.identifiability.sources import Source
from mofit.identifiability.statistics import groups, precision
from mofit.model import build_system

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Told:
    """What T tests tell of d parameters at N parameter sets; matrices are in the unit cube of the parameters.

    Parameters
    ----------
    source
        Where the tests are from.
    values
        The parameter sets, (N, d).
    sums
        Curvature and scatter as `mofit.identifiability.statistics.precision` takes them, (T, N, G, 2, d, d).
    information
        Fisher information, (T, N, d, d).
    shown
        Sensitivities of the tests of the main identification, by all parameters of the model, at the first set.
    """

    source: Source
    values: Array
    sums: Array
    information: Array
    shown: tuple[Sensitivity, ...]

    @property
    def stretch(self) -> Array:
        """Derivative of the values by the unit coordinates, (N, d)."""
        return self.source.space.slope(self.values)

    @property
    def unit(self) -> Array:
        """The parameter sets in the unit cube, (N, d)."""
        return self.source.space.to_unit(self.values)

    def precision(self, tests: Sequence[str], repeats: float = 1.0) -> Array:
        """Of the estimate from these tests of the main identification and all calibration stages, (N, d, d).

        ``repeats`` counts the named tests so many times.
        """
        chosen = [i for i, test in enumerate(self.source.tests) if test.group == 0 and test.name in tests]
        total = repeats * self.sums[chosen].sum(axis=0)
        return precision(total + self.sums[self._stages].sum(axis=0))

    def bound(self, tests: Sequence[str]) -> Array:
        """The Fisher information of the same tests, (N, d, d)."""
        chosen = [i for i, test in enumerate(self.source.tests) if test.group == 0 and test.name in tests]
        return np.asarray(self.information[[*chosen, *self._stages]].sum(axis=0))

    def stages(self) -> Array:
        """Precision of what the calibration stages know, (N, d, d)."""
        return precision(self.sums[self._stages].sum(axis=0))

    @property
    def _stages(self) -> list[int]:
        return [i for i, test in enumerate(self.source.tests) if test.group > 0]


def tell(source: Source, values: Array, jobs: int = 1) -> Told:
    """Ask all tests of a source at parameter sets (N, d): one run of the kernel for each group of tests."""
    names = source.space.names
    every = groups(source.model)
    stretch = source.space.slope(values)
    size = (len(source.tests), len(values))
    sums = np.zeros((*size, len(every), 2, len(names), len(names)))
    information = np.zeros((*size, len(names), len(names)))
    shown = []
    for number, group in enumerate(every):
        which = [i for i, test in enumerate(source.tests) if test.group == number]
        if not which:
            continue
        own = [names.index(parameter.name) for parameter in group.model.parameters]
        found = sensitivities(
            build_system(group.model),
            [source.tests[i].drive for i in which],
            values[:, own],
            [source.tests[i].noise for i in which],
            [names[k] for k in own],
            jobs,
        )
        square = stretch[:, own, None] * stretch[:, None, own]
        for i, test in zip(which, found, strict=True):
            place = np.ix_([i], range(len(values)), [number], range(2), own, own)
            sums[place] = np.stack([test.normal * square, test.scatter * square], axis=1)[None, :, None]
            information[np.ix_([i], range(len(values)), own, own)] = test.information * square
            if number == 0:
                shown.append(test.at(slice(0, 1)))
    return Told(source, values, sums, information, tuple(shown))
