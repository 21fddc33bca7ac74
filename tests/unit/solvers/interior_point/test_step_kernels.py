"""The compiled steps of the interior point against the same in NumPy, by the algebra of cones and by NumPy's linear algebra."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import scipy.linalg as sla
import scipy.sparse as sp
from numpy.testing import assert_allclose

from fcsim.solvers.interior_point import _step_kernels as kernels
from fcsim.solvers.interior_point.cones import ConeAlgebra, NesterovTodd
from fcsim.solvers.interior_point.pairs import ContactPairs
from fcsim.solvers.newton.systems._velocity_kernels import by_contacts

MU = np.array([0.3, 0.0, 1.2, 0.05, 5.0, 0.0, 0.7])
NC, ROUGH = len(MU), np.flatnonzero(MU > 0)


class Twin:
    """A point inside, its sides of no common path, its scaling in NumPy, and that of the kernels."""

    def __init__(self, d: int) -> None:
        rng = self.rng = np.random.default_rng(d)
        self.d, self.pairs = d, ContactPairs(MU, d)
        self.algebra = ConeAlgebra(self.pairs)
        (self.x, _), (_, self.y) = (
            self.pairs.centred(*rng.standard_normal((2, NC, d)), 10.0 ** rng.uniform(-2, 0, NC), np.ones(NC)) for _ in range(2)
        )
        self.R = self.pairs.contact_reaction(self.x)
        self.V = NesterovTodd(self.pairs, self.y, self.x)
        *self.scaling, self.point, self.squared = kernels.scaling(self.x, self.y, NC, len(ROUGH), d)

    def any_point(self) -> np.ndarray:
        return self.rng.standard_normal(len(self.x))

    def matrix(self) -> np.ndarray:
        """V, column by column."""
        return np.column_stack([self.V.apply(column) for column in np.eye(len(self.x))])


@pytest.fixture(params=[2, 3], name="twin")
def _twin(request: Any) -> Twin:
    return Twin(request.param)


def test_scaling(twin: Twin) -> None:
    """V x = V^-1 y = point; it is the one of `NesterovTodd`, by its matrix."""
    assert_allclose(twin.point, twin.V.point, rtol=1e-10)
    assert_allclose(twin.point, twin.V.apply(twin.y, inverse=True), atol=1e-8 * twin.point.max())
    assert_allclose(twin.squared, twin.algebra.product(twin.point, twin.point), rtol=1e-12)
    line, axis, beta = twin.scaling
    J = np.diag(np.r_[1.0, -np.ones(twin.d - 1)])
    cones = beta[:, None, None] * (2 * axis[:, :, None] * axis[:, None, :] - J)
    assert_allclose(sla.block_diag(np.diag(line), *cones), twin.matrix(), rtol=1e-10, atol=1e-12)


def test_equations(twin: Twin) -> None:
    """A du + B dr = ... is u's part of V^2 dx + dy, s left out; nothing slides where mu = 0."""
    d, velocity = twin.d, twin.rng.standard_normal((NC, twin.d))
    A, B, apart = kernels.equations(*twin.scaling, twin.y, velocity, MU, ROUGH)
    square = twin.matrix() @ twin.matrix()
    dr, du = twin.rng.standard_normal((NC, d)), twin.rng.standard_normal((NC, d))
    dr[MU == 0, 1:] = du[MU == 0, 1:] = 0
    expected = du + twin.pairs.contact_velocity(square @ twin.pairs.reactions(dr))
    found = np.einsum("aij,aj->ai", A, du) + np.einsum("aij,aj->ai", B, dr)
    assert_allclose(found, expected, rtol=1e-9, atol=1e-10 * np.abs(expected).max())
    smooth = MU == 0
    assert_allclose(A[smooth, 1:, 1:], 0)
    assert_allclose(B[smooth, 1:, 1:], np.tile(np.eye(d - 1), (2, 1, 1)))
    left = velocity - twin.pairs.contact_velocity(twin.y)
    left[smooth, 1:] = 0
    assert_allclose(apart, left, atol=1e-14)


def test_right_side(twin: Twin) -> None:
    target, apart = twin.any_point(), twin.rng.standard_normal((NC, twin.d))
    b, rhs = kernels.right_side(*twin.scaling, twin.point, target, 0.7, apart, ROUGH)
    assert_allclose(twin.algebra.product(twin.point, b), target, rtol=1e-8, atol=1e-9)
    assert_allclose(rhs, twin.pairs.contact_velocity(twin.V.apply(b)) - 0.7 * apart, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3])
def test_changes_and_how_far_they_lead(twin: Twin, size: float) -> None:
    """Steps shorter than 1 end where one side's least eigenvalue is zero; a change of 1e-3 is inside as a whole."""
    b, dr = size * twin.any_point() * twin.point.min(), size * twin.point.min() * twin.rng.standard_normal((NC, twin.d))
    dx, dy, t = kernels.changes(*twin.scaling, twin.point, b, dr, MU, ROUGH)
    assert_allclose(dx, twin.V.apply(twin.pairs.reactions(dr)), rtol=1e-9, atol=1e-12)
    assert_allclose(dx + dy, b, rtol=1e-12, atol=1e-12)
    assert t == pytest.approx(min(twin.algebra.longest_step(twin.point, dx), twin.algebra.longest_step(twin.point, dy)), rel=1e-9)
    least = min(twin.algebra.least(twin.point + t * dx), twin.algebra.least(twin.point + t * dy))
    assert least == pytest.approx(0, abs=1e-9 * max(np.abs(dx).max(), np.abs(dy).max(), 1.0)) if t < 1 else least > 0
    assert t == 1 if size == 1e-3 else t < 1 or size < 1e3


def test_corrected(twin: Twin) -> None:
    dx, dy, centre = twin.any_point(), twin.any_point(), twin.any_point()
    target = kernels.corrected(twin.squared, dx, dy, centre, 0.3, 0.5, NC, twin.d)
    assert_allclose(target, 0.3 * centre - twin.squared - 0.5 * twin.algebra.product(dx, dy), rtol=1e-12, atol=1e-13)


@pytest.mark.parametrize("t", [1e-3, 1e3])
def test_moved(twin: Twin, t: float) -> None:
    dr, dy = twin.rng.standard_normal((NC, twin.d)) * twin.x.min(), twin.any_point() * twin.point.min()
    R, x, y, inside, products = kernels.moved(twin.R, dr, twin.y, dy, t, *twin.scaling, MU, ROUGH)
    assert_allclose(R, twin.R + t * dr, rtol=1e-14)
    assert_allclose(x, twin.pairs.reactions(R), rtol=1e-14)
    assert_allclose(y, twin.y + t * twin.V.apply(dy), rtol=1e-9, atol=1e-12)
    assert inside == (twin.algebra.least(x) > 0 and twin.algebra.least(y) > 0) == (t == 1e-3)
    assert products == pytest.approx(x @ y, rel=1e-12)


@pytest.mark.parametrize("d", [2, 3])
def test_elimination_in_the_bodies_velocities(d: int) -> None:
    """dr = c - K H^T dv with (M + H K H^T) dv = H c solves (A (W + own) + B) dr = rhs, W = H^T M^-1 H; and the defect is what is left."""
    rng, n = np.random.default_rng(d), 9
    HT = sp.random_array((NC * d, n), density=0.4, rng=rng, format="csr") * 2 - sp.random_array((NC * d, n), density=0.2, rng=rng)
    HT = sp.csr_array(HT)
    unknowns, h = by_contacts(HT.indptr, HT.indices, HT.data, d, n)
    A, B, own = rng.standard_normal((NC, d, d)), rng.standard_normal((NC, d, d)), rng.uniform(0.5, 1, (NC, d))
    B[0, 0] = 0.0
    rhs = rng.standard_normal((NC, d))
    inverse, K, singular = kernels.inverted(A, B, own)
    assert singular == -1
    C = A * own[:, None, :] + B
    assert_allclose(inverse, np.linalg.inv(C), rtol=1e-9, atol=1e-11)
    assert_allclose(K, np.linalg.solve(C, A), rtol=1e-9, atol=1e-10)
    c, right = kernels.to_bodies(inverse, rhs, unknowns, h, n)
    assert_allclose(right, HT.T @ c.ravel(), atol=1e-10)
    H = HT.toarray().T
    dv = np.linalg.solve(np.eye(n) + H @ sla.block_diag(*K) @ H.T, right)
    dr = kernels.from_bodies(c, K, dv, unknowns, h)
    big_A, big_B = (sla.block_diag(*blocks) for blocks in (A, B))
    whole = big_A @ (H.T @ H + np.diag(own.ravel())) + big_B
    assert_allclose(dr.ravel(), np.linalg.solve(whole, rhs.ravel()), rtol=1e-7, atol=1e-8)
    other = rng.standard_normal((NC, d))
    assert_allclose(kernels.defect(A, B, other, dr, rhs).ravel(), rhs.ravel() - big_A @ other.ravel() - big_B @ dr.ravel(), atol=1e-11)


def test_a_contact_without_a_pivot_is_named() -> None:
    A, B, own = np.tile(np.eye(3), (2, 1, 1)), np.zeros((2, 3, 3)), np.ones((2, 3))
    own[1, 2] = 0.0
    assert kernels.inverted(A, B, own)[2] == 1
