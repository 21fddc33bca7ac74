"""Equality constraints, global (G, b) and mixed local (V, R, s), against the same problem with the constraints eliminated by hand."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.linalg as sla
import scipy.sparse as sp
from numpy.testing import assert_allclose

from fcsim.command_line import main as cli
from fcsim.errors import InputError
from fcsim.export_fclib import read_fclib, write_fclib
from fcsim.linear.factors import SingularMatrix
from fcsim.problem import GlobalProblem, LocalProblem
from fcsim.problem.reduction import Elimination, reduce
from fcsim.solvers import Status, solve

WAYS: list[tuple[str, dict[str, Any]]] = [
    ("NSN-AC", {}),
    ("NSN-AC", {"linear": "kkt"}),
    ("NSN-JM", {"linear": "kkt"}),
    ("NSN-NM", {"linear": "kkt"}),
    ("NSN-FB", {"linear": "kkt"}),
    ("NSN-AC-GP", {"linear": "kkt"}),
    ("NSGS-AC", {}),
    ("PATH", {}),
]
NAMES = [", ".join([name, *map(str, options.values())]) for name, options in WAYS]


def tied_bodies(d: int, redundant: bool = False) -> tuple[Any, GlobalProblem, np.ndarray, np.ndarray]:
    """Two bodies of 8 dofs with contacts; dofs 1 and 9 move together and dof 4 moves at 0.3.

    Returned with the same problem in the dofs y that are left, v = T y + v_0: T^T M T y = T^T H r + T^T (f - M v_0).
    """
    rng = np.random.default_rng(d)
    X = rng.standard_normal((2, 8, 8))
    M = sla.block_diag(*(x @ x.T + 8 * np.eye(8) for x in X))
    nc = 12 // d
    H = rng.standard_normal((16, d * nc))
    f = -H.reshape(16, nc, d)[:, :, 0].sum(axis=1) + rng.standard_normal(16)
    w, mu = 0.1 * rng.standard_normal(d * nc), rng.uniform(0.2, 0.6, nc)
    G = np.zeros((16, 2))
    G[[1, 9], 0], G[4, 1] = (1, -1), 2
    b = np.array([0.0, -0.6])
    T = np.delete(np.eye(16), [4, 9], axis=1)
    T[9, 1] = 1  # v_9 = v_1
    v0 = np.zeros(16)
    v0[4] = 0.3
    if redundant:
        G, b = np.column_stack([G, G[:, 0] + G[:, 1]]), np.append(b, b.sum())
    free = GlobalProblem(T.T @ M @ T, T.T @ H, T.T @ (f - M @ v0), w + H.T @ v0, mu, dimension=d)
    return GlobalProblem(sp.csc_array(M), sp.csc_array(H), f, w, mu, sp.csc_array(G), b, d), free, T, v0


def mixed(p: Any, storage: str = "dense") -> Any:
    """M^-1 eliminated, the constraints not: W, V, R = H^T M^-1 H, H^T M^-1 G, G^T M^-1 G, by dense algebra."""
    M, H, G = p.M.toarray(), p.H.toarray(), p.G.toarray()
    inverse = np.linalg.inv(M)
    W, V, R = H.T @ inverse @ H, H.T @ inverse @ G, G.T @ inverse @ G
    d = p.dimension
    kind: Any = np.asarray if storage == "dense" else sp.csr_array
    W = W if storage == "dense" else sp.bsr_array(W, blocksize=(d, d))
    return LocalProblem(W, p.w + H.T @ inverse @ p.f, p.mu, kind(V), kind(R), G.T @ inverse @ p.f + p.b, d)


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize(("name", "options"), WAYS, ids=NAMES)
def test_global_constraints(name: str, options: dict[str, Any], d: int) -> None:
    p, free, T, v0 = tied_bodies(d)
    expected = solve(free, "NSN-AC", tol=1e-12)
    result = solve(p, name, tol=1e-11, **options)
    assert expected.solved and result.solved
    assert expected.v is not None and result.v is not None and result.multiplier is not None
    assert_allclose(result.r, expected.r, atol=1e-8)
    assert_allclose(result.v, T @ expected.v + v0, atol=1e-8)
    assert_allclose(result.v[[1, 4]], [result.v[9], 0.3], atol=1e-12)
    assert_allclose(p.M @ result.v, p.H @ result.r + p.G @ result.multiplier + p.f, atol=1e-9)


@pytest.mark.parametrize("storage", ["dense", "sparse"])
@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize(("name", "options"), WAYS, ids=NAMES)
def test_mixed_local_constraints(name: str, options: dict[str, Any], d: int, storage: str) -> None:
    p, free, _, _ = tied_bodies(d)
    expected, whole = solve(free, "NSN-AC", tol=1e-12), solve(p, "NSN-AC", tol=1e-12)
    local = mixed(p, storage)
    result = solve(local, name, tol=1e-11, **options)
    assert result.solved and result.multiplier is not None
    assert_allclose(result.r, expected.r, atol=1e-8)
    assert_allclose(result.u, expected.u, atol=1e-8)
    assert whole.multiplier is not None
    assert_allclose(result.multiplier, whole.multiplier, atol=1e-7)
    assert_allclose(result.u, local.W @ result.r + local.V @ result.multiplier + local.q, atol=1e-10)
    assert_allclose(local.V.T @ result.r + local.R @ result.multiplier + local.s, 0, atol=1e-10)


def test_kkt_takes_the_steps_of_the_eliminated_problem() -> None:
    for storage in ("dense", "sparse"):
        local = mixed(tied_bodies(3)[0], storage)
        eliminated, kkt = (solve(local, "NSN-AC", tol=1e-10, linear=linear) for linear in ("auto", "kkt"))
        assert_allclose([row[2] for row in kkt.history], [row[2] for row in eliminated.history], rtol=1e-6, atol=1e-12)


@pytest.mark.parametrize("storage", ["dense", "sparse"])
def test_elimination(storage: str) -> None:
    """W, q and the blocks of the form without l against dense algebra; a sparse W stays sparse."""
    p = mixed(tied_bodies(3)[0], storage)
    if storage == "sparse":  # constraints that meet two contacts only
        p = replace(
            p, V=sp.csr_array(sp.diags_array(np.repeat([1.0, 0, 1, 0], 3)) @ p.V), W=sp.bsr_array(sp.eye_array(12), blocksize=(3, 3))
        )
    V, R, W = (x.toarray() if sp.issparse(x) else x for x in (p.V, p.R, p.W))
    e = Elimination(p)
    W = W - V @ np.linalg.solve(R, V.T)
    assert sp.issparse(e.local.W) == (storage == "sparse")
    assert_allclose(e.local.W.toarray() if sp.issparse(e.local.W) else e.local.W, W, atol=1e-12)
    assert_allclose(e.q, p.q - V @ np.linalg.solve(R, p.s), atol=1e-12)
    assert_allclose(e.diagonal_blocks, e.local.diagonal_blocks, atol=1e-12)
    r = np.random.default_rng(1).standard_normal(12)
    assert_allclose(e.velocity(r), W @ r + e.q, atol=1e-12)
    if storage == "sparse":
        assert e.local.W.nnz == 9 * 6  # four diagonal blocks, and the two contacts' coupling


def test_redundant_constraints() -> None:
    """The third constraint is the sum of the others: R is singular, l not unique, the motion is."""
    p, free, _, _ = tied_bodies(3, redundant=True)
    local = mixed(p)
    assert np.linalg.matrix_rank(local.R) == 2
    expected = solve(free, "NSN-AC", tol=1e-12)
    result = solve(local, "NSN-AC", tol=1e-10)
    assert result.solved and result.multiplier is not None
    assert_allclose(result.r, expected.r, atol=1e-8)
    assert_allclose(local.V.T @ result.r + local.R @ result.multiplier + local.s, 0, atol=1e-9)
    with pytest.raises(SingularMatrix, match="singular"):
        reduce(p)
    contradictory = replace(local, s=local.s + np.array([0, 0, 1.0]))
    with pytest.raises(SingularMatrix, match="R of 3 equality constraints is singular"):
        solve(contradictory, "NSN-AC")


@pytest.mark.parametrize(("columns", "rank"), [((0, 0), 1), ((0, 1, 2), 2), ((0, 3), 1)])
def test_dependent_constraints_of_a_global_problem_are_named(columns: tuple[int, ...], rank: int) -> None:
    """M alone is regular; the third constraint is the sum of two others, the fourth is none."""
    G = np.zeros((6, 4))
    G[0, 0] = G[1, 1] = G[0, 2] = G[1, 2] = 1.0
    H = np.random.default_rng(0).standard_normal((6, 3))
    p = GlobalProblem(np.eye(6), H, np.ones(6), np.zeros(3), np.array([0.5]), G[:, columns], np.zeros(len(columns)))
    named = f"G: expected independent equality constraints .* got {len(columns)} of rank {rank}: leave {len(columns) - rank} out"
    with pytest.raises(SingularMatrix, match=named):
        solve(p, "auto")
    assert solve(replace(p, G=G[:, :1], b=np.zeros(1)), "auto").solved


def test_constraint_that_does_not_determine_its_multiplier() -> None:
    """R = 0: V^T r + s = 0 binds r itself."""
    p = LocalProblem(np.eye(3), np.array([-1.0, 0, 0]), np.array([0.3]), np.ones((3, 1)), np.zeros((1, 1)), np.ones(1))
    with pytest.raises(SingularMatrix, match="l is not determined by r"):
        solve(p, "NSGS-AC")


def test_no_contact_but_constraints() -> None:
    p = GlobalProblem(2 * np.eye(2), np.zeros((2, 0)), np.ones(2), np.zeros(0), np.zeros(0), np.array([[1.0], [0]]), np.array([-3.0]))
    result = solve(p, "NSN-AC")
    assert result.solved and result.v is not None and result.multiplier is not None
    assert_allclose(result.v, [3, 0.5])
    assert_allclose(result.multiplier, [5])


def test_gradient_steps_are_refused_without_elimination() -> None:
    with pytest.raises(InputError, match="safeguard: expected off with linear='kkt'"):
        solve(mixed(tied_bodies(3)[0]), "NSN-AC", linear="kkt", safeguard=True)


def test_time_and_iterations_are_limited() -> None:
    local = mixed(tied_bodies(3)[0])
    assert solve(local, "NSN-AC", linear="kkt", max_iterations=1, tol=1e-12).status is Status.MAX_ITERATIONS
    assert solve(local, "NSN-AC", linear="kkt", time_limit=0.0, tol=1e-12).status is Status.TIME_LIMIT


def test_file_with_constraints_through_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A mixed local file is solved, and its solution's multiplier written."""
    local = mixed(tied_bodies(3)[0])
    path, answer = write_fclib(tmp_path / "mixed.hdf5", local), tmp_path / "solved.hdf5"
    for option in ("auto", "kkt"):
        arguments = ["solve", str(path), "--solver", "NSN-AC", "--set", f"linear={option}", "--json", "--write-solution", str(answer)]
        assert cli.main(arguments) == 0
        assert json.loads(capsys.readouterr().out)["status"] == "SOLVED"
        solution = read_fclib(answer).solution
        assert solution is not None and solution.l is not None
        assert_allclose(local.V.T @ solution.r + local.R @ solution.l + local.s, 0, atol=1e-7)


@pytest.mark.parametrize(("nc", "p"), [(0, 0), (0, 2), (1, 0)])
def test_mixed_problems_without_contacts_or_without_constraints(nc: int, p: int) -> None:
    """R l + s = 0 alone, and a ball that falls on rough ground: r = (1, 0, 0). Both were errors of NumPy's."""
    V, R, s = np.zeros((3 * nc, p)), 2 * np.eye(p), np.ones(p)
    problem = LocalProblem(np.eye(3 * nc), np.tile([-1.0, 0, 0], nc), np.full(nc, 0.3), V, R, s)
    result = solve(problem)
    assert result.solved and np.allclose(result.r, np.tile([1.0, 0, 0], nc))
    assert np.array_equal(result.multiplier, np.full(p, -0.5))
