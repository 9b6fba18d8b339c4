"""How probable tests left out are by a fit to the others."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mofit._typing import FloatArray
from mofit.diagnosis.fitting import Fitted
from mofit.diagnosis.hold_out_evidence import covariance_root_without


def deviance(fitted: Fitted, tests: Sequence[int], residual: FloatArray, jacobian: FloatArray) -> float:
    r"""Minus twice the logarithm of the predictive density of tests left out, up to a constant of the data.

    .. math:: D = r^T S^{-1} r + \log\det S, \qquad S = I + J C J^T

    with the whitened residual r of these tests by the fit to the others, its derivative J by the parameters, and their
    covariance C by the others. Parameters of these tests alone are fitted to them: r and J have no part along theirs.

    Where the model holds, another one has a density :math:`1 / \alpha` times as large with probability
    :math:`\alpha` at most (Markov's inequality of the likelihood ratio), for normal noise and outputs that are linear
    in the parameters within their uncertainty.

    Parameters
    ----------
    fitted
        The fit to all tests.
    tests
        Those left out.
    residual, jacobian
        Whitened rows (m,) and (m, d) without these tests.
    """
    observed = fitted.hypothesis.observed
    rows = np.isin(observed.test, tests) & observed.explainable
    own = np.isin(fitted.hypothesis.layout.only_test[fitted.free], tests)
    error, response = residual[: len(rows)][rows], jacobian[: len(rows)][rows][:, fitted.free]
    columns = np.column_stack([response[:, ~own] @ covariance_root_without(fitted, tests)[~own], error])
    basis = np.linalg.qr(response[:, own])[0]
    columns -= basis @ (basis.T @ columns)
    unit = np.eye(columns.shape[1])[:-1]
    *sizes, misfit = np.abs(np.diag(np.linalg.qr(np.vstack([columns, unit]), mode="r")))
    return float(misfit**2 + 2 * np.sum(np.log(sizes)))
