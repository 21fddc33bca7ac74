"""The nonsmooth equations: derivatives against finite differences in each zone, and F = 0 exactly where Coulomb's law holds."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.solvers.newton.formulations import FORMULATIONS
from tests.unit.problem.disk import project_disk

NAMES = sorted(FORMULATIONS)


def random_states(d: int, seed: int, count: int = 2000) -> tuple[np.ndarray, ...]:
    rng = np.random.default_rng(seed)
    u, r = rng.standard_normal((count, d)), rng.standard_normal((count, d)) + np.r_[1.0, np.zeros(d - 1)]
    rho = np.repeat(rng.uniform(0.3, 3, (count, 2)), [1, d - 1], axis=1)
    return u, r, rng.uniform(0.2, 1.2, count), rho


def distances_to_kinks(name: str, u: np.ndarray, r: np.ndarray, mu: np.ndarray, rho: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two signed numbers a contact (normal: closed > 0; tangential: stick > 0), zero where F has a kink."""
    if name == "FB":  # smooth where x∘x + y∘y is inside the cone: its smallest spectral value
        x, y = r.copy(), rho[:, :1] * u
        x[:, 1:] /= mu[:, None]
        y[:, 0] += rho[:, 0] * mu * np.linalg.norm(u[:, 1:], axis=1)
        y[:, 1:] *= mu[:, None]
        w_T = 2 * np.linalg.norm(x[:, :1] * x[:, 1:] + y[:, :1] * y[:, 1:], axis=1)
        return (x**2).sum(axis=1) + (y**2).sum(axis=1) - w_T, np.ones(len(u))
    if name == "NM":
        z = r - rho[:, :1] * u
        z[:, 0] -= rho[:, 0] * mu * np.linalg.norm(u[:, 1:], axis=1)
        norm = np.linalg.norm(z[:, 1:], axis=1)
        return z[:, 0] + mu * norm, mu * z[:, 0] - norm
    y = r - rho * u
    radius = mu * (np.maximum(y[:, 0], 0) if name == "AC" else np.maximum(r[:, 0], 0))
    return y[:, 0], radius - np.linalg.norm(y[:, 1:], axis=1)


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("name", NAMES)
def test_derivatives_in_each_zone(name: str, d: int) -> None:
    u, r, mu, rho = random_states(d, 10 * d)
    F = FORMULATIONS[name]
    normal, tangential = distances_to_kinks(name, u, r, mu, rho)
    smooth = (np.abs(normal) > 1e-2) & (np.abs(tangential) > 1e-2) & (np.linalg.norm(u[:, 1:], axis=1) > 1e-2)
    if name == "JM":
        smooth &= np.abs(r[:, 0]) > 1e-2
    assert np.count_nonzero(smooth) > 500
    for zone in () if name == "FB" else (normal < 0, (normal > 0) & (tangential > 0), (normal > 0) & (tangential < 0)):
        assert np.count_nonzero(smooth & zone) > 50
    _, A, B = F(u, r, mu, rho)
    h = 1e-6
    for j in range(d):
        step = h * np.eye(d)[j]
        by_u = (F(u + step, r, mu, rho)[0] - F(u - step, r, mu, rho)[0]) / (2 * h)
        by_r = (F(u, r + step, mu, rho)[0] - F(u, r - step, mu, rho)[0]) / (2 * h)
        assert_allclose(A[smooth, :, j], by_u[smooth], atol=1e-7)
        assert_allclose(B[smooth, :, j], by_r[smooth], atol=1e-7)


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("name", NAMES)
def test_derivatives_without_tangential_trial(name: str, d: int) -> None:
    """r_T = u_T = 0 is a smooth point of an open contact, and of any contact with mu = 0."""
    u, r = np.zeros((2, d)), np.zeros((2, d))
    u[0, 0], u[1, 0], r[1, 0], r[0, 0] = 1.0, -0.5, 0.5, -0.1
    mu, rho = np.array([0.5, 0.0]), np.full((2, d), 0.7)
    F, h = FORMULATIONS[name], 1e-6
    _, A, B = F(u, r, mu, rho)
    for j in range(d):
        step = h * np.eye(d)[j]
        assert_allclose(A[:, :, j], (F(u + step, r, mu, rho)[0] - F(u - step, r, mu, rho)[0]) / (2 * h), atol=1e-7)
        assert_allclose(B[:, :, j], (F(u, r + step, mu, rho)[0] - F(u, r - step, mu, rho)[0]) / (2 * h), atol=1e-7)


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("name", ["AC", "JM"])
def test_values_are_the_definition(name: str, d: int) -> None:
    u, r, mu, rho = random_states(d, d)
    mu[:100], u[100:200], r[200:300] = 0, 0, 0
    y = r - rho * u
    radius = mu * np.maximum(y[:, 0] if name == "AC" else r[:, 0], 0)
    expected = r - np.column_stack([np.maximum(y[:, 0], 0), project_disk(y[:, 1:], radius)])
    assert_allclose(FORMULATIONS[name](u, r, mu, rho)[0], expected, atol=1e-15)


def exact_pairs(d: int, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(u, r, mu) of 60 open, 60 sticking and 60 sliding contacts, then 20 grazing ones (u_N = r = 0)."""
    rng = np.random.default_rng(seed)
    u, r, mu = np.zeros((200, d)), np.zeros((200, d)), rng.uniform(0.1, 1.2, 200)
    direction = rng.standard_normal((200, d - 1))
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    u[:60] = rng.standard_normal((60, d))
    u[:60, 0] = rng.uniform(0.1, 2, 60)
    r[60:180, 0] = rng.uniform(0.1, 2, 120)
    r[60:120, 1:] = (rng.uniform(0, 0.95, 60) * mu[60:120] * r[60:120, 0])[:, None] * direction[60:120]
    r[120:180, 1:] = -(mu[120:180] * r[120:180, 0])[:, None] * direction[120:180]
    u[120:180, 1:] = rng.uniform(0.1, 2, 60)[:, None] * direction[120:180]
    u[180:, 1:] = rng.standard_normal((20, d - 1))
    return u, r, mu


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("name", NAMES)
def test_zero_on_coulombs_law(name: str, d: int) -> None:
    u, r, mu = exact_pairs(d, 3)
    rho = np.repeat(np.random.default_rng(4).uniform(0.1, 10, (200, 2)), [1, d - 1], axis=1)
    F, _, _ = FORMULATIONS[name](u, r, mu, rho)
    assert_allclose(F, 0, atol=1e-13)


VIOLATIONS = {
    "penetration": ([-1, 0, 0], [0, 0, 0]),
    "traction": ([0, 0, 0], [-1, 0, 0]),
    "reaction at a distance": ([1, 0, 0], [1, 0, 0]),
    "tangential reaction of an open contact": ([1, 0, 0], [0, 0.3, 0]),
    "outside the cone": ([0, 0, 0], [1, 0.8, 0]),
    "sliding inside the cone": ([0, 1, 0], [1, -0.2, 0]),
    "friction that pushes": ([0, 1, 0], [1, 0.5, 0]),
    "friction across the sliding": ([0, 1, 0], [1, 0, 0.5]),
    "jump while sliding": ([0.5, 1, 0], [1, -0.5, 0]),
}


@pytest.mark.parametrize("violation", VIOLATIONS)
@pytest.mark.parametrize("name", NAMES)
def test_not_zero_where_the_law_is_broken(name: str, violation: str) -> None:
    u, r = (np.array([x], dtype=float) for x in VIOLATIONS[violation])
    for rho in (0.1, 1.0, 10.0):
        F, _, _ = FORMULATIONS[name](u, r, np.array([0.5]), np.full((1, 3), rho))
        assert np.linalg.norm(F) > 1e-2


@pytest.mark.parametrize("name", NAMES)
def test_open_and_sticking_contacts_have_the_rows_that_newton_relies_on(name: str) -> None:
    """Open: A = 0, B = 1, so that dr = -r. Sticking (AC, JM): A = rho, B = 0, so that u vanishes."""
    u, r, mu = exact_pairs(3, 5)
    rho = np.full((200, 3), 0.1)
    _, A, B = FORMULATIONS[name](u, r, mu, rho)
    round_off = 1e-7 if name == "FB" else 0  # the others' zeros are exact: they say which rows leave the system
    assert_allclose(A[:60], 0, atol=round_off)
    assert_allclose(B[:60], np.broadcast_to(np.eye(3), (60, 3, 3)), atol=round_off)
    assert_allclose(B[60:120], 0, atol=round_off)
    if name == "FB":
        scale = 0.1 * np.array([np.diag([1, m**2, m**2]) for m in mu[60:120]])
        assert_allclose(A[60:120], scale, atol=round_off)
    elif name != "NM":
        assert_allclose(A[60:120], np.broadcast_to(0.1 * np.eye(3), (60, 3, 3)), atol=0)


@pytest.mark.parametrize("d", [2, 3])
def test_fischer_burmeister_is_semismooth_on_the_boundary_of_the_cone(d: int) -> None:
    """F(z + h) - F(z) - F'(z + h) h = O(||h||^2) also where both arguments are on one ray of the cone, or zero (kinks of F)."""
    rng = np.random.default_rng(8)
    count, mu = 300, rng.uniform(0.2, 1.2, 300)
    n = rng.standard_normal((count, d - 1))
    n /= np.linalg.norm(n, axis=1)[:, None]
    r_N, u_T = rng.uniform(0.5, 2, count), rng.uniform(0.5, 2, count)
    r_N[:60] = 0  # x = 0 and y on the boundary (grazing contact)
    r = np.column_stack([r_N, (mu * r_N)[:, None] * n])
    u = np.column_stack([np.zeros(count), u_T[:, None] * n])  # u + g(u) = (mu ||u_T||, u_T), y = rho mu (||u_T||, u_T): x's ray
    rho = np.full((count, d), 0.7)
    FB = FORMULATIONS["FB"]
    F0, A0, B0 = FB(u, r, mu, rho)
    assert np.all(np.isfinite(A0)) and np.abs(A0).max() < 10 and np.abs(B0).max() < 10
    for h in (1e-3, 1e-4, 1e-5):
        du, dr = h * rng.standard_normal((2, count, d))
        F, A, B = FB(u + du, r + dr, mu, rho)
        rest = F - F0 - np.einsum("aij,aj->ai", A, du) - np.einsum("aij,aj->ai", B, dr)
        assert np.abs(rest).max() < 300 * h**2
