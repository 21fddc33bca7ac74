"""The condensed elimination's kernels against NumPy."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from fcsim.linear.factors import SingularMatrix
from fcsim.solvers.newton.systems._condensed_kernels import apply_blocks, held_side, left_over, own_blocks, roles, signed
from fcsim.solvers.newton.systems.remainder import split_known


def contacts(d: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A, B and rhs of contacts that are open, stick, slide with a known normal component, and slide."""
    rng = np.random.default_rng(d)
    A, B, rhs = rng.standard_normal((12, d, d)), rng.standard_normal((12, d, d)), rng.standard_normal((12, d))
    A[:3], B[:3] = 0, np.eye(d)
    B[3:6] = 0
    B[6:9, 0], A[6:9, 0, 1:] = 0, 0
    return A, B, rhs


@pytest.mark.parametrize("d", [2, 3])
def test_roles_and_known_components(d: int) -> None:
    A, B, rhs = contacts(d)
    A[11, 0, 0] = 0  # closed by its other entries
    closed, sticking = roles(A, B)
    assert_array_equal(closed, np.arange(12) >= 3)
    assert_array_equal(sticking, (np.arange(12) >= 3) & (np.arange(12) < 6))
    x, unknown = split_known(A[3:], B[3:], rhs[3:])
    assert not unknown[:3].any() and not unknown[3:6, 0].any() and unknown[3:6, 1:].all() and unknown[6:].all()
    assert_allclose(np.einsum("aij,aj->ai", A[3:6], x[:3]), rhs[3:6], atol=1e-12)
    assert_allclose(A[6:9, 0, 0] * x[3:6, 0], rhs[6:9, 0])
    assert not x[unknown].any()


@pytest.mark.parametrize("d", [2, 3])
def test_a_singular_block_is_said(d: int) -> None:
    A, B, rhs = contacts(d)
    A[4] = np.outer(np.ones(d), np.ones(d))
    with pytest.raises(SingularMatrix, match="sticking contact"):
        split_known(A[3:], B[3:], rhs[3:])
    stays = np.ones(12, dtype=bool)
    assert not held_side(A, rhs, np.zeros((12, d)), np.arange(12), stays, np.empty((12, d)))


@pytest.mark.parametrize("d", [2, 3])
def test_products_and_sides(d: int) -> None:
    rng = np.random.default_rng(7)
    A, B, rhs = rng.standard_normal((9, d, d)), rng.standard_normal((9, d, d)), rng.standard_normal((9, d))
    y, x = rng.standard_normal((2, 9, d))
    assert_allclose(apply_blocks(A, y, B, x), np.einsum("aij,aj->ai", A, y) + np.einsum("aij,aj->ai", B, x), atol=1e-13)
    some, stays = np.array([7, 2, 4]), np.array([True, False, True])
    t = np.empty((3, d))
    assert held_side(A, rhs, y, some, stays, t)
    expected = np.linalg.solve(A[some], rhs[some][:, :, None])[:, :, 0] * stays[:, None] - y[some]
    assert_allclose(t, expected, atol=1e-11)
    known = x[:3].copy()
    signed(known, stays, y, some)
    assert_allclose(known, np.where(stays[:, None], -x[:3], x[:3] + y[some]))
    unknown = rng.random((3, d)) < 0.6
    left = left_over(A[:3], B[:3], y[:3], x[:3], rhs, some, unknown)
    full = rhs[some] - np.einsum("aij,aj->ai", A[:3], y[:3]) - np.einsum("aij,aj->ai", B[:3], x[:3])
    assert_allclose(left, full[unknown], atol=1e-13)
    G = rng.standard_normal((3 * d, 3 * d))
    blocks = np.stack([G[d * a : d * a + d, d * a : d * a + d] for a in range(3)])
    both = unknown[:, :, None] & unknown[:, None, :]
    assert_allclose(own_blocks(G, A[:3], B[:3], unknown), np.where(both, A[:3] @ blocks + B[:3], np.eye(d)), atol=1e-13)
