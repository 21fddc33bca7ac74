"""The two forms of the problem, its error and the unit-true checks."""

from __future__ import annotations

import pickle
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
from numpy.testing import assert_allclose

from fcsim.errors import InputError
from fcsim.linear.over_ranks.implicit_matrix import LateMatrix
from fcsim.problem import OPEN, SLIP, STICK, GlobalProblem, LocalProblem, check, contact_status, error, natural_map_residual
from fcsim.problem.cone import de_saxce, project_cone

MU = np.array([0.5, 0.3, 0.4])
# an open, a sticking and a sliding contact: r_T = -mu r_N u_T / ||u_T|| by hand
U = np.array([2.0, 0.3, -0.4, 0.0, 0.0, 0.0, 0.0, 3.0, 4.0])
R = np.array([0.0, 0.0, 0.0, 10.0, 1.0, -2.0, 5.0, -1.2, -1.6])


def local_problem(**changes: Any) -> LocalProblem:
    """A problem that (R, U) solves: W = 2, q = U - 2 R."""
    return LocalProblem(**{"W": 2 * np.eye(9), "q": U - 2 * R, "mu": MU} | changes)


def global_arguments(**changes: Any) -> dict[str, Any]:
    return {"M": np.eye(4), "H": np.ones((4, 6)), "f": np.ones(4), "w": np.zeros(6), "mu": np.full(2, 0.3)} | changes


def local_arguments(**changes: Any) -> dict[str, Any]:
    return {"W": np.eye(6), "q": np.zeros(6), "mu": np.full(2, 0.3)} | changes


def test_error_and_checks_vanish_on_an_exact_solution() -> None:
    assert error(local_problem(), R) <= 1e-16
    assert natural_map_residual(R, U, MU) <= 4e-15
    checks = check(R, U, MU)
    for value in (checks.cone, checks.dual_cone, checks.complementarity, checks.penetration):
        assert 0 <= value <= 1e-16
    assert checks.momentum is None


def test_error_is_relative_to_q() -> None:
    """r = 0, u = q = (-3, 0, 0): r - P_K(r - u) = (-3, 0, 0) on one contact of three; the others are open."""
    q = np.array([-3.0, 0, 0, 4.0, 0, 0, 0, 0, 0])
    problem = local_problem(q=q)
    assert_allclose(error(problem, np.zeros(9)), 3 / 5)
    assert_allclose(error(problem, np.zeros(9), floor=30.0), 3 / 30)
    assert_allclose(error(problem, np.zeros(9), floor=1.0), 3 / 5)
    assert_allclose(error(problem, np.zeros(9), u=np.array([-1.0, 0, 0, 4.0, 0, 0, 0, 0, 0])), 1 / 5)


def test_error_counts_the_de_saxce_term() -> None:
    """r in the interior of K with u = (0, 1, 0): z = r - (mu, 1, 0) stays in K, so the residual is ||(mu, 1, 0)||."""
    problem = LocalProblem(np.zeros((3, 3)), np.array([0.0, 1.0, 0.0]), np.array([0.5]))
    assert_allclose(error(problem, np.array([100.0, 0, 0])), np.hypot(0.5, 1))


def test_error_of_a_problem_at_rest() -> None:
    problem = local_problem(q=np.zeros(9))
    assert error(problem, np.zeros(9)) == 0
    assert error(problem, np.ones(9)) == float("inf")
    assert_allclose(error(problem, np.array([1e-3, 0, 0] + [0.0] * 6), floor=1.0), 1e-3)


@pytest.mark.parametrize(
    ("entry", "value", "violated"),
    [
        ("r1", 0.2, "cone"),  # a tangential reaction at the open contact
        ("r0", -0.2, "cone"),  # traction
        ("u3", -0.1, "penetration"),
        ("u3", -0.1, "dual_cone"),
        ("r0", 0.5, "complementarity"),  # a reaction at a distance
        ("u4", 0.5, "complementarity"),  # sliding inside the cone
        ("r7", 1.2, "complementarity"),  # friction that pushes
    ],
)
def test_each_violation_is_seen(entry: str, value: float, violated: str) -> None:
    r, u = R.copy(), U.copy()
    (r if entry[0] == "r" else u)[int(entry[1:])] = value
    assert getattr(check(r, u, MU), violated) > 1e-3
    assert natural_map_residual(r, u, MU) > 1e-2


def test_checks_are_free_of_units() -> None:
    """Relative numbers do not change when impulses and velocities change units; penetration has the unit of u."""
    r, u = R + np.linspace(-0.3, 0.3, 9), U + np.linspace(0.2, -0.2, 9)
    one, other = check(r, u, MU), check(1e3 * r, 1e-2 * u, MU)
    assert_allclose([one.cone, one.dual_cone, one.complementarity], [other.cone, other.dual_cone, other.complementarity])
    assert_allclose(other.penetration, 1e-2 * one.penetration)
    assert_allclose(one.penetration, -u[6])  # 0.2 (1 - 6 / 4) by hand
    assert_allclose(u[6], -0.1)


def test_checks_of_contacts_that_all_stick() -> None:
    """u is round-off, its direction noise: seen from q it is nothing."""
    u, q, r = 1e-17 * np.ones(9), 0.1 * np.ones(9), np.tile([1.0, 0, 0], 3)
    u[0] = -1e-17
    assert check(r, u, MU).dual_cone == 1
    checks = check(r, u, MU, q=q)
    assert 0 < checks.dual_cone < 1e-15 and 0 < checks.complementarity < 1e-15


def test_contact_status() -> None:
    assert contact_status(R, MU).tolist() == [OPEN, STICK, SLIP]
    assert contact_status(R[[0, 1, 3, 4, 6, 7]], np.array([0.5, 0.3, 0.24]), 2).tolist() == [OPEN, STICK, SLIP]
    assert contact_status(np.zeros(6), MU[:2]).tolist() == [OPEN, OPEN]
    assert contact_status(np.zeros(0), np.zeros(0)).tolist() == []


def test_diagonal_blocks_dense_and_sparse() -> None:
    W = np.arange(81.0).reshape(9, 9)
    expected = np.array([W[:3, :3], W[3:6, 3:6], W[6:, 6:]])
    assert_allclose(local_problem(W=W).diagonal_blocks, expected)
    assert_allclose(local_problem(W=sp.csr_array(W)).diagonal_blocks, expected)
    assert_allclose(local_problem(W=sp.bsr_array(W, blocksize=(3, 3))).diagonal_blocks, expected)
    W = W[:6, :6]
    assert_allclose(LocalProblem(W, np.zeros(6), MU, dimension=2).diagonal_blocks, [W[:2, :2], W[2:4, 2:4], W[4:, 4:]])


def test_sizes() -> None:
    problem = GlobalProblem(**global_arguments())
    assert (problem.n, problem.m, problem.nc) == (4, 6, 2)
    assert (local_problem().m, local_problem().nc) == (9, 3)


@pytest.mark.parametrize("kind", [sp.csr_matrix, sp.lil_array, sp.dok_array, sp.dia_array, sp.coo_array])
def test_any_sparse_matrix_is_taken(kind: Any) -> None:
    W = kind(2 * np.eye(9))
    problem = local_problem(W=W, V=kind(np.ones((9, 1))), R=kind(np.eye(1)), s=[0.0])
    assert isinstance(problem.W, sp.sparray)
    assert_allclose(problem.W @ R, 2 * R)
    assert error(problem, R) <= 1e-16


@pytest.mark.parametrize(
    ("form", "changes", "message"),
    [
        ("G", {"M": np.eye(3)}, r"M: expected shape \(4, 4\), got \(3, 3\)"),
        ("G", {"H": np.ones((6, 4))}, r"H: expected shape \(4, 6\), got \(6, 4\)"),
        ("G", {"mu": np.ones(3)}, "mu: expected 2 friction coefficients"),
        ("G", {"mu": np.array([0.3, -0.1])}, "mu: expected friction coefficients >= 0, got -0.1 at contact 1"),
        ("G", {"mu": np.array([0.3, np.nan])}, "mu: expected finite"),
        ("G", {"f": np.array([1, 2, np.nan, 4])}, "f: expected finite numbers"),
        ("G", {"w": np.ones((6, 1))}, r"w: expected a vector, got shape \(6, 1\)"),
        ("G", {"M": sp.csr_array(np.diag([1, np.inf, 1, 1]))}, "M: expected finite"),
        ("G", {"G": np.ones((4, 1))}, "G and b"),
        ("G", {"G": np.ones((4, 1)), "b": np.ones(2)}, r"G: expected shape \(4, 2\)"),
        ("G", {"dimension": 4}, "dimension: expected 2 or 3, got 4"),
        ("L", {"W": np.eye(5)}, r"W: expected shape \(6, 6\)"),
        ("L", {"q": np.full(6, np.inf)}, "q: expected finite"),
        ("L", {"W": np.full((6, 6), np.nan)}, "W: expected finite"),
        ("L", {"mu": np.array([-1.0, 1.0])}, "mu: expected friction coefficients >= 0"),
        ("L", {"dimension": 2}, "mu: expected 3 friction coefficients"),
        ("L", {"V": np.ones((6, 1))}, "V, R and s"),
        ("L", {"V": np.ones((6, 1)), "s": np.ones(1)}, "V, R and s"),
        ("L", {"V": np.ones((6, 1)), "R": np.ones((2, 2)), "s": np.ones(1)}, r"R: expected shape \(1, 1\)"),
    ],
)
def test_bad_input_is_refused(form: str, changes: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        GlobalProblem(**global_arguments(**changes)) if form == "G" else LocalProblem(**local_arguments(**changes))


def test_small_velocities_count_beside_huge_reactions() -> None:
    """u_N = -1 under r_N = 1e23: r - (u + g(u)) is r in floating point, yet nothing is solved; nor at the edge of the cone."""
    mu = np.array([0.3])
    assert_allclose(natural_map_residual(np.array([1e23, 0, 0]), np.array([-1.0, 0, 0]), mu), 1)
    assert natural_map_residual(np.array([1e23, 3e22, 0]), np.array([-1.0, 0, 0]), mu) >= 0.9
    assert_allclose(natural_map_residual(np.array([1e23, 0, 0]), np.array([-1.0, 0, 0]), np.zeros(1)), 1)
    assert_allclose(natural_map_residual(np.array([1e8, 0, 0]), np.array([1e-9, 0, 2e-9]), mu), np.hypot(1e-9 + 0.3 * 2e-9, 2e-9))


@pytest.mark.parametrize("d", [2, 3])
def test_residual_against_the_projection(d: int) -> None:
    """||r - P_K(r - (u + g(u)))|| with the projection of `fcsim.problem.cone`, in every zone and with mu = 0."""
    rng = np.random.default_rng(d)
    r, u, mu = rng.standard_normal((500, d)), rng.standard_normal((500, d)), rng.uniform(0, 1.2, 500) * (rng.random(500) < 0.8)
    r[::7] = 0
    for one in range(500):
        own = slice(one, one + 1)
        expected = r[own] - project_cone(r[own] - u[own] - de_saxce(u[own], mu[own]), mu[own])
        assert_allclose(natural_map_residual(r[one], u[one], mu[own], d), np.linalg.norm(expected), rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("d", [2, 3])
def test_checks_are_their_definitions(d: int) -> None:
    rng = np.random.default_rng(d)
    r, u, q, mu = rng.standard_normal((40, d)), rng.standard_normal((40, d)), 3 * rng.standard_normal((40, d)), rng.uniform(0, 1, 40)
    sliding = np.linalg.norm(u[:, 1:], axis=1)
    modified = u.copy()
    modified[:, 0] += mu * sliding
    checks = check(r.ravel(), u.ravel(), mu, d, q=q.ravel())
    assert_allclose(checks.cone, np.max(np.linalg.norm(r[:, 1:], axis=1) - mu * r[:, 0]) / np.abs(r).max())
    assert_allclose(checks.dual_cone, np.max(mu * sliding - modified[:, 0]) / max(np.abs(u).max(), np.abs(q).max()))
    assert_allclose(checks.complementarity, abs(np.sum(r * modified)) / np.linalg.norm(r) / np.linalg.norm(q))
    assert_allclose(checks.penetration, -u[:, 0].min())


@pytest.mark.parametrize("given", [("V",), ("R",), ("s",), ("V", "R"), ("V", "s"), ("R", "s")])
def test_equality_constraints_are_given_all_or_none(given: tuple[str, ...]) -> None:
    whole = {"V": np.ones((3, 1)), "R": -np.eye(1), "s": np.zeros(1)}
    with pytest.raises(InputError):
        LocalProblem(np.eye(3), np.zeros(3), np.array([0.3]), **{name: whole[name] for name in given})


@pytest.mark.parametrize("wrong", ["text", [["a", "b"]], None, object(), {"a": 1}])
def test_what_is_no_matrix_or_vector(wrong: object) -> None:
    for name in ("W", "q", "mu"):
        arguments: dict[str, object] = {"W": np.eye(3), "q": np.zeros(3), "mu": np.array([0.3])} | {name: wrong}
        with pytest.raises(InputError):
            LocalProblem(**arguments)  # type: ignore[arg-type]


def test_problems_do_not_change() -> None:
    problem = LocalProblem(np.eye(3), np.zeros(3), np.array([0.3]))
    with pytest.raises(AttributeError):
        problem.q = np.ones(3)  # type: ignore[misc]


def test_the_answer_is_that_of_the_equation() -> None:
    """u = W r + q, which is U for R by construction."""
    assert_allclose(local_problem().answer(R).u, U, atol=1e-14)


@pytest.mark.parametrize("given", [{"G": np.ones((4, 1))}, {"b": np.zeros(1)}])
def test_constraints_of_global_problems_are_given_both_or_not(given: dict[str, Any]) -> None:
    with pytest.raises(InputError, match="G and b: expected both or none"):
        GlobalProblem(**global_arguments(**given))


def test_what_is_stored_as_it_is_eliminated_stays() -> None:
    dense, sparse = local_problem(), local_problem(W=sp.csr_array(2 * np.eye(9)))
    assert dense.stored() is dense
    again = sparse.stored()
    assert again is not sparse and again.stored() is again
    assert_allclose(again.answer(R).u, U, atol=1e-14)


def test_matrix_that_is_made_when_it_is_read() -> None:
    """Its products serve until then; the same M for copies, other loads and other processes; made once."""
    made: list[int] = []
    entries = sp.csr_array(np.diag(np.arange(1.0, 5.0)))

    def whole() -> sp.csr_array:
        made.append(1)
        return entries

    late = LateMatrix(4, lambda v: entries @ v, whole)
    problem = GlobalProblem(**global_arguments(M=late))
    other = problem.with_load(np.zeros(4))
    assert_allclose(problem.momentum(np.ones(4)), [1, 2, 3, 4])
    assert not made
    assert pickle.loads(pickle.dumps(problem)).M.toarray().tolist() == entries.toarray().tolist()
    assert problem.M is entries and other.M is entries and problem.entries is entries and replace(problem, f=np.zeros(4)).M is entries
    assert made == [1]
    assert "csr" in repr(problem)
    with pytest.raises(AttributeError, match="'GlobalProblem' object has no attribute 'K'"):
        problem.K  # type: ignore[attr-defined]  # noqa: B018
    with pytest.raises(InputError, match=r"M: expected shape \(4, 4\), got \(3, 3\)"):
        GlobalProblem(**global_arguments(M=LateMatrix(3, lambda v: v, whole)))


@pytest.mark.parametrize("storage", [sp.csr_array, sp.csc_array])
def test_long_indices_become_short_ones(storage: type) -> None:
    """Loops were compiled anew for them. Entries of one place twice and out of order stay as they are in the matrix that was given."""
    indices, indptr = np.array([2, 0, 0, 1, 2], dtype=np.int64), np.array([0, 3, 4, 5], dtype=np.int64)
    data = np.array([1.0, 2.0, 1.0, 4.0, 5.0])
    long = storage((data.copy(), indices.copy(), indptr.copy()), shape=(3, 3))
    W, eye, q = long @ long.T, sp.eye_array(3, format="csc"), np.array([-1.0, 0.3, 0.0])
    assert long.indices.dtype == W.indices.dtype == np.int64
    forms = GlobalProblem(eye, long, np.zeros(3), q, [0.5]), LocalProblem(W, q, [0.5])
    for found, expected in zip((forms[0].H, forms[1].W), (long, W), strict=True):
        assert found.indices.dtype == found.indptr.dtype == np.int32
        assert np.array_equal(found.toarray(), expected.toarray())
    forms[0].H.sum_duplicates()
    assert np.array_equal(long.indices, indices) and np.array_equal(long.data, data)
