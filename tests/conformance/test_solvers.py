"""Every solver of the table on the reference problems, judged by the law itself and by exact solutions, not by fcsim's own error."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
from numpy.testing import assert_allclose

from fcsim.errors import InputError
from fcsim.problem import GlobalProblem, LocalProblem
from fcsim.problem.reduction import reduce
from fcsim.solvers import SOLVERS, Result, Status, solve
from fcsim.solvers.newton.options import NewtonOptions
from tests.conformance.conftest import HYPERSTATIC, REGULAR, Reference, random_global, random_local

NEWTON = [name for name, method in SOLVERS.items() if isinstance(method.options, NewtonOptions) and not name.startswith("ROLLING")]
GLOBAL = [name for name, method in SOLVERS.items() if method.run_global is not None]
VARIANTS: dict[str, tuple[str, dict[str, Any]]] = {name: (name, {}) for name in SOLVERS} | {
    f"{name}, kkt": (name, {"linear": "kkt"}) for name in GLOBAL
}
VARIANTS |= {f"{name}, two-level": (name, {"linear": "two-level"}) for name in ("NSN-AC", "NSN-JM", "NSN-NM", "NSN-FB")}
MEANT = [variant for variant, (name, _) in VARIANTS.items() if not SOLVERS[name].limits]
AGREEING = [name for name in ("NSN-AC", "NSN-JM", "NSN-NM", "NSGS-AC", "NSN-AC-HYBRID") if name in SOLVERS]
TOL = 1e-10


def run(variant: str, problem: GlobalProblem | LocalProblem, **options: Any) -> Result:
    name, own = VARIANTS[variant]
    return solve(problem, name, **{"tol": TOL, "error": "published"} | own | options)


def refusal(variant: str, problem: GlobalProblem | LocalProblem) -> str:
    """How `solve` refuses the variant's option on such a problem; "" where it does not."""
    name, own = VARIANTS[variant]
    local = isinstance(problem, LocalProblem)
    if own.get("linear") == "kkt" and isinstance(problem, LocalProblem) and (problem.V is None or SOLVERS[name].run_mixed is None):
        return "option linear: expected 'kkt' with a"
    return "option linear: expected a global problem" if own.get("linear") == "two-level" and (local or problem.G is not None) else ""


def in_dimension(d: int, variants: Iterable[str]) -> list[str]:
    return [variant for variant in variants if d in SOLVERS[VARIANTS[variant][0]].dimensions]


def pairs(problems: Mapping[str, Callable[[], Reference]], *, refused: bool = False) -> pytest.MarkDecorator:
    """Parameters `make` and `variant`: each problem with each variant of its dimension that is, or is not, refused."""
    found = []
    for name, make in problems.items():
        problem = make().problem
        for variant in in_dimension(problem.dimension, VARIANTS):
            if bool(refusal(variant, problem)) == refused:
                found.append(pytest.param(make, variant, id=f"{name}-{variant}"))
    return pytest.mark.parametrize(("make", "variant"), found)


@cache
def in_si(variant: str, d: int) -> Result:
    """Of the problem that comes in six other units."""
    return run(variant, random_local(200, 6, d), tol=1e-13)


@cache
def from_zero(variant: str) -> Result:
    return run(variant, random_global(5, 3).problem, tol=1e-12)


@cache
def newton(name: str, rho: str, d: int) -> Result:
    """Without a line search."""
    return solve(random_local(300, 10, d), name, tol=TOL, rho=rho)


@cache
def by_dense_algebra(name: str) -> Result:
    return solve(random_local(400, 15, 3), name, tol=1e-9, linear="dense")


def contact_velocity(problem: GlobalProblem | LocalProblem, r: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(u, q) by dense algebra from the problem's own matrices, constraints included."""

    def dense(matrix: Any) -> np.ndarray:
        return matrix.toarray() if sp.issparse(matrix) else np.asarray(matrix)

    if isinstance(problem, LocalProblem):
        W, q = dense(problem.W), problem.q
        if problem.V is not None:
            assert problem.s is not None
            V, R = dense(problem.V), dense(problem.R)
            W, q = W - V @ np.linalg.solve(R, V.T), q - V @ np.linalg.solve(R, problem.s)
        return W @ r + q, q
    A, H, f = dense(problem.M), dense(problem.H), problem.f
    if problem.G is not None:
        assert problem.b is not None
        G, p = dense(problem.G), len(problem.b)
        A = np.block([[A, -G], [G.T, np.zeros((p, p))]])
        H, f = np.vstack([H, np.zeros((p, problem.m))]), np.r_[f, -problem.b]
    free = np.linalg.solve(A, np.column_stack([f, f + H @ r]))
    q, u = (H.T @ free + problem.w[:, None]).T
    return u, q


def assert_answers(reference: Any, result: Result, verdict: Callable[..., Any], tol: float) -> None:
    """The answer obeys the law, and what the result says of itself is true."""
    p = reference.problem
    u, q = contact_velocity(p, result.r)
    assert_allclose(result.u, u, atol=1e-11 * (1 + np.abs(u).max(initial=0)))
    found = verdict(result.r, u, p.mu, p.dimension, q)
    assert found.error <= 1.01 * tol + 1e-15
    assert_allclose(result.error, found.error, rtol=1e-2, atol=1e-13)
    for name in ("cone", "dual_cone", "complementarity"):
        assert getattr(found, name) <= 1e3 * tol
        assert getattr(result.checks, name) <= 1e3 * tol
    if isinstance(p, GlobalProblem):
        assert result.v is not None
        assert result.checks.momentum is not None and result.checks.momentum < 1e-10
        balance = p.M @ result.v - p.H @ result.r - p.f
        if p.G is not None:
            assert result.multiplier is not None
            balance -= p.G @ result.multiplier
            assert_allclose(p.G.T @ result.v + p.b, 0, atol=1e-11)
        assert_allclose(balance, 0, atol=1e-9)
        assert_allclose(p.H.T @ result.v + p.w, u, atol=1e-10)


@pairs(REGULAR)
def test_regular_problem_is_solved(make: Callable[[], Reference], variant: str, verdict: Callable[..., Any]) -> None:
    regular = make()
    result = run(variant, regular.problem)
    if variant not in MEANT and not result.solved:  # what the table says it is not meant for; then the status must be honest
        u, q = contact_velocity(regular.problem, result.r)
        assert verdict(result.r, u, regular.problem.mu, regular.problem.dimension, q).error > TOL
        return
    assert result.status is Status.SOLVED
    assert_answers(regular, result, verdict, TOL)
    if regular.u is not None:
        assert_allclose(result.u, regular.u, rtol=1e-8, atol=1e-8)
        assert_allclose(result.r, regular.r, rtol=1e-8, atol=1e-8)
    if regular.r is not None and not regular.r.any():
        assert not result.r.any()  # take-off: exactly zero


@pairs(REGULAR, refused=True)
def test_what_a_problem_has_no_form_for_is_refused(make: Callable[[], Reference], variant: str) -> None:
    problem = make().problem
    with pytest.raises(InputError, match=refusal(variant, problem)):
        run(variant, problem)


@pairs(HYPERSTATIC)
def test_hyperstatic_problem_gets_an_honest_status(make: Callable[[], Reference], variant: str, verdict: Callable[..., Any]) -> None:
    hyperstatic = make()
    result = run(variant, hyperstatic.problem, max_iterations=2000) if variant in ("NSGS-AC",) else run(variant, hyperstatic.problem)
    p = hyperstatic.problem
    u, q = contact_velocity(p, result.r)
    found = verdict(result.r, u, p.mu, p.dimension, q)
    assert_allclose(result.error, found.error, rtol=1e-6, atol=1e-13)
    assert result.solved == (found.error <= TOL)
    if result.solved:
        assert_answers(hyperstatic, result, verdict, TOL)
        if hyperstatic.u is not None:
            assert_allclose(result.u, hyperstatic.u, atol=1e-8)
            assert_allclose(p.H @ result.r, -p.f, atol=1e-8)  # statics: the reactions carry the load


@pytest.mark.parametrize("name", HYPERSTATIC)
def test_gauss_seidel_solves_hyperstatic_problems(name: str) -> None:
    assert solve(HYPERSTATIC[name]().problem, "NSGS-AC", tol=1e-8).status is Status.SOLVED


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("seed", range(3))
def test_solvers_agree(seed: int, d: int, random_problem: Callable[..., LocalProblem]) -> None:
    problem = random_problem(100 + seed, 15, d)
    results = {name: solve(problem, name, tol=1e-12) for name in AGREEING}
    first = results[AGREEING[0]]
    assert first.r.any() and not (first.r.reshape(-1, d)[:, 0] > 0).all()
    for name, result in results.items():
        assert result.solved, name
        assert_allclose(result.u, first.u, atol=1e-9, err_msg=name)
        assert_allclose(result.r, first.r, atol=1e-9, err_msg=name)


@pytest.mark.parametrize("factor", [1e6, 1e-6])
@pytest.mark.parametrize("unit", ["mass", "length", "time"])
@pytest.mark.parametrize("variant", [name for name, method in SOLVERS.items() if name in MEANT and {2, 3} & set(method.dimensions)])
def test_units_do_not_matter(variant: str, unit: str, factor: float, random_problem: Callable[..., LocalProblem]) -> None:
    """W in 1/kg, q in m/s, r in N s: another unit of mass, length or time gives the same solution in that unit."""
    # the error adds N s to m/s: with heavy r its round-off is that of r, with light r only a small error says something about r
    tol = 1e-9 if unit == "mass" and factor > 1 else 1e-13
    mass, velocity = {"mass": (factor, 1.0), "length": (1.0, factor), "time": (1.0, 1 / factor)}[unit]
    for d in {2, 3} & set(SOLVERS[variant].dimensions):
        p = random_problem(200, 6, d)
        expected = in_si(variant, d)
        scaled = run(variant, LocalProblem(p.W / mass, p.q * velocity, p.mu, dimension=d), tol=tol)
        assert expected.solved and scaled.solved
        assert_allclose(scaled.u / velocity, expected.u, atol=1e-6)
        assert_allclose(scaled.r / (mass * velocity), expected.r, atol=1e-6)


@pytest.mark.parametrize("variant", in_dimension(3, MEANT))
def test_the_three_ways_to_give_a_problem(variant: str, random_global_problem: GlobalProblem) -> None:
    """Global, its reduction, and its local form have the same answer; only the first two know v."""
    reduction = reduce(random_global_problem)
    name, own = VARIANTS[variant]
    without_global = {"linear": "auto"} if "linear" in own else {}
    results = [from_zero(variant), run(variant, reduction.local, tol=1e-12, **without_global)]
    results.append(solve(reduction, name, tol=1e-12, **own))
    for result in results:
        assert result.solved
        assert_allclose(result.r, results[0].r, atol=1e-9)
    assert results[1].v is None and results[0].v is not None and results[2].v is not None
    assert_allclose(results[2].v, results[0].v, atol=1e-9)


@pytest.mark.parametrize("variant", in_dimension(3, MEANT))
def test_warm_start(variant: str, random_global_problem: GlobalProblem) -> None:
    """From the solution no iteration is needed; the starting point given is left as it was."""
    cold = from_zero(variant)
    start = cold.r.copy()
    warm = run(variant, random_global_problem, r=start, tol=1e-8)
    assert warm.solved and warm.iterations == 0
    assert_allclose(start, cold.r, atol=0)
    nearby = run(variant, random_global_problem, r=1.01 * start, tol=1e-8)
    as_near = run(variant, random_global_problem, tol=1e-8)  # to 1e-12 `auto` takes Newton's iterations, to 1e-8 sweeps
    assert nearby.solved and nearby.iterations <= as_near.iterations
    assert_allclose(nearby.u, cold.u, atol=1e-6)


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("line_search", ["Goldstein-Price", "Armijo"])
@pytest.mark.parametrize("rho", ["spectral norm", "split spectral norm", "split spectral norm with condition number", "constant"])
@pytest.mark.parametrize("name", NEWTON)
def test_newton_options(name: str, rho: str, line_search: str, d: int, random_problem: Callable[..., LocalProblem], verdict: Any) -> None:
    problem = random_problem(300, 10, d)
    plain = newton(name, rho, d)
    searched = solve(problem, name, tol=TOL, rho=rho, line_search=line_search)
    for result in (plain, searched):
        u, q = contact_velocity(problem, result.r)
        assert result.solved == (verdict(result.r, u, problem.mu, d, q).error <= TOL)
    assert plain.solved


@pytest.mark.parametrize("linear", ["dense", "condensed", "sparse"])
@pytest.mark.parametrize("name", NEWTON)
def test_linear_algebra_does_not_change_the_iterates(name: str, linear: str, random_problem: Callable[..., LocalProblem]) -> None:
    problem = random_problem(400, 15, 3)
    if linear == "sparse":
        problem = replace(problem, W=sp.bsr_array(problem.W, blocksize=(3, 3)))
    reference, result = by_dense_algebra(name), solve(problem, name, tol=1e-9, linear=linear)
    assert result.iterations == reference.iterations
    assert_allclose([row[2] for row in result.history], [row[2] for row in reference.history], rtol=1e-4, atol=1e-12)


@pytest.mark.parametrize("variant", in_dimension(3, VARIANTS))
def test_history(variant: str, random_global_problem: GlobalProblem) -> None:
    """Iterations and seconds rise, the last error is the result's."""
    result = run(variant, random_global_problem)
    iterations, seconds, errors = np.array(result.history).T
    assert np.all(np.diff(iterations) >= 0) and np.all(np.diff(seconds) >= 0)
    assert iterations[-1] == result.iterations
    assert_allclose(errors[-1], result.error, rtol=1e-2, atol=1e-13)
    assert set(result.seconds) == {"reduction", "solve"}
    assert_allclose(result.time, sum(result.seconds.values()))
    assert result.method == VARIANTS[variant][0]
