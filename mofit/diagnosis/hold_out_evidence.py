"""What tests left out of a fit tell of the share of the gap that an effect leaves on new records."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mofit._typing import FloatArray
from mofit.diagnosis.fitting import Fitted, covariance_root
from mofit.diagnosis.mean_squares import products_of_tests
from mofit.diagnosis.remainder import Evidence, Power, evidence
from mofit.diagnosis.whitened_data import WhitenedData


def evidence_of(
    best: Fitted, observed: WhitenedData, tests: Sequence[int], errors: FloatArray, direct: NDArray[np.bool_]
) -> Evidence:
    """Of tests left out together.

    Parameters
    ----------
    best
        The fit to all tests.
    observed
        The data, in which what past inputs predict is sought in these tests alone.
    errors
        Whitened rows without and with the effect by fits to the others, 0 in other tests, (m, 2).
    direct
        Rows of these tests in which the gap can be seen, (m,).
    """
    rows, here = len(errors), np.isin(observed.test, tests)
    response = -best.jacobian[:rows, best.free] * here[:, None]
    moved = errors[:, 1] - best.residual[:rows] * here
    columns = np.column_stack([moved, errors[:, 0] - errors[:, 1], response])
    products = products_of_tests(observed, columns, tests)
    root = covariance_root_without(best, tests)
    whole, without = covariance_of(best), root @ root.T
    seen = np.column_stack([errors[:, 1], columns[:, 1:], best.residual[:rows] * here])
    power, gaps = power_of(observed, tests, seen, direct, without), products[:, 1, 1]
    return evidence(power, products[:, 2:, 2:], gaps, whole, without, float(products[:, 0, 0].sum()))


def power_of(
    observed: WhitenedData, tests: Sequence[int], columns: FloatArray, direct: NDArray[np.bool_], covariance: FloatArray
) -> Power:
    """Of what can be told of error, gain, responses by f parameters, and what a fit to all leaves; (m, 3 + f).

    The noise is no more than what that fit leaves: a ramp looks like noise, as it does not repeat.
    """
    told = observed.told(columns * direct[:, None]) * direct[:, None]
    products = products_of_tests(observed, told, tests).sum(axis=0)
    line = np.where(direct, observed.noise_share * observed.variance / observed.ranges[observed.record] ** 2, 0.0)
    noise = float(line @ observed.visible)
    line *= min(1.0, float(products[-1, -1]) / max(noise, np.finfo(float).tiny))
    noise = float(line @ observed.visible)
    freedom = float((line * observed.visible) @ observed.degrees_of_freedom) / max(noise, np.finfo(float).tiny)
    spread = covariance @ products[2:-1, 2:-1]
    return Power(
        error=float(products[0, 0]),
        gap=float(products[1, 1]),
        noise=noise,
        noise_squared=float(line**2 @ observed.visible),
        noise_freedom=max(freedom, 1.0),
        estimation=float(np.trace(spread)),
        estimation_squared=float(np.sum(spread * spread.T)),
    )


def covariance_of(best: Fitted) -> FloatArray:
    """Covariance of the free parameters, (f, f)."""
    return np.asarray(best.covariance_root @ best.covariance_root.T)


def covariance_root_without(best: Fitted, tests: Sequence[int]) -> FloatArray:
    """Root of the covariance of the free parameters from the other tests; what a test has of its own it tells itself.

    Lower triangular L (f, f), the covariance being L L'.
    """
    own, test = np.isin(best.hypothesis.layout.only_test[best.free], tests), best.hypothesis.observed.test
    design = best.design
    design[: len(test)][np.ix_(np.isin(test, tests), ~own)] = 0.0
    return covariance_root(design)
