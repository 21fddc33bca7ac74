"""The cone of rolling and spinning friction: its projection by properties and by minimisation, and the natural map."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import minimize_scalar

from fcsim.problem.cone import project_cone
from fcsim.problem.rolling import modified_velocity, natural_residual, project_rolling_cone

RNG = np.random.default_rng(5)
COUNT = 400
Z = RNG.standard_normal((COUNT, 5)) * 10.0 ** RNG.uniform(-3, 3, (COUNT, 1))
MU, MU_R = (np.where(RNG.random(COUNT) < 0.2, 0.0, RNG.uniform(0, 2, COUNT)) for _ in range(2))


def test_projection_is_the_nearest_point() -> None:
    """The distance is convex in the normal part alone."""
    P = project_rolling_cone(Z, MU, MU_R)
    for z, mu, mu_r, p in zip(Z, MU, MU_R, P, strict=True):
        t, m, size = np.hypot(*z[1:3]), np.hypot(*z[3:]), np.linalg.norm(z)

        def squared(n: float, z=z, t=t, m=m, mu=mu, mu_r=mu_r) -> float:
            return float((n - z[0]) ** 2 + max(t - mu * n, 0) ** 2 + max(m - mu_r * n, 0) ** 2)

        best = minimize_scalar(squared, bounds=(0, 3 * size), method="bounded", options={"xatol": 1e-12 * size})
        assert np.sum((p - z) ** 2) <= min(best.fun, squared(0.0)) + 1e-12 * size**2


def test_moreau_decomposition() -> None:
    """P in K, P - z in K*, orthogonal: what makes P the projection on a closed convex cone."""
    P = project_rolling_cone(Z, MU, MU_R)
    size = np.linalg.norm(Z, axis=1)
    assert np.all(np.hypot(P[:, 1], P[:, 2]) <= MU * P[:, 0] + 1e-14 * size)
    assert np.all(np.hypot(P[:, 3], P[:, 4]) <= MU_R * P[:, 0] + 1e-14 * size)
    y = P - Z
    assert np.all(y[:, 0] - MU * np.hypot(y[:, 1], y[:, 2]) - MU_R * np.hypot(y[:, 3], y[:, 4]) >= -1e-13 * size)
    assert_allclose(np.einsum("ai,ai->a", P, y) / size**2, 0, atol=1e-14)
    assert_allclose(project_rolling_cone(P, MU, MU_R), P, atol=1e-14 * size.max())


def test_without_moments_it_is_coulombs_cone() -> None:
    z = np.c_[Z[:, :3], np.zeros((COUNT, 2))]
    assert_allclose(project_rolling_cone(z, MU, MU_R)[:, :3], project_cone(z[:, :3], MU), atol=1e-12)


SIX = RNG.standard_normal((COUNT, 6)) * 10.0 ** RNG.uniform(-3, 3, (COUNT, 1))
MU_S = np.where(RNG.random(COUNT) < 0.2, 0.0, RNG.uniform(0, 2, COUNT))


def test_with_spinning_it_is_the_projection_on_a_closed_convex_cone() -> None:
    """Moreau: P in K, P - z in K*, orthogonal; z as random as on the cone's own face, edge and apex."""
    for z in (SIX, np.c_[np.abs(SIX[:, 0]), SIX[:, 1:]], np.c_[-np.abs(SIX[:, 0]), SIX[:, 1:]]):
        P = project_rolling_cone(z, MU, MU_R, MU_S)
        size = np.linalg.norm(z, axis=1)
        assert np.all(np.hypot(P[:, 1], P[:, 2]) <= MU * P[:, 0] + 1e-14 * size)
        assert np.all(np.hypot(P[:, 3], P[:, 4]) <= MU_R * P[:, 0] + 1e-14 * size)
        assert np.all(np.abs(P[:, 5]) <= MU_S * P[:, 0] + 1e-14 * size)
        y = P - z
        dual = y[:, 0] - MU * np.hypot(y[:, 1], y[:, 2]) - MU_R * np.hypot(y[:, 3], y[:, 4]) - MU_S * np.abs(y[:, 5])
        assert np.all(dual >= -1e-13 * size)
        assert_allclose(np.einsum("ai,ai->a", P, y) / size**2, 0, atol=1e-14)


def test_without_a_spinning_moment_it_is_the_cone_of_rolling_friction() -> None:
    z = np.c_[Z, np.zeros(COUNT)]
    assert_allclose(project_rolling_cone(z, MU, MU_R, MU_S)[:, :5], project_rolling_cone(Z, MU, MU_R), atol=1e-12)
    # a disk of one dimension is one of two whose second component is nothing
    z = np.c_[SIX[:, :3], np.zeros((COUNT, 2)), SIX[:, 5]]
    found = project_rolling_cone(z, MU, np.zeros(COUNT), MU_S)
    as_rolling = project_rolling_cone(np.c_[SIX[:, :3], SIX[:, 5], np.zeros(COUNT)], MU, MU_S)
    assert_allclose(found[:, [0, 1, 2, 5]], as_rolling[:, :4], atol=1e-12)


def test_the_law_of_spinning_is_the_zero_of_the_natural_map() -> None:
    one = np.ones(1)
    mu, mu_r, mu_s = 0.5 * one, 0.2 * one, 0.1 * one
    for r, u in (
        ([1, 0.2, 0.1, 0.05, 0.1, -0.1], [0, 0, 0, 0, 0, 4]),  # spins
        ([1, -0.5, 0, 0.2, 0, 0.1], [0, 3, 0, -1, 0, -7]),  # slides, rolls and spins
        ([1, 0.1, 0, 0.1, 0, 0.05], [0, 0, 0, 0, 0, 0]),  # rests
        ([0, 0, 0, 0, 0, 0], [0.1, 5, 0, 0, 1, 5]),  # open
    ):
        r, u = np.array(r, dtype=float), np.array(u, dtype=float)
        assert natural_residual(r, u, mu, mu_r, one, mu_s) <= 1e-15
        assert abs(float(r @ modified_velocity(u[None], mu, mu_r, mu_s)[0])) <= 1e-15
    assert natural_residual(np.array([1, 0, 0, 0, 0, 0.1]), np.array([0, 0, 0, 0, 0, 2.0]), mu, mu_r, one, mu_s) > 0.1  # with the spin


@pytest.mark.filterwarnings("ignore:invalid value")
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_what_is_not_finite_is_not_hidden(value: float) -> None:
    r = np.ones(5)
    r[1] = value
    assert not natural_residual(r, np.ones(5), np.ones(1), np.ones(1), np.ones(1)) < 1e300


def test_the_law_is_the_zero_of_the_natural_map() -> None:
    """Rest, sliding without rolling, rolling without sliding, both, and separation."""
    one = np.ones(1)
    mu, mu_r = 0.5 * one, 0.2 * one
    cases = {
        "rest": ([1, 0.2, 0.1, 0.05, 0.1], [0, 0, 0, 0, 0]),
        "slides": ([1, -0.5, 0, 0.05, 0.1], [0, 3, 0, 0, 0]),
        "rolls": ([1, 0.2, 0.1, 0, -0.2], [0, 0, 0, 0, 7]),
        "both": ([2, 0, 1, 0.4, 0], [0, 0, -2, -3, 0]),
        "open": ([0, 0, 0, 0, 0], [1, 5, 5, 5, 5]),
    }
    for name, (r, u) in cases.items():
        r, u = np.array(r, dtype=float), np.array(u, dtype=float)
        assert natural_residual(r, u, mu, mu_r, one) <= 1e-15, name
        F = modified_velocity(u[None], mu, mu_r)
        assert abs(float(r @ F[0])) <= 1e-15, name
    assert natural_residual(np.array([1, 0.5, 0, 0, 0]), np.array([0, 3.0, 0, 0, 0]), mu, mu_r, one) > 0.5  # pushes along the sliding


@pytest.mark.parametrize("rough", [(1e8, 0.05, 0.0), (0.5, 1e8, 0.0), (0.5, 0.05, 1e9)])
def test_penetration_counts_whatever_the_friction(rough: tuple[float, float, float]) -> None:
    """u_N = -1 without a reaction, moving in every way: the natural map alone is 1 / sqrt(1 + mu^2 + mu_r^2 + mu_s^2)."""
    coefficients = [np.array([value]) for value in rough]
    u = np.array([-1.0, 1.0, 0.0, 1.0, 0.0, 1.0])
    residual = natural_residual(np.zeros(6), u, *coefficients[:2], np.ones(1), coefficients[2])
    assert residual == pytest.approx(1 / np.sqrt(101), rel=1e-6)
    gentle = natural_residual(np.zeros(6), u, np.array([3.0]), np.array([4.0]), np.ones(1), np.array([5.0]))
    assert gentle == pytest.approx(1 / np.sqrt(1 + 9 + 16 + 25), rel=1e-12)
