"""Statuses that contacts keep from one linearisation to the next: the equations beyond where they hold, and how much may be left out."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from fcsim.solvers.base import Monitor
from fcsim.solvers.newton.formulations import alart_curnier
from fcsim.solvers.newton.iterations import _Progress
from fcsim.solvers.newton.options import NewtonOptions
from fcsim.solvers.newton.statuses import OPEN, SLIDING, STICKING, Statuses, equations
from fcsim.solvers.newton.systems._condensed_kernels import roles


def contacts(nc: int, d: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """u, r, mu, rho of contacts of all statuses."""
    rng = np.random.default_rng(0)
    r, u = rng.standard_normal((nc, d)), rng.standard_normal((nc, d))
    return u, r, rng.uniform(0.2, 1.0, nc), rng.uniform(0.5, 2.0, (nc, 1)) * np.ones((nc, d))


def statuses_of(A: np.ndarray, B: np.ndarray) -> np.ndarray:
    closed, sticking = roles(A, B)
    status: np.ndarray = closed + sticking.astype(int)
    return status


@pytest.mark.parametrize("d", [2, 3])
def test_on_its_own_piece_a_contact_has_the_equations_of_alart_and_curnier(d: int) -> None:
    given = contacts(200, d)
    F, A, B = alart_curnier(*given)
    status = statuses_of(A, B)
    assert set(status) == {OPEN, SLIDING, STICKING}
    for own, other in zip(equations(*given, status), (F, A, B), strict=True):
        assert_allclose(own, other, atol=1e-14)


@pytest.mark.parametrize("status", [OPEN, SLIDING, STICKING])
def test_beyond_it_they_are_smooth(status: int) -> None:
    """A and B by central differences, just across the border to another piece; there F differs by less than the distance from it."""
    rng = np.random.default_rng(1)
    nc, size, near = 50, 1e-6, 1e-3
    angle = rng.uniform(0, 2 * np.pi, nc)
    mu, rho = rng.uniform(0.2, 1.0, nc), np.ones((nc, 3))
    y = np.ones((nc, 3))
    length = mu * (1 + near)  # slides for who stuck
    y[:, 1:] = length[:, None] * np.stack([np.cos(angle), np.sin(angle)], -1)
    if status == OPEN:
        y[:, 0], y[:, 1:] = near, 0.0
    u = rng.standard_normal((nc, 3))
    r = y + u
    F, A, B = equations(u, r, mu, rho, np.full(nc, status))
    for which, derivative in ((0, A), (1, B)):
        for j in range(3):
            step = np.zeros((2, nc, 3))
            step[which, :, j] = size
            ahead, behind = (equations(u + s * step[0], r + s * step[1], mu, rho, np.full(nc, status))[0] for s in (1, -1))
            assert_allclose(derivative[:, :, j], (ahead - behind) / (2 * size), atol=1e-8)
    natural, natural_A, natural_B = alart_curnier(u, r, mu, rho)
    if status != SLIDING:
        assert np.all(statuses_of(natural_A, natural_B) != status)
    assert np.all(np.linalg.norm(F - natural, axis=1) <= 2 * near)


def test_what_is_kept_stays_below_the_limit_and_all_else_is_as_it_is() -> None:
    """The smallest changes are kept, as many as the limit holds together."""
    u, r, mu, rho = contacts(300, 3)
    first = alart_curnier(u, r, mu, rho)
    before = statuses_of(first[1], first[2])
    rng = np.random.default_rng(2)
    r = r + 0.3 * rng.standard_normal(r.shape)
    weight = rng.uniform(0.5, 2.0, len(r))
    natural = alart_curnier(u, r, mu, rho)
    changed = np.flatnonzero(statuses_of(natural[1], natural[2]) != before)
    assert len(changed) > 10
    missed = weight[changed] * np.linalg.norm(
        equations(u[changed], r[changed], mu[changed], rho[changed], before[changed])[0] - natural[0][changed], axis=1
    )
    limit = np.sqrt(np.sum(np.sort(missed)[:5] ** 2)) * (1 + 1e-9)
    statuses = Statuses()
    assert statuses.kept(first, u, r, mu, rho, weight, limit) is first  # nothing is known from before
    copies = tuple(x.copy() for x in natural)
    F, A, B = statuses.kept(copies, u, r, mu, rho, weight, limit)  # type: ignore[arg-type]
    other = np.flatnonzero(np.any(natural[0] != F, axis=1) | np.any(natural[1] != A, axis=(1, 2)))
    assert_array_equal(np.sort(other), np.sort(changed[np.argsort(missed)[:5]]))
    assert np.linalg.norm(weight[:, None] * (F - natural[0])) <= limit
    assert_array_equal(B[np.setdiff1d(np.arange(len(r)), other)], natural[2][np.setdiff1d(np.arange(len(r)), other)])


def test_iterations_without_progress_are_counted_until_the_error_falls_well_below_its_least() -> None:
    """They bound what kept statuses may leave, and for how long joints are solved one by one."""
    monitor = Monitor(np.ones(3), np.ones(1), 3, 1e-12)
    progress = _Progress(monitor, NewtonOptions())

    class Nowhere:
        exact = True

        def __init__(self, error: float) -> None:
            self.u = np.array([-error, 0.0, 0.0])  # r = 0 and u_N < 0: the error grows with it

    counts = []
    for error in (1.0, 0.9, 0.8, 0.71, 2.0, 0.69, 0.6, 0.4):
        assert progress.verdict(np.zeros(3), Nowhere(error)) is None  # type: ignore[arg-type]
        counts.append(progress.stalled)
    assert counts == [0, 1, 2, 3, 4, 0, 1, 0]
