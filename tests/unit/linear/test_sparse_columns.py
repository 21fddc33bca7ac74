"""Products with a transposed sparse matrix and sums over squares of its columns, beside SciPy's."""

import numpy as np
import pytest
import scipy.sparse as sp
from numpy.testing import assert_allclose, assert_array_equal

from fcsim.linear.sparse.columns import normals_of_some, transposed_times


@pytest.mark.parametrize("form", ["csr", "csc", "coo", "dense"])
def test_transposed_products_are_scipys(form: str) -> None:
    """Bit for bit where the order of summation is the same."""
    rng = np.random.default_rng(1)
    A = sp.random_array((40, 27), density=0.2, rng=rng, format="csr" if form == "dense" else form)
    x = rng.standard_normal(40)
    found = transposed_times(A.toarray() if form == "dense" else A, x)
    (assert_allclose if form == "dense" else assert_array_equal)(found, A.T @ x)
    empty = sp.csr_array((40, 0))
    assert transposed_times(empty, x).shape == (0,)


def test_a_vector_of_another_length_is_refused_as_scipy_does() -> None:
    with pytest.raises(ValueError):
        transposed_times(sp.csr_array((40, 27)), np.zeros(27))


def test_squares_of_every_third_column_that_some_rows_touch() -> None:
    rng = np.random.default_rng(2)
    A, weight = sp.random_array((40, 27), density=0.2, rng=rng, format="csr"), rng.uniform(size=40)
    some = np.zeros(40, dtype=bool)
    some[[3, 17]] = True
    whole, others, touched = normals_of_some(A, weight, some, 3)
    dense = A.toarray()[:, ::3]
    assert_array_equal(touched, (dense[some] != 0).any(axis=0))
    assert touched.any() and not touched.all()
    assert_allclose(whole, np.where(touched, weight @ dense**2, 0.0), rtol=1e-14)
    assert_allclose(others, np.where(touched, (weight * ~some) @ dense**2, 0.0), rtol=1e-14)
