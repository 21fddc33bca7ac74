"""The small front door answers as the general way does, and leaves to it what it does not answer."""

from __future__ import annotations

import sys
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
from numpy.testing import assert_allclose

from fcsim.bench.families import problems
from fcsim.problem import GlobalProblem, LocalProblem, check
from fcsim.problem.reduction import reduced
from fcsim.solvers import Memory, Result, Status, method, solve
from fcsim.solvers.small import door
from fcsim.solvers.small.door import small


def problem(seed: int, d: int = 3, nc: int = 7, rank: float = 1.5, unit: float = 1.0) -> LocalProblem:
    rng = np.random.default_rng(seed)
    H = rng.standard_normal((max(1, int(rank * d * nc)), d * nc)) * unit
    q = rng.standard_normal((nc, d)) - 0.5 * np.eye(d)[0]
    return LocalProblem(H.T @ H, q.ravel(), rng.uniform(0, 1.2, nc), dimension=d)


def by_the_door(
    p: LocalProblem, name: str = "NSGS-AC", r: np.ndarray | None = None, tol: float = 1e-8, error: str = "scaled"
) -> Result | None:
    found = small(p, method(name), False, name, r, tol, error, 0.0)
    return found if isinstance(found, Result) else None


def generally(p: LocalProblem, name: str = "NSGS-AC", r: np.ndarray | None = None, **keywords: Any) -> Result:
    return solve(p, name, r, memory=Memory.of(np.arange(p.nc)), **keywords)  # which the door does not know


@pytest.mark.each_value
@pytest.mark.parametrize("error", ["scaled", "published"])
@pytest.mark.parametrize("start", ["zero", "warm"])
@pytest.mark.parametrize("unit", [1e-4, 1.0, 1e4])
@pytest.mark.parametrize("d", [2, 3])
def test_the_answer_is_that_of_the_general_way(d: int, unit: float, start: str, error: str) -> None:
    statuses = set()
    for seed in range(12):
        p = problem(seed, d, nc=1 + 3 * seed, rank=0.4 + 0.2 * seed, unit=unit)
        r = None if start == "zero" else np.random.default_rng(seed).standard_normal(p.m) / unit**2
        found, expected = by_the_door(p, r=r, error=error), generally(p, r=r, error=error)
        assert found is not None
        statuses.add(found.status)
        assert (found.status, found.iterations) == (expected.status, expected.iterations)
        assert_allclose(found.r, expected.r, rtol=1e-9, atol=1e-9 * np.abs(expected.r).max())
        assert_allclose(found.u, p.W @ found.r + p.q, rtol=1e-9, atol=1e-12 * np.abs(p.q).max())
        assert_allclose([row[2] for row in found.history], [row[2] for row in expected.history], rtol=1e-3, atol=1e-12)
        assert [row[0] for row in found.history] == [row[0] for row in expected.history]
        assert_allclose(
            [found.scaled_error, found.published_error], [expected.scaled_error, expected.published_error], rtol=1e-2, atol=1e-14
        )
        told, true = found.checks, check(found.r, found.u, p.mu, d, None, p.q)
        assert_allclose([told.cone, told.dual_cone, told.penetration], [true.cone, true.dual_cone, true.penetration], atol=1e-12)
    assert Status.SOLVED in statuses


def test_auto_is_answered_where_its_first_sweeps_arrive() -> None:
    p = problem(3)
    found = by_the_door(p, "auto")
    assert found is not None and found.status is Status.SOLVED and found.iterations <= 100
    assert found.method == "auto"
    hard = LocalProblem(np.kron(np.ones((6, 6)) + 1e-7 * np.eye(6), np.eye(3)), np.tile([-1.0, 0.4, 0.0], 6), np.full(6, 0.5))
    assert by_the_door(hard, "auto", tol=1e-13) is None or by_the_door(hard, "auto", tol=1e-13).status is Status.SOLVED
    assert solve(hard, "auto").solved


def test_a_problem_at_rest_is_answered_by_zero() -> None:
    p = replace(problem(1), q=np.tile([1.0, 0.0, 0.0], 7))
    found = by_the_door(p)
    assert found is not None and found.status is Status.SOLVED and not found.r.any() and found.iterations == 0


def test_infinite_iterates_end_the_sweeps() -> None:
    p = problem(2)
    found, expected = by_the_door(replace(p, W=-p.W + 2 * np.diag(np.diag(p.W)))), None
    assert found is None or not found.solved or found.error <= 1e-8
    huge = replace(p, q=p.q * 1e200)
    found, expected = by_the_door(huge), generally(huge)
    assert found is None or found.status is expected.status


@pytest.mark.parametrize(
    "left",
    [
        lambda p: (p, {"max_iterations": 3}),
        lambda p: (p, {"shuffle": "once"}),
        lambda p: (problem(0, nc=door.CONTACTS + 1), {}),
        lambda p: (replace(p, W=np.pad(p.W[3:, 3:], ((3, 0), (3, 0)))), {}),  # a contact between held bodies
    ],
    ids=["iterations", "options", "many contacts", "a held contact"],
)
def test_what_is_left_to_the_general_way(left: Any) -> None:
    p, options = left(problem(0))
    assert small(p, method("NSGS-AC"), bool(options), "NSGS-AC", None, 1e-8, "scaled", 0.0) is None
    result = solve(p, "NSGS-AC", **options)
    assert result.status in Status


@pytest.mark.parametrize("kind", [sp.csr_array, sp.csc_array, sp.coo_array, sp.bsr_array])
def test_the_storage_of_a_small_matrix_does_not_matter(kind: Any) -> None:
    p = problem(4)
    dense, sparse = by_the_door(p), by_the_door(replace(p, W=kind(p.W)))
    assert dense is not None and sparse is not None
    assert np.array_equal(dense.r, sparse.r) and dense.iterations == sparse.iterations


@pytest.mark.parametrize("limit", [door.LEAST_LIMIT, 1e9])
def test_a_limit_of_time_that_the_door_cannot_reach_leaves_it_open(limit: float, monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*_: object, **__: object) -> None:
        raise AssertionError("the general way")

    monkeypatch.setattr(sys.modules["fcsim.solvers.solve"], "solve_by", refused)  # the package has the function under that name
    assert solve(problem(4), "NSGS-AC", time_limit=limit).solved
    with pytest.raises(AssertionError, match="the general way"):
        solve(problem(4), "NSGS-AC", time_limit=0.5 * door.LEAST_LIMIT)


def test_a_starting_point_of_another_size_is_said_by_the_general_way() -> None:
    assert by_the_door(problem(0), r=np.zeros(4)) is None
    with pytest.raises(ValueError, match="starting point"):
        solve(problem(0), "NSGS-AC", np.zeros(4))


def test_the_history_ends_with_the_time_of_the_solve() -> None:
    found = by_the_door(problem(5))
    assert found is not None
    assert found.history[-1][1] == pytest.approx(found.seconds["solve"])
    assert all(before[1] <= after[1] for before, after in zip(found.history, found.history[1:], strict=False))


Call = tuple[int, int, int, np.ndarray]


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch) -> list[Call]:
    """(how it ended, iterations, those before it, sweeps and Newton's iterations at each error with the error) of the door's calls."""
    kernel, made = door._automatic_kernels.solve_automatically, []

    def kept(*arguments: Any) -> Any:
        out = kernel(*arguments)
        made.append((out[0], out[1], arguments[-2], arguments[-1][: out[2]].copy()))
        return out

    monkeypatch.setattr(door._automatic_kernels, "solve_automatically", kept)
    return made


@pytest.mark.parametrize("size", [12, 60])
@pytest.mark.parametrize("family", ["squeezed", "wedged", "rods"])
def test_problems_without_a_solution_are_answered_with_a_proof(family: str, size: int, calls: list[Call]) -> None:
    p = reduced(problems(family, size, 3)).local
    found = by_the_door(p, "auto")
    assert found is not None and found.status is Status.INFEASIBLE and len(calls) == 1
    assert found.error > 1e-3 and found.certificate is not None and found.message == found.certificate.message
    y = found.certificate.direction
    if family != "rods":  # y . u_N = y . q_N < 0 for all reactions (Farkas)
        assert y is not None and np.all(y[::3] >= 0) and p.q @ y < 0
        assert np.linalg.norm(p.W.T @ y) < 1e-9 * np.abs(p.W).max()


def test_where_newton_leaves_a_large_error_the_door_sweeps_no_more(calls: list[Call], monkeypatch: pytest.MonkeyPatch) -> None:
    """As it would go on without a proof: Newton from zero, and nothing after. All contacts are coupled, so that they are no bed's."""
    p = reduced(problems("squeezed", 60, 3)).local
    monkeypatch.setattr(door, "certificate", lambda problem: None)
    assert by_the_door(replace(p, W=p.W + 1e-15 * np.abs(p.W).max()), "auto") is None
    (ended, before, _, sweeping), (_, after, begun, newton) = calls
    assert ended == door._automatic_kernels.NO_ANSWER_YET and begun == before < after
    assert np.all(np.diff(sweeping[:, 0])[:-1] == door.AUTO_LOOK) and sweeping[:, 1].min() > 1e-3
    assert newton[0, 0] == before and newton[-1, 0] == after and len(newton) == 2
    assert newton[0, 1] == pytest.approx(sweeping[:, 1].min(), rel=1e-6)
    assert generally(p, "auto").status is Status.INFEASIBLE  # by the race, which looks for a proof where the door has not


def test_in_a_bed_one_newton_is_all_that_the_door_tries(calls: list[Call], monkeypatch: pytest.MonkeyPatch) -> None:
    p = reduced(problems("squeezed", 100, 3)).local
    monkeypatch.setattr(door, "certificate", lambda problem: None)
    assert by_the_door(p, "auto") is None
    assert len(calls) == 1 and generally(p, "auto").status is Status.INFEASIBLE


@pytest.mark.parametrize("bed", [("spheres", 30, 12_002), ("frictions", 30, 12_005), ("noise", 60, 12_007)])
def test_beds_of_the_fewest_contacts_are_answered_at_the_door(bed: tuple[str, int, int]) -> None:
    """By a Newton that does not end after 20 iterations; in the race, whose small steps cost more, they took 3 to 11 times as long."""
    p = reduced(problems(*bed)).local
    found = by_the_door(p, "auto")
    assert p.nc <= door._automatic_kernels.FEWEST and found is not None and found.status is Status.SOLVED


def test_sweeps_whose_error_stays_are_left(calls: list[Call]) -> None:
    """Contacts of which each is alone are as good after one sweep as they get: Newton follows the second error."""
    by_the_door(reduced(problems("rods", 60, 3)).local, "auto")
    assert calls[0][3][:3, 0].tolist() == [0, door.AUTO_LOOK, 2 * door.AUTO_LOOK]
    assert calls[0][3][3, 0] - calls[0][3][2, 0] < 2 * door.AUTO_LOOK


def test_where_newton_has_failed_the_race_takes_over_in_the_bodies_velocities(calls: list[Call]) -> None:
    """104 contacts between boxes of 48 velocities, each with a twin: Newton from zero is not tried where those are known."""
    p = reduced(problems("near-singular", 200, 501)).local
    assert by_the_door(p, "auto") is None
    known = calls[-1][1]
    by_the_door(replace(p, motion=None), "auto")
    assert p.motion is not None and p.motion.M.shape[0] == 48 and known < calls[-1][1]
    assert solve(p, "auto").solved


def on_two_scales(seed: int, d: int, constrained: bool) -> GlobalProblem:
    """Bodies of masses 1e5 apart coupled at random, with a constraint between two of them: the race takes some thousand iterations."""
    rng = np.random.default_rng(seed)
    nb, k = (3 if d == 2 else 6), 15
    M = np.diag(np.repeat(np.r_[np.full(3, 400.0), np.full(3, 0.004)], nb) * rng.uniform(0.5, 2, 6 * nb))
    H = np.zeros((6 * nb, d * k))
    for a in range(k):
        for body in rng.choice(6, 2, replace=False):
            H[nb * body : nb * body + nb, d * a : d * a + d] = rng.standard_normal((nb, d))
    G, b = (np.eye(6 * nb)[:, [0]] - np.eye(6 * nb)[:, [nb]], np.zeros(1)) if constrained else (None, None)
    return GlobalProblem(M, H, M @ rng.standard_normal(6 * nb), np.zeros(d * k), rng.uniform(0, 1.5, k), G, b, dimension=d)


@pytest.mark.parametrize("constrained", [False, True])
@pytest.mark.parametrize(("seed", "d"), [(0, 2), (3, 2), (6, 2), (3, 3), (10, 3)])
def test_global_problems_of_few_contacts_pass_the_door(seed: int, d: int, constrained: bool) -> None:
    p = on_two_scales(seed, d, constrained)
    found, race = solve(p, "auto"), solve(p, "auto", memory=Memory.of(np.arange(p.nc)))
    assert found.solved and found.v is not None and found.iterations == solve(reduced(p).local, "auto").iterations
    if not constrained:
        assert race.solved and found.iterations != race.iterations  # the door's own course
    assert len(found.history) > 1 and found.history[-1][2] <= 1e-8
    # by the equations as they were given: momentum, constraint, and Coulomb's law of each contact
    l = np.zeros(p.n) if found.multiplier is None else p.G @ found.multiplier
    assert np.abs(p.M @ found.v - p.H @ found.r - l - p.f).max() <= 1e-9 * np.abs(p.f).max()
    u = (p.H.T @ found.v + p.w).reshape(-1, d)
    assert_allclose(found.u, u.ravel(), atol=1e-12 * np.abs(u).max())
    r, slides = found.r.reshape(-1, d), np.linalg.norm(u[:, 1:], axis=1)
    size = float(np.linalg.norm(reduced(p).q))
    assert u[:, 0].min() >= -1e-7 * size and np.all(
        np.linalg.norm(r[:, 1:], axis=1) <= (1 + 1e-6) * p.mu * r[:, 0] + 1e-6 * np.abs(r).max()
    )
    assert np.abs(r[:, 0] * u[:, 0]).max() <= 1e-6 * np.abs(r).max() * size
    lost = np.einsum("ai,ai->a", r[:, 1:], u[:, 1:]) + p.mu * r[:, 0] * slides  # friction against sliding, as much as it may be
    assert np.abs(lost).max() <= 1e-6 * np.abs(r).max() * size


def test_global_problems_without_contacts_or_at_rest_are_answered() -> None:
    free = GlobalProblem(np.eye(3), np.zeros((3, 0)), np.ones(3), np.zeros(0), np.zeros(0))
    parting = GlobalProblem(np.eye(3), np.eye(3), np.array([1.0, 0.0, 0.0]), np.zeros(3), np.array([0.5]))
    for p in (free, parting):
        found = solve(p, "auto")
        assert found.solved and found.iterations == 0 and found.v is not None and not found.r.any()


def test_an_answer_to_a_loose_tolerance_needs_no_proof(monkeypatch: pytest.MonkeyPatch) -> None:
    """Errors between 1e-3 and the tolerance are answers: no certificate is looked for, which takes ten times as long, and nothing outweighs
    anything."""
    tried = []
    monkeypatch.setattr(door, "certificate", lambda problem: tried.append(problem))
    for family in ("rocks", "walls", "disks"):
        result = solve(problems(family, 24, 0), "auto", tol=0.05)
        assert result.solved and result.error > 1e-3
        assert not tried and not result.message
