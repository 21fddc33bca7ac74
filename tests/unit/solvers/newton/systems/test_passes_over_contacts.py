"""Compiled passes over contacts and joints of the two-level system beside NumPy's lines for the same."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from fcsim.solvers.newton._formulation_kernels import disk_misses
from fcsim.solvers.newton.formulations import alart_curnier
from fcsim.solvers.newton.systems.two_level import _block_kernels as block_kernels
from fcsim.solvers.newton.systems.two_level import _joint_kernels as kernels


def linearisation(n: int, d: int) -> tuple[np.ndarray, np.ndarray]:
    """A and B of contacts of which some stick (A diagonal, B zero), slide and are open, and one has no equation at all."""
    rng = np.random.default_rng(2)
    A, B = rng.standard_normal((n, d, d)), rng.standard_normal((n, d, d))
    A[::3], B[::3] = rng.uniform(0.5, 2.0, (len(A[::3]), d))[:, :, None] * np.eye(d), 0
    A[1], B[1] = 0, np.eye(d)
    A[2] = B[2] = 0
    A[3, 0, 0] = 0  # diagonal, but singular
    return A, B


@pytest.mark.parametrize("d", [2, 3])
def test_what_contacts_miss_is_that_of_their_equations(d: int) -> None:
    rng = np.random.default_rng(0)
    u, r, rho = rng.standard_normal((300, d)), rng.standard_normal((300, d)), rng.uniform(0.5, 2.0, (300, d))
    mu, weight = rng.choice([0.0, 0.5, 5.0], 300), rng.uniform(1.0, 3.0, 300)
    F, _, B = alart_curnier(u, r, mu, rho)
    assert {0, 1} <= set(B[:, 0, 0])  # open and closed ones
    assert np.any(~B.any(axis=(1, 2)))  # and some that stick
    assert_allclose(disk_misses(u, r, mu, rho, weight), np.sum((weight[:, None] * F) ** 2, axis=1), rtol=1e-14)


def test_contacts_have_changed_where_one_entry_has() -> None:
    """The order of the joints is another one than the contacts'; nothing is known at first; what has changed is taken over, no more."""
    n, d, share = 60, 3, 0.05
    rng, (A, B) = np.random.default_rng(1), linearisation(60, 3)
    order, far = rng.permutation(n), np.empty(n, dtype=bool)
    A_before, B_before = np.full((2, n, d, d), np.nan)
    kernels.changed_contacts(A, B, order, share, A_before, B_before, 0, n, far)
    assert far.all()
    assert_array_equal(A_before, A[order])
    A_now, B_now = A * (1 + 0.04 * rng.uniform(-1, 1, A.shape)), B + 0.04 * rng.uniform(-1, 1, B.shape)
    A_now[7, 0, 1] += 0.11 * np.abs(A[7]).max()
    B_now[9, 2, 2] -= 0.1
    A_now[11, 1, 1] = np.nan
    kernels.changed_contacts(A_now, B_now, order, share, A_before, B_before, 0, 40, far)
    kernels.changed_contacts(A_now, B_now, order, share, A_before, B_before, 40, n, far)
    assert_array_equal(np.sort(order[far]), [7, 9, 11])
    for own, before, now in ((A_before, A, A_now), (B_before, B, B_now)):
        assert_array_equal(own[far], now[order[far]])
        assert_array_equal(own[~far], before[order[~far]])


def test_a_diagonal_has_moved_by_a_share_of_its_largest_entry() -> None:
    before = np.array([[1.0, 4.0, 2.0], [3.0, 3.0, 3.0]])
    for change, expected in ((0.19, False), (0.21, True), (-0.21, True)):
        now = before.copy()
        now[0, 0] += change
        assert kernels.moved(now, before, 0.05) is expected


@pytest.mark.parametrize("d", [2, 3])
def test_products_with_mostly_diagonal_blocks_are_those_with_all_blocks(d: int) -> None:
    n = 50
    rng, (A, B) = np.random.default_rng(3), linearisation(n, d)
    y, x, z = rng.standard_normal((n, d)), rng.standard_normal((n, d)), np.full((n, d), np.nan)
    alone, diagonal = block_kernels.diagonals(A, B)
    assert_array_equal(np.flatnonzero(alone), np.arange(0, n, 3)[np.arange(0, n, 3) != 3])
    block_kernels.apply_most_diagonal(A, B, alone, diagonal, y, x, 0, 20, z)
    block_kernels.apply_most_diagonal(A, B, alone, diagonal, y, x, 20, n, z)
    assert_allclose(z, np.einsum("aij,aj->ai", A, y) + np.einsum("aij,aj->ai", B, x), rtol=0, atol=1e-13)


@pytest.mark.parametrize("d", [2, 3])
def test_rows_of_contacts_that_stick_are_those_of_the_inverse(d: int) -> None:
    n = 50
    rng, (A, B) = np.random.default_rng(5), linearisation(n, d)
    rhs, c = rng.standard_normal((n, d)), rng.uniform(1, 2, n)
    regular = np.delete(np.arange(n), [2, 3])
    found = kernels.normalised(A, B, rhs, c)
    inverse = np.linalg.inv((A * c[:, None, None] + B)[regular])
    assert_allclose(found[0][regular], inverse @ A[regular], rtol=1e-8, atol=1e-9)
    assert_allclose(found[1][regular], inverse @ B[regular], rtol=1e-8, atol=1e-9)
    assert_allclose(found[2][regular], np.einsum("aij,aj->ai", inverse, rhs[regular]), rtol=1e-8, atol=1e-9)
    for own, given in zip(found, (A, B, rhs), strict=True):
        assert_array_equal(own[[2, 3]], given[[2, 3]])


def test_three_products_at_once_are_those_in_double_precision() -> None:
    rng = np.random.default_rng(6)
    for n in (0, 1, 7, 31, 32, 33, 99, 130):
        rows, x = rng.standard_normal((3, n)).astype(np.float32), rng.standard_normal(n).astype(np.float32)
        expected = rows.astype(float) @ x.astype(float)
        assert_allclose(block_kernels.three_dots(*rows, x), expected, rtol=0, atol=1e-6 * (1 + n) ** 0.5)
