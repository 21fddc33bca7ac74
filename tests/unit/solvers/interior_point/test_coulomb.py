"""IPM-COULOMB: its central points and directions against the law written out, finite differences, and other linear algebra."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
from numpy.testing import assert_allclose

from fcsim.bench.families import problems
from fcsim.errors import InputError
from fcsim.problem import GlobalProblem, LocalProblem
from fcsim.problem.reduction import reduce
from fcsim.solvers import Status, solve
from fcsim.solvers.base import Monitor
from fcsim.solvers.interior_point.cones import NesterovTodd
from fcsim.solvers.interior_point.coulomb import InteriorPointOptions, Linearised, interior_point_turns
from fcsim.solvers.interior_point.pairs import ContactPairs
from fcsim.solvers.interior_point.systems import InteriorSystem

MU = np.array([0.3, 0.0, 1.2, 0.05, 5.0, 0.0])


def random_problem(d: int, seed: int = 3) -> LocalProblem:
    rng = np.random.default_rng(seed)
    H = rng.standard_normal((6 * d + 4, 6 * d)) / np.sqrt(6 * d)
    return LocalProblem(H.T @ H + 0.1 * np.eye(6 * d), rng.standard_normal(6 * d) - 0.3, MU, dimension=d)


def reduced(family: str, size: int, seed: int) -> LocalProblem:
    problem = problems(family, size, seed)
    return reduce(problem).local if isinstance(problem, GlobalProblem) else problem


def by_contact(pairs: ContactPairs, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    nc = len(pairs.mu)
    return x[:nc], x[nc:].reshape(-1, pairs.cone_size)


def jordan(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """(x . y, x_0 y_1 + y_0 x_1) of each row, contact by contact."""
    return np.array([[a @ b, *(a[0] * b[1:] + b[0] * a[1:])] for a, b in zip(x, y, strict=True)])


@pytest.mark.parametrize("d", [2, 3])
def test_start_is_on_the_central_path(d: int) -> None:
    """All products are tau e, and r - u / c keeps its normal and its tangential part, for points of any kind."""
    rng = np.random.default_rng(d)
    pairs, c, rough = ContactPairs(MU, d), 10.0 ** rng.uniform(-3, 3, 6), MU > 0
    for size in (1e-6, 1.0, 1e3):
        r, u, tau = rng.standard_normal((6, d)) * size, rng.standard_normal((6, d)) * c[:, None], 10.0 ** rng.uniform(-4, 1, 6)
        x, y = pairs.centred(r, u, tau, c)
        (line, cone), (line_u, cone_u) = by_contact(pairs, x), by_contact(pairs, y)
        assert np.all(line > 0) and np.all(line_u > 0)
        assert np.all(cone[:, 0] > np.linalg.norm(cone[:, 1:], axis=1))
        assert_allclose(line * line_u, tau, rtol=1e-12)
        assert_allclose(cone[:, 0], MU[rough] * line[rough], rtol=1e-14)
        product = jordan(cone, cone_u) / tau[rough, None]
        assert_allclose(
            product, np.tile([1.0, *np.zeros(d - 1)], (4, 1)), atol=1e-4
        )  # x_0 - ||x_T|| is a difference of nearly equal numbers
        assert_allclose(line - line_u / c, r[:, 0] - u[:, 0] / c, atol=1e-12 * np.abs(r - u / c[:, None]).max())
        z_T = (r - u / c[:, None])[rough, 1:]
        assert_allclose(cone[:, 1:] - cone_u[:, 1:] / c[rough, None], z_T, atol=1e-6 * np.abs(z_T).max())


@pytest.mark.parametrize("d", [2, 3])
def test_direction_is_newtons(d: int) -> None:
    """Along (dr, dy) the scaled products change by the target and W r + q - u by its share: central differences at the point."""
    p, rng = random_problem(d), np.random.default_rng(7)
    pairs, nc = ContactPairs(MU, d), len(MU)
    r, u = rng.standard_normal((nc, d)), rng.standard_normal((nc, d))
    x, y = pairs.centred(r, u, 10.0 ** rng.uniform(-2, 0, nc), np.ones(nc))
    y = y * rng.uniform(0.9, 1.1, nc)[np.r_[np.arange(nc), np.repeat(np.flatnonzero(MU > 0), d)]]  # off the path
    R = pairs.contact_reaction(x)
    step = Linearised(pairs, InteriorSystem(p.delassus), x, y, (p.W @ R.ravel() + p.q).reshape(nc, d))
    V = NesterovTodd(pairs, y, x)
    dr, _, dy, _ = step.direction(-step.squared, 0.7)

    def at(t: float) -> tuple[np.ndarray, np.ndarray]:
        r, moved = R + t * dr, y + t * V.apply(dy)
        lines, cones = by_contact(pairs, pairs.reactions(r))
        cones = np.column_stack([MU[MU > 0] * r[MU > 0, 0], r[MU > 0, 1:]])
        scaled = V.apply(np.concatenate([lines, cones.ravel()])), V.apply(moved, inverse=True)
        (a, A), (b, B) = (by_contact(pairs, z) for z in scaled)
        u = np.column_stack([moved[:nc], np.zeros((nc, d - 1))])
        u[MU > 0, 1:] = by_contact(pairs, moved)[1][:, 1:]
        left = (p.W @ r.ravel() + p.q).reshape(nc, d) - u
        left[MU == 0, 1:] = 0  # nothing is asked of the sliding of contacts without friction
        return np.concatenate([a * b, jordan(A, B).ravel()]), left

    h = 1e-5
    (plus, left_plus), (minus, left_minus), (product, left) = at(h), at(-h), at(0.0)
    assert_allclose((plus - minus) / (2 * h), -product, atol=1e-6 * np.abs(product).max())
    assert_allclose((left_plus - left_minus) / (2 * h), -0.7 * left, atol=1e-6 * np.abs(left).max())
    assert_allclose(dr[MU == 0, 1:], 0, atol=0)
    assert np.abs(left).max() > 0.1 and np.ptp(product[:nc]) > 0.1  # or the test says little


def test_linear_algebra_does_not_change_the_direction() -> None:
    """W dense, by blocks and by bodies' velocities against NumPy's solve of A W + B, for random regular blocks B."""
    p = reduced("walls", 160, 2)
    assert p.motion is not None and p.m >= 300
    rng = np.random.default_rng(1)
    A = np.tile(np.eye(3), (p.nc, 1, 1))
    A[::5, 1:, 1:] = 0  # contacts without friction
    c = p.delassus.compliance
    B = rng.standard_normal((p.nc, 3, 3)) * c[:, None, None] + 3 * c[:, None, None] * np.eye(3)
    rhs = rng.standard_normal((p.nc, 3))
    W = p.W.toarray() if sp.issparse(p.W) else p.W
    J = (A @ W.reshape(p.nc, 3, p.m)).reshape(p.m, p.m)
    J.reshape(p.nc, 3, p.nc, 3)[np.arange(p.nc), :, np.arange(p.nc), :] += B
    expected = np.linalg.solve(J, rhs.ravel()).reshape(rhs.shape)
    by_bodies = InteriorSystem(p.delassus)
    others = [InteriorSystem(replace(p, W=stored, motion=None).delassus) for stored in (W, sp.bsr_array(sp.csr_array(W), blocksize=(3, 3)))]
    assert by_bodies.in_velocities and not any(system.in_velocities for system in others)
    for system in (by_bodies, *others):
        assert_allclose(system.factored(A, B)(rhs), expected, rtol=1e-8, atol=1e-10 * np.abs(expected).max())


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("seed", range(4))
def test_regular_problems_need_one_path_alone(seed: int, d: int) -> None:
    result = solve(random_problem(d, seed), "IPM-COULOMB", tol=1e-8, paths=1, polish=0)
    assert result.solved and result.iterations <= 20
    other = solve(random_problem(d, seed), "NSN-AC", tol=1e-12)
    assert other.solved
    assert_allclose(result.r, other.r, atol=1e-6)


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("weights", [((0.0, 0.0),), ((1.0, 0.0), (0.0, 0.5))])
def test_a_path_from_near_a_solution_is_short_where_its_velocity_is_small(d: int, weights: tuple[tuple[float, float], ...]) -> None:
    """From another method's solution moved by some 1e-5 of it, whatever the weights: to the same answer."""
    p = random_problem(d)
    answer = solve(p, "NSN-AC", tol=1e-12).r
    near = answer * (1 + 1e-5 * np.random.default_rng(0).standard_normal(p.m))
    results = [solve(p, "IPM-COULOMB", near, tol=1e-8, paths=2, polish=0, weights=weights, velocity=v) for v in (1.0, 1e-3)]
    assert all(result.solved for result in results)
    for result in results:
        assert_allclose(result.r, answer, atol=1e-6)
    assert results[1].iterations <= results[0].iterations - 3


@pytest.mark.parametrize("d", [2, 3])
def test_turns_are_iterations_and_tell_a_falling_tau(d: int) -> None:
    p, told = random_problem(d), []
    monitor = Monitor(p.q, p.mu, d, 1e-8, compliance=p.delassus.compliance)
    turns = interior_point_turns(p, np.zeros(p.m), monitor, InteriorPointOptions(paths=1, polish=0), told.append)
    for done, _ in enumerate(turns, 1):
        assert monitor.iterations == len(told) - 1 == done
    (begun, *taus) = told
    assert begun == np.inf and monitor.best <= 1e-8 and len(taus) == monitor.iterations >= 5
    assert np.all(np.diff(taus) < 0) and taus[-1] < 1e-8 * taus[0]


def test_where_a_path_turns_back_another_leads_on() -> None:
    """The first central path of this bed of rocks has a fold, at which steps end."""
    problem = reduced("rocks", 30, 2)
    alone = solve(problem, "IPM-COULOMB", paths=1, polish=0)
    assert alone.status is Status.STAGNATED and alone.error > 1e-4
    result = solve(problem, "IPM-COULOMB", polish=0)
    assert result.solved and result.iterations > alone.iterations


def test_polish_gives_what_the_root_of_tau_leaves() -> None:
    """A wall at rest on more points than it needs: some reactions and their velocities vanish together."""
    problem = reduced("walls", 30, 4)
    plain, polished = solve(problem, "IPM-COULOMB", tol=1e-10, polish=0), solve(problem, "IPM-COULOMB", tol=1e-10)
    assert not plain.solved and plain.error < 1e-5
    assert polished.solved


def test_a_turn_without_an_iteration_stands_between_paths() -> None:
    """The next path has not begun then: who shares with others may give their turn to them."""
    problem = reduced("rocks", 30, 2)
    monitor, told = Monitor(problem.q, problem.mu, 3, 1e-8), list[float]()
    done, idle = 0, []
    for _ in interior_point_turns(problem, np.zeros(problem.m), monitor, InteriorPointOptions(polish=0), told.append):
        if monitor.iterations == done:
            idle.append(len(told))
            assert told[-1] == np.inf
        done = monitor.iterations
    assert monitor.best <= 1e-8
    assert idle == [i + 1 for i, tau in enumerate(told) if tau == np.inf][1:] and len(idle) >= 1


def test_polish_does_not_begin_from_a_start_that_was_good_already() -> None:
    """A path that turns back far from a solution is not polished: from an iterate of other methods that were theirs to do."""
    problem = reduced("rocks", 60, 1)
    start = solve(problem, "PROX-NEWTON", tol=1e-5)
    assert 1e-8 < start.error <= 1e-5
    plain = solve(problem, "IPM-COULOMB", start.r, tol=1e-8, paths=1, polish=0)
    assert plain.status is Status.STAGNATED
    assert solve(problem, "IPM-COULOMB", start.r, tol=1e-8, paths=1).iterations == plain.iterations


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"fraction": 1.0}, r"fraction: expected a number in \(0, 0.99\], got 1.0"),
        ({"fraction": 0.0}, "fraction"),
        ({"paths": 0}, "paths: expected an integer >= 1, got 0"),
        ({"polish": -1}, "polish: expected an integer >= 0, got -1"),
        ({"velocity": 0.0}, "velocity: expected a number > 0, got 0.0"),
        ({"velocity": np.inf}, "velocity: expected a finite number, got inf"),
        ({"weights": ()}, r"weights: expected pairs of finite numbers, one at least, got \(\)"),
        ({"weights": (1.0, 0.0)}, "weights: expected pairs"),
        ({"weights": ((1.0, np.nan),)}, "weights: expected pairs"),
        ({"weights": ((1.0, "x"),)}, "weights: expected pairs"),
    ],
)
def test_bad_option_is_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        solve(random_problem(3), "IPM-COULOMB", **options)


@pytest.mark.parametrize("make", [lambda: np.zeros((3, 3)), lambda: np.diag([-1.0, 1.0, 1.0])])
def test_unsolvable_problems_end(make: Callable[[], np.ndarray]) -> None:
    """Pressed into what does not give way, or gives way the other way round: an honest end."""
    result = solve(LocalProblem(make(), np.array([-1.0, 0.2, 0.0]), np.array([0.3])), "IPM-COULOMB")
    assert not result.solved and result.error > 1e-3
