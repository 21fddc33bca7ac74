"""The compiled loops against NumPy: projections by their definition, the disk's minimiser by its optimality, sweeps by plain loops."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.problem.cone import de_saxce, project_cone
from fcsim.solvers.variational._set_kernels import (
    add_de_saxce,
    de_saxce_term,
    minimise_on_disk,
    splitting_residuals,
    step_cone,
    step_cylinder,
    step_disk,
    sweep_cone,
    sweep_cylinder,
)
from tests.unit.problem.disk import project_disk


def states(d: int, count: int = 500) -> tuple[np.ndarray, ...]:
    rng = np.random.default_rng(d)
    mu = rng.uniform(0, 1.2, count)
    mu[:20] = 0
    return rng.standard_normal((count, d)), rng.standard_normal((count, d)), mu


@pytest.mark.parametrize("d", [2, 3])
def test_steps_are_projections(d: int) -> None:
    r, F, mu = states(d)
    out = np.empty_like(r)
    change = step_cone(r, F, mu, 0.7, out)
    expected = project_cone(r - 0.7 * F, mu)
    assert_allclose(out, expected, atol=1e-15)
    assert_allclose(change, np.sum((expected - r) ** 2))
    change = step_cylinder(r, F, mu, 0.7, out)
    z = r - 0.7 * F
    expected = np.column_stack([np.maximum(z[:, 0], 0), project_disk(z[:, 1:], mu)])
    assert_allclose(out, expected, atol=1e-15)
    assert_allclose(change, np.sum((expected - r) ** 2))
    normal = np.empty((len(r), 1))
    change = step_cylinder(r[:, :1].copy(), F[:, :1].copy(), mu, 0.7, normal)
    assert_allclose(normal, expected[:, :1], atol=1e-15)
    assert_allclose(change, np.sum((normal - r[:, :1]) ** 2))
    tangent = np.empty((len(r), d - 1))
    change = step_disk(r[:, 1:].copy(), F[:, 1:].copy(), mu, 0.7, tangent)
    assert_allclose(tangent, expected[:, 1:], atol=1e-15)
    assert_allclose(change, np.sum((tangent - r[:, 1:]) ** 2))


@pytest.mark.parametrize("d", [2, 3])
def test_de_saxce_term(d: int) -> None:
    u, _, mu = states(d)
    out = np.empty_like(u)
    add_de_saxce(u, mu, out)
    assert_allclose(out, u + de_saxce(u, mu), atol=1e-15)
    assert_allclose(de_saxce_term(u.ravel(), mu, d), de_saxce(u, mu).ravel(), atol=1e-15)


def test_splitting_residuals() -> None:
    x, z, zeta, z_hat, zeta_hat = np.random.default_rng(2).standard_normal((5, 30))
    expected = [float(y @ y) for y in (x - z, z - z_hat, zeta - zeta_hat)]
    assert_allclose(splitting_residuals(x, z, zeta, z_hat, zeta_hat), expected)


@pytest.mark.parametrize("kind", ["definite", "nearly singular", "singular", "zero"])
def test_minimiser_on_a_disk(kind: str) -> None:
    """Optimal: x is its own projected gradient step."""
    rng = np.random.default_rng(1)
    for _ in range(200):
        B = rng.standard_normal((2, 2))
        A = B @ B.T
        if kind != "definite":
            t = rng.standard_normal(2)
            A = np.outer(t, t) + {"nearly singular": 1e-10, "singular": 0.0, "zero": 0.0}[kind] * np.eye(2)
        if kind == "zero":
            A *= 0
        g, radius = rng.standard_normal(2), rng.uniform(0, 2)
        x = np.array(minimise_on_disk(A[0, 0], A[0, 1], A[1, 1], g[0], g[1], radius))
        assert np.linalg.norm(x) <= radius * (1 + 1e-14)
        step = 1 / (1 + np.trace(A))
        assert_allclose(x, project_disk((x - step * (A @ x + g))[None], np.array([radius]))[0], atol=1e-7)


def block_row_problem(nc: int = 8) -> tuple[np.ndarray, ...]:
    rng = np.random.default_rng(7)
    B = rng.standard_normal((3 * nc, 3 * nc + 5))
    W = B @ B.T / nc
    blocks = np.ascontiguousarray(W.reshape(nc, 3, nc, 3).transpose(0, 2, 1, 3).reshape(nc * nc, 3, 3))
    indptr, indices = np.arange(nc + 1) * nc, np.tile(np.arange(nc), nc)
    return W, blocks, indptr, indices, rng.standard_normal((nc, 3)), rng.uniform(0.1, 1, nc), np.abs(rng.standard_normal((nc, 3)))


def test_cylinder_sweep_minimises_one_part_after_the_other() -> None:
    W, blocks, indptr, indices, q, radius, r = block_row_problem()
    start, expected = r.copy(), r.copy()
    for a in range(len(q)):
        own = slice(3 * a, 3 * a + 3)
        u = W[own] @ expected.ravel() + q[a]
        expected[a, 0] = max(0.0, expected[a, 0] - u[0] / W[3 * a, 3 * a])
        u = W[own] @ expected.ravel() + q[a]
        A = W[3 * a + 1 : 3 * a + 3, 3 * a + 1 : 3 * a + 3]
        g = u[1:] - A @ expected[a, 1:]
        expected[a, 1:] = minimise_on_disk(A[0, 0], A[0, 1], A[1, 1], g[0], g[1], radius[a])
    change, size = sweep_cylinder(indptr, indices, blocks, q, radius, r, True, True)
    assert_allclose(r, expected, atol=1e-13)
    assert_allclose(change, np.sum((r - start) ** 2))
    assert_allclose(size, np.sum(r**2))


@pytest.mark.parametrize("normal", [True, False])
def test_cylinder_sweep_leaves_the_other_part_alone(normal: bool) -> None:
    _, blocks, indptr, indices, q, radius, r = block_row_problem()
    start = r.copy()
    sweep_cylinder(indptr, indices, blocks, q, radius, r, normal, not normal)
    assert np.array_equal(r[:, 0], start[:, 0]) != normal
    assert np.array_equal(r[:, 1:], start[:, 1:]) == normal


def test_cone_sweep_solves_each_contact() -> None:
    W, blocks, indptr, indices, q, mu, r = block_row_problem()
    rho = np.array([1 / np.linalg.norm(W[3 * a : 3 * a + 3, 3 * a : 3 * a + 3], 2) for a in range(len(q))])
    expected = r.copy()
    for a in range(len(q)):
        for _ in range(2000):
            u = W[3 * a : 3 * a + 3] @ expected.ravel() + q[a]
            expected[a] = project_cone((expected[a] - rho[a] * u)[None], mu[a : a + 1])[0]
    sweep_cone(indptr, indices, blocks, q, mu, rho, r, 1e-15, 2000)
    assert_allclose(r, expected, atol=1e-12)
