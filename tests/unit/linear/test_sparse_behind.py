"""Rows joined behind sparse matrices, and cut from them, beside NumPy's dense blocks."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from fcsim.linear.sparse.behind import first_rows, with_diagonal_behind, with_units_behind


def test_rows_behind() -> None:
    rng = np.random.default_rng(0)
    A = rng.standard_normal((6, 6)) * (rng.random((6, 6)) < 0.5)
    H = rng.standard_normal((6, 9)) * (rng.random((6, 9)) < 0.5)
    own, columns = rng.uniform(1, 2, 4), np.array([0, 3, 4, 8])
    M = with_diagonal_behind(sp.csr_array(A), own)
    assert np.array_equal(M.toarray(), np.block([[A, np.zeros((6, 4))], [np.zeros((4, 6)), np.diag(own)]]))
    joined = with_units_behind(sp.csr_array(H), columns)
    assert np.array_equal(joined.toarray(), np.vstack([H, np.eye(9)[columns]]))
    assert np.array_equal(first_rows(M, 6, 6).toarray(), A) and np.array_equal(first_rows(joined, 6, 9).toarray(), H)
    for matrix in (M, joined, first_rows(M, 6, 6)):
        matrix.check_format(full_check=True)
