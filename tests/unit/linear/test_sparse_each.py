"""A sparse matrix times many vectors by rows, some at a time, against one product."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp
from numpy.testing import assert_array_equal

from fcsim.linear.sparse import each


@pytest.mark.parametrize("count", [0, 1, 7, 1500])
def test_each_vector_has_its_own_product(count: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """The last bit too: entries are summed in the matrix' order."""
    monkeypatch.setattr(each, "FEW", 30 * 20)
    rng = np.random.default_rng(0)
    A, X = sp.csr_array(sp.random_array((40, 30), density=0.3, rng=rng)), rng.standard_normal((count, 30))
    assert_array_equal(each.times_each(A, X), (A @ X.T).T)


@pytest.mark.parametrize("count", [24, 48, 64, 96, 100, 192])
def test_full_lanes_go_through_the_matrix_together(count: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also of few vectors, as a rank has of a wall's bodies, with the same bits; where lanes would be empty SciPy multiplies."""
    compiled, by_rows = list[int](), each.times_rows
    monkeypatch.setattr(each, "times_rows", lambda *given: compiled.append(1) or by_rows(*given))
    rng = np.random.default_rng(0)
    A, X = sp.csr_array(sp.random_array((40, 30), density=0.3, rng=rng)), rng.standard_normal((count, 30))
    assert_array_equal(each.times_each(A, X), (A @ X.T).T)
    assert bool(compiled) == (count in (64, 96, 192))
