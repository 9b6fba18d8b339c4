"""Outputs at many draws of the parameters from simulations at some of them."""

from __future__ import annotations

import numpy as np

from mofit._typing import FloatArray
from mofit.parameters import ParameterSpace
from mofit.simulation.evaluation.emulator import Coordinates, Emulator
from mofit.simulation.evaluation.surface import coefficients
from mofit.simulation.simulator import Simulator

#: Simulated draws per coefficient of a quadratic, and at least.
PER_COEFFICIENT, FEWEST = 1.6, 20
#: Leave-one-out error that is allowed, as a share of the spread of the outputs over the draws.
ALLOWED = 0.05


def simulations_for(dimension: int) -> int:
    """Simulations of a record that suffice where an emulator of so many parameters is good."""
    return max(FEWEST, int(np.ceil(PER_COEFFICIENT * coefficients(dimension, 2))))


def outputs_at(simulator: Simulator, space: ParameterSpace, sets: FloatArray, seed: int) -> FloatArray:
    """Outputs (D, n, ny) of the one test of a simulator at draws (D, np); nan where it fails.

    An emulator trained at the first of them answers for the others if it is good, else all are simulated.

    Parameters
    ----------
    simulator
        Of a user's simulator, with one test.
    space
        All parameters in their order.
    sets, seed
        The draws, and the seed of the emulator.
    """
    moving = np.flatnonzero(np.ptp(sets, axis=0) > 0)
    count = simulations_for(len(moving))
    (first,) = simulator.simulate(sets[:count])
    if len(sets) <= count:
        return first
    good = np.isfinite(first).all(axis=(1, 2))
    if len(moving) and good.all():
        own = space.subset([space.names[k] for k in moving])
        unit = own.to_unit(sets[:, moving])
        scale = np.diag(unit.std(axis=0))
        coordinates = Coordinates(own, tuple(moving.tolist()), unit.mean(axis=0), scale)
        # every sample counts alike, also one that no fit uses
        (test,) = simulator.experiments
        extent = np.maximum(np.ptp(first, axis=(0, 1)), np.finfo(float).tiny)
        whole = test.changed(weights=np.broadcast_to(1 / extent**2, test.measured.shape).copy())
        emulator = Emulator(coordinates, [whole], sets[:count], [first], np.ones(1), np.zeros(count), seed)
        spread = np.sqrt(np.mean(np.sum((first - first.mean(axis=0)) ** 2 / extent**2, axis=(1, 2))))
        if emulator.error <= ALLOWED * spread:
            (rest,) = emulator.stored([whole], sets[count:], [], False)
            return np.concatenate([first, rest[..., 0]])
    (rest,) = simulator.simulate(sets[count:])
    return np.concatenate([first, rest])
