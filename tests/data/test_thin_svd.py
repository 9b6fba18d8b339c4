"""Singular values of tall and wide matrices, of any rank."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mofit.data.signals import thin_svd


@given(rows=st.integers(1, 30), columns=st.integers(1, 12), rank=st.integers(1, 12), seed=st.integers(0, 999))
def test_it_is_a_singular_value_decomposition(rows: int, columns: int, rank: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    matrix = rng.standard_normal((rows, rank)) @ rng.standard_normal((rank, columns))
    left, values, right = thin_svd(matrix)
    few = min(rows, columns)
    assert (left.shape, values.shape, right.shape) == ((rows, few), (few,), (few, columns))
    assert values == pytest.approx(np.linalg.svd(matrix, compute_uv=False), abs=1e-12 * values[0])
    np.testing.assert_allclose((left * values) @ right, matrix, atol=1e-12 * values[0])
    np.testing.assert_allclose(left.T @ left, np.eye(few), atol=1e-12)
    np.testing.assert_allclose(right @ right.T, np.eye(few), atol=1e-12)
