"""Starts of what an effect has per test: angles and the like, found test by test on a grid; and of the model's own."""

from __future__ import annotations

import numpy as np

from mofit._typing import FloatArray
from mofit.diagnosis.hypothesis import Hypothesis
from mofit.models import Effect
from mofit.simulation.scoped_simulator import ScopedSimulator

#: Values tried of a scoped parameter over its range, which may hold an angle three times: 45° apart.
_VALUES = 25


def with_best_values(model: Hypothesis, start: FloatArray, effect: Effect) -> FloatArray:
    """A start (d,) with the best values of what an effect has per test beside its size, all else being as it is.

    All tests take the same value at once, and each keeps the one that suits it best: few simulations however many tests
    there are. Of values that are as good, the one nearest to the middle counts.
    """
    observed, rows = model.observed, len(model.observed.measured)
    found = start.copy()
    for name in effect.scoped_grid:
        own = model.layout.coordinates(name)
        place = model.layout.place[:, model.layout.parameters.index(name)]
        values = np.linspace(0.0, 1.0, _VALUES)
        values = values[np.argsort(np.abs(values - 0.5), kind="stable")]
        points = np.repeat(found[None], len(values), axis=0)
        points[:, own] = values[:, None]
        residual = np.concatenate([part.residual for part in model.linear_parts(points)])
        squares = np.nan_to_num(residual[:, :rows] ** 2, nan=np.inf)
        for coordinate in own:
            here = (place == coordinate)[observed.test]
            total = squares[:, here].sum(axis=1)
            found[coordinate] = values[np.argmax(total <= total.min() * (1 + 1e-9))]
    return found


def with_scoped(model: Hypothesis, starts: FloatArray) -> FloatArray:
    """Starts (k, s) of the model's parameters of the campaign, with the best values there of the others: (k, d)."""
    problem, layout = model.observed.problem, model.layout
    if not isinstance(problem.simulator, ScopedSimulator):
        return starts
    names = list(layout.names)
    values = problem.simulator.best(problem.layout.full(starts)).values
    columns = [names.index(name) for name in layout.parameters.names]
    units = layout.parameters.to_unit(values[..., columns])
    found = np.zeros((len(starts), len(layout.space)))
    for test, place in enumerate(layout.place):
        found[:, place] = units[:, test]
    found[:, : starts.shape[1]] = starts
    return np.clip(found, 0.0, 1.0)
