"""Products with a transposed sparse matrix and sums over squares of its columns, beside SciPy's."""

import numpy as np
import pytest
import scipy.sparse as sp
from numpy.testing import assert_allclose, assert_array_equal

from fcsim.linear.sparse import _vectors_kernels as kernels
from fcsim.linear.sparse.columns import entries_of_rows, normals_of_some, rows_kept, times, transposed_times


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


def contacts(rng: np.random.Generator) -> sp.csc_array:
    """Columns by threes of the same rows, of a contact's, and some of others between them."""
    dense = np.repeat(rng.random((40, 9)) < 0.2, 3, axis=1) * rng.standard_normal((40, 27))
    dense[:, [4, 13]] = 0
    return sp.csc_array(np.hstack([dense, dense[:, :2]]))


@pytest.mark.parametrize("form", ["csr", "csc", "dense"])
def test_products_are_scipys(form: str) -> None:
    """Bit for bit, and of columns by threes, too."""
    rng = np.random.default_rng(3)
    for A in (contacts(rng), sp.random_array((40, 27), density=0.3, rng=rng, format="csc")):
        x, y = rng.standard_normal(A.shape[1]), rng.standard_normal(40)
        other = A.toarray() if form == "dense" else A.asformat(form)
        (assert_allclose if form == "dense" else assert_array_equal)(times(other, x), A @ x)
        assert_array_equal(transposed_times(A, y), A.T @ y)
    with pytest.raises(ValueError):
        times(A, np.zeros(40))


def test_rows_are_renumbered_and_left_out() -> None:
    rng = np.random.default_rng(4)
    A, place = contacts(rng), np.full(40, -1)
    kept = np.sort(rng.choice(40, 25, replace=False))
    place[kept] = np.arange(25)
    found = rows_kept(A, place, 25)
    assert found.has_canonical_format
    assert_array_equal(found.toarray(), A.toarray()[kept])
    for form in (A, sp.csr_array(A)):
        assert_array_equal(entries_of_rows(form), np.count_nonzero(A.toarray(), axis=1))
    last = np.where(np.arange(40) < 30, np.arange(40), -1)  # the first rows stay where they are
    for given in (A, sp.csc_array((A.data, A.indices, A.indptr), shape=A.shape)):
        assert_array_equal(rows_kept(given, last, 40).toarray(), np.where(last[:, None] >= 0, A.toarray(), 0.0))
    assert rows_kept(A, np.full(40, -1), 3).toarray().tolist() == np.zeros((3, A.shape[1])).tolist()


def test_rows_of_bodies_are_those_of_lists() -> None:
    """What bodies that share a part take from a vector, and put there, as lists of their numbers do."""
    rng = np.random.default_rng(6)
    first, some = np.array([3, 40, 15]), np.array([0, 2, 3, 9])
    dofs = first[:, None] + np.arange(10)
    x, lumped, rows, columns = rng.standard_normal(50), rng.random(10), np.empty((3, 10)), np.empty((4, 3))
    kernels.rows_of(first, x, rows)
    assert_array_equal(rows, x[dofs])
    kernels.columns_of(first, some, x, columns)
    assert_array_equal(columns, x[dofs[:, some]].T)
    found, expected = np.zeros((2, 50))
    for put in (rows, np.asfortranarray(rows)):
        kernels.put_rows(first, put, found)
        expected[dofs] = rows
        assert_array_equal(found, expected)
    kernels.put_columns(first, some, -columns, found)
    expected[dofs[:, some]] = -columns.T
    assert_array_equal(found, expected)
    kernels.put_lumped(first, lumped, x, found)
    expected[dofs] = lumped * x[dofs]
    assert_array_equal(found, expected)
    kernels.blended(first, x, found, 0.3, rows)
    assert_array_equal(rows, 0.3 * found[dofs] + (1 - 0.3) * x[dofs])


def test_a_vector_of_another_length_is_refused_as_scipy_does() -> None:
    with pytest.raises(ValueError):
        transposed_times(sp.csr_array((40, 27)), np.zeros(27))


@pytest.mark.parametrize("form", ["csr", "csc"])
def test_squares_of_every_third_column_that_some_rows_touch(form: str) -> None:
    rng = np.random.default_rng(2)
    A, weight = sp.random_array((40, 27), density=0.2, rng=rng, format=form), rng.uniform(size=40)
    some = np.zeros(40, dtype=bool)
    some[[3, 17]] = True
    whole, others, touched = normals_of_some(A, weight, some, 3)
    dense = A.toarray()[:, ::3]
    assert_array_equal(touched, (dense[some] != 0).any(axis=0))
    assert touched.any() and not touched.all()
    assert_allclose(whole, np.where(touched, weight @ dense**2, 0.0), rtol=1e-14)
    assert_allclose(others, np.where(touched, (weight * ~some) @ dense**2, 0.0), rtol=1e-14)
