"""Compiled Newton on few contacts: its linear algebra beside LAPACK's, its steps beside the same method in NumPy."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.bench.families import FAMILIES, problems
from fcsim.linear.block_factors._dense_kernels import affine, solve_dense
from fcsim.problem import LocalProblem, scaled_error
from fcsim.problem import error as published_error
from fcsim.problem.reduction import reduced
from fcsim.solvers import Memory, Result, Status, method, solve
from fcsim.solvers.newton.formulations import alart_curnier
from fcsim.solvers.newton.systems.direct import DenseSystem
from fcsim.solvers.small import door
from fcsim.solvers.small._automatic_kernels import MANY, newton_price
from fcsim.solvers.small._newton_kernels import newton_step, proximal_newton


def local(family: str, size: int, seed: int) -> LocalProblem:
    given = reduced(problems(family, size, seed)).local
    W = given.W if isinstance(given.W, np.ndarray) else given.W.toarray()
    return LocalProblem(np.ascontiguousarray(W), given.q, given.mu, dimension=given.dimension)


@pytest.mark.parametrize("n", [0, 1, 2, 3, 4, 5, 8, 11, 30, 67])
def test_dense_elimination_is_lapacks(n: int) -> None:
    rng = np.random.default_rng(n)
    for A in (rng.standard_normal((n, n)), np.fliplr(np.triu(rng.uniform(1, 2, (n, n))))):  # the second needs every row exchanged
        b = rng.standard_normal(n)
        x = b.copy()
        assert solve_dense(A.copy(), x)
        assert_allclose(A @ x, b, atol=1e-9 * (1 + np.linalg.cond(A) if n else 1))
    shift, q = rng.standard_normal(n), rng.standard_normal(n)
    assert_allclose(affine(A, b, shift, q), (A + np.diag(shift)) @ b + q, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize(("velocities", "left"), [(48, True), (90, False)])
def test_contacts_that_hold_three_times_the_bodies_velocities_are_left_to_the_race(velocities: int, left: bool) -> None:
    """60 contacts in 3D that bear hold 180 unknowns."""
    assert newton_price(np.tile([1.0, 0, 0], 60), 3, velocities, MANY)[1] == left


@pytest.mark.parametrize("n", [1, 4, 6, 9])
def test_a_singular_matrix_is_told(n: int) -> None:
    assert not solve_dense(np.zeros((n, n)), np.ones(n))
    rank_one = np.outer(np.arange(1.0, n + 1), np.ones(n))
    assert n == 1 or not solve_dense(rank_one, np.ones(n))
    assert not solve_dense(np.full((n, n), np.nan), np.ones(n))


@pytest.mark.parametrize("d", [2, 3])
def test_a_step_is_that_of_the_general_way(d: int) -> None:
    rng, nc = np.random.default_rng(d), 9
    H = rng.standard_normal((d * nc, d * nc))
    p = LocalProblem(H @ H.T, rng.standard_normal(d * nc), rng.uniform(0, 1, nc), dimension=d)
    shift, r = rng.uniform(0.1, 1, nc), rng.standard_normal((nc, d))
    F, A, B = alart_curnier((p.W @ r.ravel() + p.q).reshape(nc, d), r, p.mu, np.full((nc, d), 0.3))
    assert not A.any(axis=(1, 2)).all() and A.any()  # open and closed contacts
    expected, _ = DenseSystem(p.delassus.shifted(shift)).solve(A, B, -F)
    assert_allclose(newton_step(p.W, shift, A, B, F), expected, rtol=1e-8, atol=1e-10)


@pytest.mark.each_value
@pytest.mark.parametrize("published", [False, True])
@pytest.mark.parametrize("family", ["rocks", "arches", "towers", "frictions", "walls-2D"])
def test_proximal_newton_is_that_of_the_table(family: str, published: bool) -> None:
    """The same iterations and reactions up to round-off, which an unlucky contact may tell apart on the way: most of them the same."""
    alike = 0
    for seed in range(4):
        p = local(family, 24, seed)
        weights = np.ones(p.nc) if published else p.compliance
        r, found, iterations = proximal_newton(
            p.W, p.q, p.mu, p.compliance, weights, float(np.linalg.norm(p.q)), 1e-8, np.zeros(p.m), p.dimension, 500, 500, 0
        )
        expected = solve(p, "PROX-NEWTON", error="published" if published else "scaled")
        if not expected.solved:  # one of rocks': both wander about
            continue
        assert found <= 1e-8
        assert (published_error if published else scaled_error)(p, r) == pytest.approx(found, rel=1e-2, abs=1e-12)
        alike += iterations == expected.iterations
        if iterations == expected.iterations:
            assert found == pytest.approx(expected.error, rel=0.05, abs=1e-11)
    assert alike >= 3


@pytest.mark.parametrize("family", [name for name, family in FAMILIES.items() if family.solvable is not False])
def test_small_problems_that_sweeps_do_not_solve_are_answered_at_the_door(family: str) -> None:
    for seed in range(2):
        p = local(family, 30, seed)
        found = door.small(p, method("auto"), False, "auto", None, 1e-8, "scaled", 0.0)
        assert found is not None and found.status is Status.SOLVED
        assert scaled_error(p, found.r) <= 1.001e-8
        assert found.checks.cone <= 1e-13  # Newton's reactions are brought back to it
        assert found.history[-1][0] == found.iterations and found.history[-1][2] <= 1.01e-8


@pytest.mark.parametrize("unit", [2.0**-30, 2.0**30])
def test_newton_at_the_door_is_the_same_in_any_unit(unit: float) -> None:
    p = local("towers", 24, 0)
    reference = solve(p, "auto")
    result = solve(LocalProblem(p.W / unit, p.q, p.mu), "auto")
    assert result.solved and reference.iterations > door.AUTO_LOOK
    assert result.iterations == reference.iterations and np.array_equal(result.r, unit * reference.r)


def test_what_newton_does_not_solve_is_left_to_the_race(monkeypatch: pytest.MonkeyPatch) -> None:
    """Bodies squeezed between walls: no reactions keep them apart, which the race proves where the door does not."""
    p = local("squeezed", 12, 0)
    monkeypatch.setattr(door, "certificate", lambda problem: None)
    assert isinstance(door.small(p, method("auto"), False, "auto", None, 1e-8, "scaled", 0.0), door.Left)
    assert solve(p, "auto", memory=Memory.of(np.arange(p.nc))).status is Status.INFEASIBLE  # a race after the door looks for none again


def test_the_general_way_finds_a_solution_too() -> None:
    p = local("arches", 24, 1)
    by_the_door, generally = solve(p, "auto", tol=1e-10), solve(p, "auto", tol=1e-10, memory=Memory.of(np.arange(p.nc)))
    assert by_the_door.solved and generally.solved
    assert_allclose(by_the_door.u, generally.u, atol=1e-7 * np.abs(p.q).max())


@pytest.mark.parametrize("scale", [1e200, 1e-200])
def test_velocities_beyond_what_squares_hold(scale: float) -> None:
    p = local("rocks", 20, 0)
    result = solve(LocalProblem(p.W, scale * p.q, p.mu), "auto")
    assert result.status in Status and (not result.solved or result.error <= 1e-8)


def test_newton_is_given_up_where_it_does_not_get_on() -> None:
    """After so many iterations, and more for each power of ten: the best of what it has reached by then is handed back."""
    p = local("towers", 40, 0)
    arguments = p.W, p.q, p.mu, p.compliance, p.compliance, float(np.linalg.norm(p.q)), 1e-8, np.zeros(p.m), 3, 500
    r, reached, iterations = proximal_newton(*arguments, 1, 0)
    assert 1 <= iterations <= 15 and reached > 1e-8  # one inner problem
    assert scaled_error(p, r) == pytest.approx(reached, rel=1e-2)
    _, better, more = proximal_newton(*arguments, 5, 100)
    assert more > iterations and better < reached
    assert proximal_newton(*arguments, 500, 0)[1] <= 1e-8


def test_where_the_bodies_have_few_velocities_newton_is_left_to_the_race() -> None:
    """A pile that sweeps solve is answered; a tower of 20 boxes on which they creep is left to Newton in their 120 velocities."""
    easy, hard = local("boxes", 160, 0), local("towers", 80, 0)
    bodies = reduced(problems("towers", 80, 0)).local
    assert bodies.motion is not None and bodies.motion.M.shape[0] == 120 and hard.nc <= door.CONTACTS
    assert isinstance(door.small(bodies, method("auto"), False, "auto", None, 1e-8, "scaled", 0.0), door.Left)
    assert solve(bodies, "auto").solved
    for p in easy, hard:
        found = door.small(p, method("auto"), False, "auto", None, 1e-8, "scaled", 0.0)
        assert isinstance(found, Result) and found.solved


@pytest.mark.parametrize("form", ["local", "global"])
@pytest.mark.parametrize("error", ["scaled", "published"])
def test_the_race_goes_on_from_what_the_door_has_found(form: str, error: str) -> None:
    given = problems("towers", 80, 0)
    bodies = reduced(given).local
    left = door.small(bodies, method("auto"), False, "auto", None, 1e-8, error, 0.0)
    result = solve(given if form == "global" else bodies, "auto", error=error)
    assert isinstance(left, door.Left) and left.iterations > 0 and result.solved and result.iterations > left.iterations
    measure = scaled_error if error == "scaled" else published_error
    iterations, _, found = result.history[0]
    assert iterations == left.iterations and found == pytest.approx(measure(bodies, left.r)) and found < measure(bodies, 0 * left.r)


def test_sweeps_and_newton_begin_from_a_given_start() -> None:
    p = local("walls", 60, 1)
    cold = solve(p, "auto")
    warm = solve(p, "auto", cold.r * (1 + 1e-9))
    assert cold.solved and warm.solved and warm.iterations < cold.iterations / 3
