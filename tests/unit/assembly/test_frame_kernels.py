"""Compiled loops of floating frames against the formulas of `frames` in NumPy, and turned systems against their own matrices."""

import numpy as np
import pytest
import scipy.sparse.linalg as spla
from numpy.testing import assert_allclose
from scipy.linalg import block_diag
from scipy.spatial.transform import Rotation

from fcsim.arrays import FloatArray
from fcsim.assembly.compliance import SystemFactor
from fcsim.assembly.kinematics._frame_kernels import inverse
from fcsim.assembly.kinematics.frames import FloatingGroup, Turned
from fcsim.assembly.model import Model, build_model
from fcsim.assembly.supports import Support
from fcsim.mesh.blocks import brick, rectangle, rigid_box
from fcsim.mesh.material import Material
from fcsim.mesh.part import Body

BETA = 0.1


def model_of(d: int) -> Model:
    """Two bodies of one part, one of another, and a linear one."""
    stone = Material(1e7, 0.3, 1000.0)
    if d == 3:
        parts = brick("b", (0.4, 0.2, 0.1), (3, 2, 1), stone), brick("c", (0.3, 0.2, 0.1), (1, 2, 1), stone)
    else:
        parts = rectangle("b", (0.4, 0.1), (4, 1), stone), rectangle("c", (0.2, 0.1), (2, 1), stone)
    places = np.eye(4, d) * 3.0
    bodies = [Body(name, parts[k], translation=places[i]) for i, (name, k) in enumerate((("a", 0), ("b", 1), ("c", 0)))]
    return build_model([*bodies, Body("d", parts[0], translation=-places[0], kinematics="linear")], kinematics="turning", beta=BETA)


def rotations(d: int, count: int, seed: int) -> FloatArray:
    angles = np.random.default_rng(seed).uniform(-1.0, 1.0, (count, 3))
    angles[:, :2] *= d == 3
    return Rotation.from_rotvec(angles).as_matrix()[:, :d, :d]


def moved(model: Model, seed: int) -> FloatArray:
    """Displacements (n_dofs,): every body turned by itself, and strained by some percent."""
    rng, x = np.random.default_rng(seed), np.zeros_like(model.reference)
    for b, R in enumerate(rotations(model.dimension, len(model.deformable), seed)):
        own = slice(model.node_offset[b], model.node_offset[b + 1])
        X = model.reference[own]
        x[own] = X @ R.T - X + 1.0 + 0.002 * rng.standard_normal(X.shape)
    return x.ravel()


def cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """a x b (..., 3) of vectors (..., 2 or 3)."""

    def three(c: FloatArray) -> FloatArray:
        return c if c.shape[-1] == 3 else np.concatenate([c, np.zeros((*c.shape[:-1], 1))], axis=-1)

    return np.cross(three(a), three(b))


def frame(floating: FloatingGroup, x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """R, A, x - c, y of one body at the displacements x (nn, d): R by the polar decomposition."""
    p = floating.arm + x - floating.weight @ x
    A = np.einsum("n,ni,nj->ij", floating.weight, p, floating.arm)
    U, _, Vt = np.linalg.svd(A)
    R = U @ np.diag([*np.ones(len(A) - 1), np.linalg.det(U @ Vt)]) @ Vt
    return R, A, p, p @ R - floating.arm


def force(floating: FloatingGroup, x0: FloatArray, x1: FloatArray, share: float, v: FloatArray) -> FloatArray:
    """D^T K (share y_1 + (1 - share) y_0 + beta D v) of one body, with D as a matrix (n, n)."""
    (R0, A0, p0, y0), (R1, A1, p1, y1) = frame(floating, x0), frame(floating, x1)
    R, p = 0.5 * (R0 + R1), 0.5 * (p0 + p1)
    N, q = np.linalg.solve(R, 0.5 * (A0 + A1)), np.linalg.solve(R, p.T).T
    J = np.trace(N) * np.eye(3) - block_diag(N, np.zeros((3 - len(N), 3 - len(N))))
    D = np.empty((x0.size, x0.size))
    for k, unit in enumerate(np.eye(x0.size)):
        dx = unit.reshape(x0.shape)
        b = (dx - floating.weight @ dx) @ R
        phi = np.linalg.solve(J, (floating.weight[:, None] * cross(floating.arm, b)).sum(axis=0))
        D[:, k] = (b - cross(np.broadcast_to(phi, (len(q), 3)), q)[:, : q.shape[1]]).ravel()
    y = (share * y1 + (1 - share) * y0).ravel() + BETA * D @ v.ravel()
    return (D.T @ (floating.group.K @ y)).reshape(x0.shape)


@pytest.mark.parametrize("d", [2, 3])
def test_frames_and_forces_are_those_of_the_formulas(d: int) -> None:
    model, rng = model_of(d), np.random.default_rng(7)
    x0, x1, v = moved(model, 1), moved(model, 2), rng.standard_normal(model.n_dofs)
    first, last = model.elastic.at(x0), model.elastic.at(x1)
    found = model.elastic.force(first, last, 0.7, v)
    for group, frames in zip(model.groups, first.frames, strict=True):
        for b, dofs in enumerate(group.dofs):
            if frames is None:
                expected = group.K @ (0.7 * x1[dofs] + 0.3 * x0[dofs] + BETA * v[dofs])
            else:
                floating, shape = FloatingGroup(group), (-1, d)
                of_body = frames.rotation[b], frames.spread[b], frames.arm[b], frames.strained[b]
                for value, formula in zip(of_body, frame(floating, x0[dofs].reshape(shape)), strict=True):
                    assert_allclose(value, formula, atol=1e-14)
                expected = force(floating, *(a[dofs].reshape(shape) for a in (x0, x1)), 0.7, v[dofs].reshape(shape)).ravel()
            assert_allclose(found[dofs], expected, atol=1e-11 * abs(expected).max())


@pytest.mark.parametrize("d", [2, 3])
def test_forces_less_a_turned_stiffness(d: int) -> None:
    """w F - s T K T^T x, T as a matrix."""
    model, rng = model_of(d), np.random.default_rng(8)
    first, last = model.elastic.at(moved(model, 1)), model.elastic.at(moved(model, 2))
    Q, x, v = rotations(d, len(model.deformable), 3), rng.standard_normal(model.n_dofs), rng.standard_normal(model.n_dofs)
    Q[-1] = np.eye(d)  # of the linear body
    expected = 0.3 * model.elastic.force(first, last, 0.7, v)
    for group in model.groups:
        for b, dofs in zip(group.members, group.dofs, strict=True):
            T = np.kron(np.eye(len(dofs) // d), Q[b])
            turned = T @ (group.K @ (T.T @ x[dofs]))
            assert_allclose(model.elastic.turned_stiffness(Q, x)[dofs], turned, atol=1e-12 * abs(turned).max())
            expected[dofs] -= 0.2 * turned
    found = model.elastic.force(first, last, 0.7, v, Turned(0.3, 0.2, Q, x))
    assert_allclose(found, expected, atol=1e-12 * abs(expected).max())


@pytest.mark.parametrize("driven", ["identity", "eliminated"])
def test_turned_system_is_solved_as_its_matrix(driven: str) -> None:
    """Bodies that are free, held on an edge, and held in one direction, about whose axis alone they turn; beside them rigid ones, whose
    inertia changes the pattern of the matrix."""
    stone = Material(1e7, 0.3, 1000.0)
    part = brick("b", (0.4, 0.2, 0.1), (3, 2, 1), stone)
    bodies = [Body(name, part, translation=np.array([k, 0.0, 0.0])) for k, name in enumerate(("free", "edge", "plane"))]
    rigid = rigid_box("rigid", (0.3, 0.2, 0.1), (9.0, 0.0, 0.0), 2.0)
    supports = [Support("edge", ("x", "y", "z"), "x-"), Support("plane", ("z",), "z-")]
    model = build_model([*bodies, rigid], supports=supports, kinematics="turning", driven=driven)
    factor, n = SystemFactor(model, 1.0, 1e-4, np.arange(model.n_nodes)), model.n_dofs
    rhs = np.random.default_rng(9).standard_normal(len(model.free_dofs) if driven == "eliminated" else n)
    x = np.zeros(n)
    for seed in (1, 2, 3):
        Q = model.elastic.system_rotation(rotations(3, 3, seed))
        x[-3:] = 0.3 * (seed - 1)
        turned = factor.with_rigid_mass(model.rigid_mass(x)).turned(Q)
        A = turned.matrix()
        assert abs(A - A.T).max() < 1e-12 * abs(A).max()
        assert_allclose(turned.solve(rhs), spla.spsolve(A.tocsc(), rhs), rtol=1e-9, atol=1e-12)
        y = turned.solve(rhs)
        full = np.zeros(n)
        full[model.free_dofs] = y if driven == "eliminated" else y[model.free_dofs]
        product = turned.apply(full)[model.free_dofs]
        assert_allclose(product, rhs if driven == "eliminated" else rhs[model.free_dofs], rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("d", [2, 3])
def test_inverse_of_small_matrices(d: int) -> None:
    A, out = np.random.default_rng(4).standard_normal((d, d)) + 2 * np.eye(d), np.empty((d, d))
    inverse(A, d, out)
    assert_allclose(out @ A, np.eye(d), atol=1e-12)
    inverse(np.full((d, d), np.nan), d, out)
    assert np.isnan(out).all()
