"""Projections on Coulomb's cone: characterised by convex analysis, compared with an independent minimiser and finite differences."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from fcsim.problem._cone_kernels import disk_projection, natural_map
from fcsim.problem.cone import de_saxce, project_cone, project_cone_derivative, tangential_norm

COMPONENT = st.floats(-1e3, 1e3, allow_subnormal=False).map(lambda x: 0.0 if abs(x) < 1e-9 else x)
FRICTION = st.one_of(st.just(0.0), st.floats(1e-3, 3.0))
project_cone(np.zeros((1, 3)), np.ones(1))
disk_projection(0.0, 0.0, 1.0)  # compiled here: hypothesis times the single examples


def points(d: int) -> st.SearchStrategy:
    return st.lists(COMPONENT, min_size=d, max_size=d).map(lambda z: np.array([z]))


@pytest.mark.parametrize("d", [2, 3])
@given(data=st.data(), mu=FRICTION)
def test_projection_is_the_nearest_point_of_the_cone(d: int, data: st.DataObject, mu: float) -> None:
    """P in K, z - P in the polar cone and P orthogonal to z - P: together they characterise the projection (Moreau)."""
    z = data.draw(points(d))
    P = project_cone(z, np.array([mu]))
    rest, size = z - P, np.abs(z).max() * (1 + mu) + 1e-300
    assert np.linalg.norm(P[0, 1:]) - mu * P[0, 0] <= 1e-13 * size
    assert P[0, 0] >= 0
    assert rest[0, 0] + mu * np.linalg.norm(rest[0, 1:]) <= 1e-13 * size
    assert abs(P[0] @ rest[0]) <= 1e-12 * size**2


@pytest.mark.parametrize("d", [2, 3])
@given(data=st.data(), mu=st.floats(1e-3, 3.0))
def test_moreau_decomposition_and_idempotence(d: int, data: st.DataObject, mu: float) -> None:
    """z = P_K(z) + P_K°(z), where -K° = K* is the cone of friction coefficient 1 / mu."""
    z = data.draw(points(d))
    P = project_cone(z, np.array([mu]))
    polar = -project_cone(-z, np.array([1 / mu]))
    assert_allclose(P + polar, z, rtol=0, atol=1e-12 * (np.abs(z).max() + 1e-300))
    assert_allclose(project_cone(P, np.array([mu])), P, rtol=0, atol=1e-12 * (np.abs(z).max() + 1e-300))


@pytest.mark.parametrize("z_N", [-1.0, 0.0, 2.0])
def test_frictionless_cone_is_a_half_line(z_N: float) -> None:
    """mu = 0: K = {r_N >= 0, r_T = 0}, also at z_T = 0 exactly."""
    z = np.array([[z_N, 0.0, 0.0], [z_N, 1.0, -1.0]])
    assert_allclose(project_cone(z, np.zeros(2)), [[max(z_N, 0), 0, 0]] * 2, atol=0)
    if z_N != 0:
        expected = np.diag([float(z_N > 0), 0, 0])
        assert_allclose(project_cone_derivative(z, np.zeros(2)), [expected] * 2, atol=0)


@pytest.mark.parametrize("d", [2, 3])
def test_projection_against_an_interior_point_method(d: int) -> None:
    """min ||x - z||^2 over the second-order cone (mu x_N, x_T), solved by Clarabel."""
    clarabel = pytest.importorskip("clarabel")
    import scipy.sparse as sp

    rng = np.random.default_rng(1)
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-12
    for mu in (0.1, 0.7, 1.8):
        for z in rng.standard_normal((6, d)):
            A = sp.csc_matrix(-np.diag([mu] + [1.0] * (d - 1)))
            cones = [clarabel.SecondOrderConeT(d)]
            solution = clarabel.DefaultSolver(sp.csc_matrix(np.eye(d)), -z, A, np.zeros(d), cones, settings).solve()
            assert_allclose(project_cone(z[None], np.array([mu]))[0], solution.x, atol=1e-6)


@pytest.mark.parametrize("d", [2, 3])
def test_derivative_of_the_projection_in_each_zone(d: int) -> None:
    rng = np.random.default_rng(2)
    z, mu = rng.standard_normal((500, d)), rng.uniform(0.1, 1.5, 500)
    norm = np.linalg.norm(z[:, 1:], axis=1)
    inside, polar = mu * z[:, 0] - norm, -z[:, 0] - mu * norm
    smooth = (np.abs(inside) > 1e-2) & (np.abs(polar) > 1e-2) & (norm > 1e-2)
    for zone in (inside > 0, polar > 0, (inside < 0) & (polar < 0)):
        assert np.count_nonzero(smooth & zone) > 30
    derivative, h = project_cone_derivative(z, mu), 1e-6
    for j in range(d):
        step = h * np.eye(d)[j]
        difference = (project_cone(z + step, mu) - project_cone(z - step, mu)) / (2 * h)
        assert_allclose(derivative[smooth, :, j], difference[smooth], atol=1e-7)


@pytest.mark.parametrize("d", [2, 3])
def test_projection_is_its_numpy_twin_and_keeps_what_is_no_number(d: int) -> None:
    """The zones one after the other: inside, polar, the boundary in between; 1e150 and 1e-150 as sizes."""
    rng = np.random.default_rng(4)
    z, mu = rng.standard_normal((400, d)), rng.uniform(0, 1.5, 400)
    z[:50] *= 1e150
    z[50:100] *= 1e-150
    mu[::10], z[::7, 1:] = 0, 0
    norm = np.sqrt(np.sum(z[:, 1:] ** 2, axis=1))
    s = (z[:, 0] + mu * norm) / (1 + mu**2)
    expected = np.column_stack([s, (mu * s / np.where(norm > 0, norm, 1))[:, None] * z[:, 1:]])
    expected = np.where((norm <= mu * z[:, 0])[:, None], z, expected)
    expected = np.where((mu * norm <= -z[:, 0])[:, None], 0, expected)
    assert_allclose(project_cone(z, mu), expected, rtol=1e-14)
    assert_allclose(project_cone(np.asfortranarray(z), mu), expected, rtol=1e-14)
    z[0, 0], z[1, 1] = np.nan, np.nan
    assert np.isnan(project_cone(z, mu)[:2]).any(axis=1).all()


def test_natural_map_is_its_definition_and_sees_a_small_velocity_beside_a_large_reaction() -> None:
    rng = np.random.default_rng(5)
    for r, f, mu in zip(rng.standard_normal((300, 3)), rng.standard_normal((300, 3)), rng.uniform(0, 1.5, 300), strict=True):
        assert_allclose(natural_map(*r, *f, mu), r - project_cone((r - f)[None], np.array([mu]))[0], atol=1e-14)
    sticking = natural_map(1e20, 0.0, 0.0, 0.0, 1e-3, 0.0, 0.5)  # r - P_K(r - f) is f inside K
    assert_allclose(sticking, (0, 1e-3, 0), rtol=1e-12)


@given(z=points(2), radius=st.floats(0, 1e3).filter(lambda x: x == 0 or x > 1e-9))
def test_disk_projection(z: np.ndarray, radius: float) -> None:
    """The projection on a disk is the point itself, or the point of the circle in the same direction."""
    P, norm = np.array([disk_projection(*z[0], radius)]), np.hypot(*z[0])
    assert np.hypot(*P[0]) <= radius * (1 + 1e-12)
    assert P[0] @ z[0] >= 0
    assert abs(np.hypot(*(z - P)[0]) - max(norm - radius, 0)) <= 1e-12 * (norm + radius)


def test_de_saxce_term_and_tangential_norm() -> None:
    u = np.array([[-1.0, 3.0, 4.0], [2.0, 0.0, 0.0]])
    assert_allclose(tangential_norm(u), [5, 0])
    assert_allclose(de_saxce(u, np.array([0.2, 0.9])), [[1, 0, 0], [0, 0, 0]])
    assert_allclose(de_saxce(u[:, :2], np.array([0.5, 0.5])), [[1.5, 0], [0, 0]])
