"""Rigid bodies' arrays: rotations past pi, inertia in the bodies' axes, angular momentum, the factor that follows."""

import itertools

import numpy as np
import pytest
import scipy.sparse as sp
from numpy.testing import assert_allclose
from scipy.linalg import block_diag
from scipy.spatial.transform import Rotation

from fcsim.assembly.compliance import SystemFactor
from fcsim.assembly.kinematics import _rigid_kernels as kernels
from fcsim.assembly.model import Model, build_model
from fcsim.assembly.rigid import RigidBodies, inverse_on
from fcsim.assembly.supports import Support
from fcsim.mesh.part import RigidBody
from fcsim.timestep.step_equation.compliance import StepCompliance

LONG, TALL = np.diag([1.0, 5.0, 7.0]), np.array([[2.0, 0.3, 0.1], [0.3, 1.0, -0.2], [0.1, -0.2, 3.0]])


def body(name: str, inertia: np.ndarray, mass: float = 2.0) -> RigidBody:
    return RigidBody(name, mass, inertia, np.array([1.0, 2.0, 3.0]), np.eye(3), {"face": [[0, 1, 2]]})


def random_configuration(model: Model, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-1.5, 1.5, model.n_dofs)


def test_rotations_go_on_past_pi() -> None:
    """In steps about one axis the angle is the sum up to whole turns; the vector stays within pi and no step is lost at pi itself."""
    bodies, axis = RigidBodies([body("a", LONG)], 3), np.array([0.36, 0.48, 0.8])
    q, dq, total = np.zeros((1, 6)), np.zeros((1, 6)), 0.0
    for angle in [np.pi, 0.0, 1e-9, 0.5, np.pi - 0.5, 2.0, 1e-14, 3.0, -7.0, 12.0]:
        dq[:, 3:] = angle * axis
        q, total = bodies.advance(q, dq), total + angle
        assert np.linalg.norm(q[0, 3:]) <= np.pi * (1 + 1e-15)
        assert_allclose(bodies.rotation(q)[0], Rotation.from_rotvec(total * axis).as_matrix(), atol=1e-14)


@pytest.mark.parametrize("size", [0.0, 1e-200, 1e-12, 0.99e-4, 1.01e-4, 1.0, np.pi - 1e-9, np.pi, 4.0, 100.0])
def test_rotations_are_those_of_scipy(size: float) -> None:
    """On both sides of the angle up to which a series is taken, and through pi."""
    rng = np.random.default_rng(8)
    first, last = (x * size / np.linalg.norm(x, axis=1)[:, None] for x in rng.standard_normal((2, 20, 3)))
    R = kernels.rotation_matrices(first)
    assert_allclose(R, Rotation.from_rotvec(first).as_matrix(), rtol=1e-15, atol=5e-15 * max(1.0, size))
    composed = kernels.composed_vectors(last, first)
    expected = Rotation.from_rotvec(last) * Rotation.from_rotvec(first)
    assert_allclose(Rotation.from_rotvec(composed).as_matrix(), expected.as_matrix(), atol=5e-15 * max(1.0, size))
    assert np.all(np.linalg.norm(composed, axis=1) <= np.pi * (1 + 1e-15))
    if size < 1e-3:
        assert_allclose(composed, expected.as_rotvec(), rtol=1e-13, atol=1e-16 * size)


def test_inertia_turns_with_the_body() -> None:
    model = build_model([body("a", LONG), body("b", TALL, 4.0)])
    x = random_configuration(model)
    M, R = model.rigid_mass(x), model.rigid_rotation(x)
    for k, (inertia, mass) in enumerate(((LONG, 2.0), (TALL, 4.0))):
        assert_allclose(M[k, 3:, 3:], R[k] @ inertia @ R[k].T, atol=1e-14)
        assert_allclose(M[k, :3, :3], mass * np.eye(3))
        assert not M[k, :3, 3:].any() and not M[k, 3:, :3].any()
    v = np.random.default_rng(1).standard_normal(12)
    assert_allclose(model.apply_mass(v, M), np.einsum("aij,aj->ai", M, v.reshape(2, 6)).ravel())
    assert_allclose(model.rigid_mass(np.zeros(12)), model.rigid_mass(), atol=1e-15)


def test_isotropic_inertia_is_one_array() -> None:
    """A cube's inertia with the round-off of another order of sums is isotropic; plane bodies always are."""
    ball = build_model([body("a", np.diag([0.3, 0.3, 0.1 + 0.1 + 0.1]))])
    assert ball.rigid_mass(random_configuration(ball)) is ball.rigid_mass()
    plane = build_model([RigidBody("a", 1.0, np.eye(1), np.zeros(2), np.eye(2))])
    assert plane.rigid_mass(np.array([1.0, 2.0, 3.0])) is plane.rigid_mass()
    assert not RigidBodies([], 3).turning
    assert build_model([body("a", np.diag([0.3, 0.3, 0.301]))]).rigid_bodies.turning


@pytest.mark.parametrize("held", [(), ("rz",), ("rx", "ry"), ("rx", "ry", "rz")])
def test_momentum_is_kept_on_free_rotations(held: tuple[str, ...]) -> None:
    model = build_model([body("a", TALL), body("b", LONG)], supports=[Support("a", held)] if held else [])
    x, other = random_configuration(model), random_configuration(model, 1)
    v = np.random.default_rng(2).standard_normal(12)
    kept = model.keep_momentum(v, model.rigid_mass(other), x)
    before, after = model.apply_mass(v, model.rigid_mass(other)), model.apply_mass(kept, model.rigid_mass(x))
    free = model.rigid_free.ravel()
    assert_allclose(after[free], before[free], atol=1e-13)
    assert_allclose(kept[~free], v[~free])
    assert_allclose(model.rigid_part(kept)[:, :3], model.rigid_part(v)[:, :3])
    if len(held) < 3:
        assert np.abs(kept - v).max() > 0.1


def test_free_end_is_the_solution_of_its_equation() -> None:
    """J(R) omega = L with R = exp(dt omega) R_m, for turns of a small and of a large angle; held bodies turn as they did."""
    bodies = RigidBodies([body("a", TALL), body("b", LONG), body("c", LONG)], 3)
    rng = np.random.default_rng(3)
    middle, velocity = rng.uniform(-1, 1, (3, 6)), rng.standard_normal((3, 3))
    free = np.array([[True] * 3, [True] * 3, [True, False, True]])
    for dt in (1e-3, 0.3):
        L = rng.standard_normal((3, 3))
        J = bodies.free_end_mass(middle, L, velocity, dt, free)[:, 3:, 3:]
        omega = np.linalg.solve(J, L[:, :, None])[:, :, 0]
        omega[2] = velocity[2]
        R = (Rotation.from_rotvec(dt * omega) * Rotation.from_rotvec(middle[:, 3:])).as_matrix()
        assert_allclose(J, R @ bodies.inertia @ R.transpose(0, 2, 1), atol=1e-12)


@pytest.mark.parametrize("driven", ["eliminated", "identity"])
def test_factor_follows_the_inertia(driven: str) -> None:
    supports = [Support("b", ("x", "ry")), Support("c", ("x", "y", "z", "rx", "ry", "rz"))]
    model = build_model([body("a", TALL), body("b", LONG), body("c", LONG)], supports=supports, driven=driven)  # type: ignore[arg-type]
    reference = SystemFactor(model, 1.5, 0.0, np.arange(3))
    mass = model.rigid_mass(random_configuration(model))
    factor = reference.with_rigid_mass(mass)
    A = 1.5 * block_diag(*mass)
    A[model.driven_dofs, :] = A[:, model.driven_dofs] = 0
    A[model.driven_dofs, model.driven_dofs] = 1
    rng = np.random.default_rng(4)
    H, rhs = rng.standard_normal((18, 9)), rng.standard_normal(18)
    H[model.driven_dofs] = 0
    own = model.free_dofs if driven == "eliminated" else np.arange(18)
    A, H, rhs = A[np.ix_(own, own)], H[own], rhs[own]
    assert_allclose(factor.matrix().toarray(), A, atol=1e-14)
    assert_allclose(factor.solve(rhs), np.linalg.solve(A, rhs), atol=1e-13)
    assert_allclose(StepCompliance(factor).delassus(sp.csr_array(H), 3), H.T @ np.linalg.solve(A, H), atol=1e-12)
    assert reference.with_rigid_mass(model.rigid_mass()) is reference
    assert factor.matrix() is factor.matrix() and reference.matrix() is reference.matrix()
    assert np.abs(reference.matrix().toarray() - A).max() > 0.1


def test_inverse_on_the_free_entries() -> None:
    A = np.random.default_rng(5).standard_normal((4, 3, 3))
    A = A @ A.transpose(0, 2, 1) + np.eye(3)
    free = np.array([[1, 1, 1], [1, 0, 1], [0, 0, 0], [0, 1, 0]], dtype=bool)
    for inverse, matrix, own in zip(inverse_on(free, A), A, free, strict=True):
        block = np.ix_(own, own)
        expected = np.zeros((3, 3))
        expected[block] = np.linalg.inv(matrix[block])
        assert_allclose(inverse, expected, atol=1e-13)


@pytest.mark.parametrize("eliminated", [False, True])
def test_the_mass_matrix_of_rigid_bodies_by_rows(eliminated: bool) -> None:
    """diag(M_a) on the free dofs, as SciPy makes it; rows of the identity in the place of driven ones where these stay; no zeros."""
    rng = np.random.default_rng(3)
    blocks, free = rng.standard_normal((5, 6, 6)), rng.random((5, 6)) < 0.6
    blocks[:, :3, 3:] = blocks[:, 3:, :3] = 0.0
    blocks[2], free[3], free[4] = np.diag(np.arange(6.0)), False, True
    kept = free.ravel()
    expected = block_diag(*blocks) * np.outer(kept, kept) + np.diag(1.0 - kept)
    expected = expected[np.ix_(kept, kept)] if eliminated else expected
    indptr, indices, data = kernels.rows_of_blocks(blocks, free, eliminated)
    rows = sp.csr_array((data, indices, indptr), shape=expected.shape)
    assert np.array_equal(rows.toarray(), expected)
    assert rows.nnz == np.count_nonzero(expected)
    assert all(np.all(np.diff(indices[begin:end]) > 0) for begin, end in itertools.pairwise(indptr))
