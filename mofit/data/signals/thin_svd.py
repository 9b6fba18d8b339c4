"""Singular values of tall matrices, whatever the matrix."""

from __future__ import annotations

import numpy as np
from scipy.linalg import svd

from mofit._typing import FloatArray


def thin_svd(columns: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Left vectors (rows, r), values (r,) in descending order and right vectors (r, k) of a matrix (rows, k).

    By QR first, which makes it small. LAPACK's divide and conquer, which is NumPy's, does not converge for every
    matrix; this driver does.
    """
    basis, triangle = np.linalg.qr(columns)
    left, values, turned = svd(triangle, full_matrices=False, lapack_driver="gesvd")
    return np.asarray(basis @ left), np.asarray(values), np.asarray(turned)
