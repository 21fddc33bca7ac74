"""Diagonal blocks of an inverse by its multifrontal factor, against the dense inverse."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from fcsim.linear._front_kernels import times_blocks
from fcsim.linear.block_rows import dofs_of
from fcsim.linear.fronts import MultifrontalCholesky, inverse_blocks
from fcsim.linear.joints import BlockRows
from tests.unit.linear.test_fronts import wall


@pytest.mark.parametrize(("precision", "tolerance"), [(np.float64, 1e-11), (np.float32, 1e-3)])
@pytest.mark.parametrize("d", [2, 3])
def test_blocks_of_the_joints(d: int, precision: type, tolerance: float) -> None:
    W, joint = wall(4, 5, 7, d, 1)
    factor = MultifrontalCholesky(BlockRows(W, d), np.ones(len(joint), dtype=bool), precision)
    ends = np.flatnonzero(np.diff(joint[factor.contacts])) + 1
    cuts = d * np.concatenate([[0], ends, [len(joint)]])
    blocks, at = inverse_blocks(factor, cuts), 0
    assert blocks.dtype == precision
    unknowns, inverse = dofs_of(factor.contacts, d), np.linalg.inv(W.toarray())
    for begin, end in pairwise(cuts):
        expected = inverse[np.ix_(unknowns[begin:end], unknowns[begin:end])]
        assert_allclose(blocks[at : at + expected.size].reshape(expected.shape), expected, atol=tolerance * np.abs(inverse).max())
        at += expected.size
    assert at == len(blocks)


def test_of_one_front() -> None:
    W, joint = wall(1, 2, 5, 3, 0)
    factor = MultifrontalCholesky(BlockRows(W, 3), np.ones(len(joint), dtype=bool))
    assert len(factor.fronts) == 1
    unknowns = dofs_of(factor.contacts, 3)
    expected = np.linalg.inv(W.toarray()[np.ix_(unknowns, unknowns)])
    assert_allclose(inverse_blocks(factor, np.array([0, W.shape[0]])).reshape(W.shape), expected, atol=1e-11)


def test_a_vector_times_some_blocks() -> None:
    rng = np.random.default_rng(0)
    cuts, which = np.array([0, 3, 9, 15]), np.array([0, 2])
    first, last, x = rng.standard_normal((3, 3)), rng.standard_normal((6, 6)), rng.standard_normal(15)
    y = x.copy()
    times_blocks(np.concatenate([first.ravel(), last.ravel()]), cuts, which, y)
    assert_allclose(y[:3], first @ x[:3], rtol=1e-13)
    assert_array_equal(y[3:9], x[3:9])
    assert_allclose(y[9:], last @ x[9:], rtol=1e-13)
    times_blocks(np.empty(0), cuts, which[:0], y)
