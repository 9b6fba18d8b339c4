"""Whether single tests agree on the model's parameters: if the model is right, they do."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mofit.diagnosis.baseline import Fitted
from mofit.result.agreement import cochran

Array = NDArray[np.float64]

#: Standard deviation of a uniform prior over the box, and the share of it from which an estimate says nothing.
_PRIOR_SD, _WIDE = 12**-0.5, 0.5


@dataclass(frozen=True)
class Agreement:
    """Cochran's test of one parameter that no calibration knows.

    Parameters
    ----------
    parameter, unit
        Which.
    tests, values, sds
        Estimates of each test alone, near the joint minimum, in the parameter's unit.
    p, i_squared
        Chance of such a scatter; share of it that the estimates' own spread does not explain. nan for fewer than two.
    """

    parameter: str
    unit: str
    tests: tuple[str, ...]
    values: Array
    sds: Array
    p: float
    i_squared: float


def agreements(fitted: Fitted) -> list[Agreement]:
    """One Gauss-Newton step from the joint minimum to that of each test alone, and whether the steps differ.

    All parameters are free with the prior of the stages; what no stage knows has the box as a wide Gaussian prior.
    Estimates wider than half of it are left out.
    """
    model, observed = fitted.hypothesis, fitted.hypothesis.observed
    rows = len(observed.measured)
    prior = observed.problem.prior
    known = set() if prior is None else set(prior.names)
    space, point = model.space, fitted.minimum.point
    names = [name for name in space.names if name not in known]
    moves, spreads = [], []
    for t in range(len(observed.problem.tests)):
        used = np.ones(len(fitted.residual), dtype=bool)
        used[:rows] = observed.test == t
        jacobian = -fitted.jacobian[used]
        inverse = np.linalg.inv(jacobian.T @ jacobian + np.eye(len(space)) / _PRIOR_SD**2)
        moves.append(inverse @ (jacobian.T @ fitted.residual[used]))
        spreads.append(np.sqrt(np.diag(inverse)))
    found = []
    for name in names:
        k = space.index(name)
        move, spread = np.array([m[k] for m in moves]), np.array([s[k] for s in spreads])
        good = (spread < _WIDE * _PRIOR_SD) & (fitted.minimum.at_bound[k] == 0)
        _, _, _, p, i_squared = cochran(move[good], spread[good])
        place = np.repeat(point[None], int(good.sum()), axis=0)
        place[:, k] = np.clip(place[:, k] + move[good], 0.0, 1.0)
        values = space.from_unit(place)
        found.append(
            Agreement(
                name,
                space[name].unit,
                tuple(test for test, on in zip(observed.problem.tests, good, strict=True) if on),
                values[:, k],
                spread[good] * space.slope(values)[:, k],
                p,
                i_squared,
            )
        )
    return found
