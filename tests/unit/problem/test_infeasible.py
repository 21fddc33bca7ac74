"""Certificates: what they prove is checked by hand, and none is given where a solution exists."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp

from fcsim.bench.families import FAMILIES, problems
from fcsim.problem import LocalProblem
from fcsim.problem.infeasible import certificate, squeezed
from fcsim.problem.reduction import reduce
from fcsim.solvers import Status, solve

SOLVABLE = [name for name, family in FAMILIES.items() if family.solvable]


def local(name: str, size: int, seed: int) -> LocalProblem:
    problem = problems(name, size, seed)
    return problem if isinstance(problem, LocalProblem) else reduce(problem).local


@pytest.mark.parametrize("share", [1e-2, 1e-4, 1e-6])
def test_bodies_approach_a_little_where_no_reaction_moves_them(share: float) -> None:
    """The first contact's row of W is zero, its u_N = q_N < 0 whatever the reactions: seen at once, however slow it is."""
    W = np.array([[0.0, 0.0, 0.0, 0.0], [0.0, 3.0, 0.0, 1.0], [0.0, 0.0, 2.0, 0.0], [0.0, 1.0, 0.0, 3.0]])
    q = np.array([-share, -0.24, -1.0, 0.3])
    result = solve(LocalProblem(W, q, np.array([0.5, 0.5]), dimension=2), "auto")
    assert result.status is Status.INFEASIBLE and result.iterations < 1000
    assert result.certificate is not None and result.certificate.direction is not None
    assert np.array_equal(result.certificate.direction, [1.0, 0.0, 0.0, 0.0]) and np.array_equal(result.certificate.contacts, [0])
    q[0] = 1e-9 * q[0]  # below the tolerance: r_N = 0 answers
    assert solve(LocalProblem(W, q, np.array([0.5, 0.5]), dimension=2), "auto").solved
    q[0] = -1e-15  # round-off of the others' velocities is no proof
    assert squeezed(LocalProblem(W, q, np.array([0.5, 0.5]), dimension=2)) is None


@pytest.mark.parametrize("name", ["squeezed", "wedged"])
@pytest.mark.parametrize("size", [1, 7, 60])
@pytest.mark.parametrize("mass", [1e-9, 1.0, 1e9])
def test_a_self_stress_that_works_against_what_is_prescribed(name: str, size: int, mass: float) -> None:
    """d = N y >= 0, W^T d = 0 and q . d < 0, in any unit of mass: u_N . y < 0 whatever the reactions."""
    p = local(name, size, 0)
    p = LocalProblem(p.W / mass, p.q, p.mu)
    result = solve(p, "auto")
    assert result.status is Status.INFEASIBLE and not result.solved
    assert result.certificate is not None and result.certificate.direction is not None
    d = result.certificate.direction
    assert np.all(d.reshape(-1, 3)[:, 1:] == 0) and np.all(d >= 0) and d.sum() == pytest.approx(1)
    assert p.q @ d < 0
    r = np.abs(np.random.default_rng(0).standard_normal((p.nc, 3))) * mass
    change = (p.W @ r.ravel()) @ d
    assert abs(change) <= 1e-8 * np.abs(p.W @ r.ravel()).max()
    assert result.message.startswith("no solution")


@pytest.mark.parametrize("d", [2, 3])
def test_where_nothing_moves_what_is_driven_together_stays_so(d: int) -> None:
    """W = 0: u = q whatever the reactions."""
    q = np.zeros((3, d))
    q[:, 0] = 1.0, -0.5, -2.0
    for W in (np.zeros((3 * d, 3 * d)), sp.csr_array((3 * d, 3 * d))):
        result = solve(LocalProblem(W, q.ravel(), np.full(3, 0.3), dimension=d), "auto")
        assert result.status is Status.INFEASIBLE
        assert result.certificate is not None and result.certificate.contacts.tolist() == [2]
        assert solve(LocalProblem(W, np.abs(q).ravel(), np.full(3, 0.3), dimension=d), "auto").solved


@pytest.mark.parametrize("size", [7, 60])
def test_velocities_say_the_same_as_contacts(size: int) -> None:
    """With H and M known the programme has the rows of H N instead of W^T N: each finds a self-stress of the same worth."""
    p = local("wedged", size, 1)
    assert p.delassus.motion is not None
    found = [squeezed(each) for each in (p, LocalProblem(p.W, p.q, p.mu))]
    worth = [-float(p.q @ each.direction) for each in found if each is not None and each.direction is not None]
    assert len(worth) == 2 and worth[0] == pytest.approx(worth[1], rel=1e-6)
    assert all(np.abs(p.W.T @ each.direction).max() <= 1e-8 * np.abs(p.W).max() for each in found if each is not None)


@pytest.mark.parametrize("seed", range(3))
def test_rods_of_painleve_have_no_case(seed: int) -> None:
    result = solve(problems("rods", 4, seed), "auto")
    assert result.status is Status.INFEASIBLE
    assert result.certificate is not None and result.certificate.direction is None


def test_a_rod_that_is_less_rough_slides() -> None:
    """Below the critical friction mu = a / b the same rod has a solution, and no certificate."""
    p = local("rods", 1, 0)
    W = p.W.toarray() if sp.issparse(p.W) else p.W
    critical = W[0, 0] / W[0, 1]  # W = (a, b) (a, b)^T / I
    gentle = LocalProblem(p.W, p.q, np.array([0.5 * critical]), dimension=2)
    assert certificate(gentle) is None
    assert solve(gentle, "auto").solved


@pytest.mark.parametrize("name", SOLVABLE)
def test_no_certificate_where_there_is_a_solution(name: str) -> None:
    """Between bodies that are at rest or move freely there always is: v = 0 of all bodies keeps them apart."""
    assert certificate(local(name, 40, 1)) is None


def test_a_ball_between_walls_that_stand_still_is_not_squeezed() -> None:
    p = local("squeezed", 3, 0)
    assert squeezed(LocalProblem(p.W, np.zeros(p.m), p.mu)) is None
    assert squeezed(p) is not None
    assert squeezed(LocalProblem(p.W, np.abs(p.q), p.mu)) is None  # walls that part


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("ratio", [1e4, 1e7, 1e10, 1e12])
def test_heavy_bodies_are_not_held_ones(d: int, ratio: float) -> None:
    """W positive definite, one contact of a body that is `ratio` times as heavy: there is a solution, of reactions as large as that."""
    rng = np.random.default_rng(int(np.log10(ratio)))
    scale = np.sqrt(np.repeat([1.0, 1.0, 1 / ratio], d))
    L = np.eye(3 * d) + 0.1 * rng.standard_normal((3 * d, 3 * d))
    q = np.tile(np.r_[-1.0, np.full(d - 1, 0.2)], 3)
    p = LocalProblem(np.outer(scale, scale) * (L @ L.T), q, np.full(3, 0.5), dimension=d)
    assert certificate(p) is None
    assert solve(p, "auto").solved
    alone = LocalProblem(np.diag([1 / ratio, *np.ones(d - 1)]), q[:d], np.full(1, 0.5), dimension=d)
    assert certificate(alone) is None and solve(alone, "auto").solved


@pytest.mark.parametrize("soft", [1e-4, 1e-6, 1e-7, 1e-10])
def test_a_stiff_vice_is_no_rigid_one(soft: float) -> None:
    """Two jaws that give way by `soft` times as much as the piece between them: r_N = 1 / soft each, by W r + q = 0."""
    W = np.eye(4)
    W[0, 2] = W[2, 0] = soft - 1
    p = LocalProblem(W, np.array([-1.0, 0, -1, 0]), np.full(2, 0.3), dimension=2)
    r = np.array([1 / soft, 0, 1 / soft, 0])
    assert np.abs(p.W @ r + p.q).max() <= max(1e-8, 1e-15 / soft)
    assert certificate(p) is None


def test_a_vice_beside_a_heavy_body_is_still_found() -> None:
    """The proof is about the vice, whatever body of 1e9 times the mass lies beside it."""
    W = np.zeros((9, 9))
    W[:6, :6] = np.kron([[1.0, -1.0], [-1.0, 1.0]], np.diag([1.0, 0, 0])) + np.diag([0, 1.0, 1, 0, 1, 1])
    W[6:, 6:] = 1e-9 * np.eye(3)
    found = certificate(LocalProblem(W, np.tile([-1.0, 0, 0], 3), np.full(3, 0.3)))
    assert found is not None and found.contacts.tolist() == [0, 1]
