"""Fixed points over convex programs: answers, engines, internal tolerances, honest ends."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.errors import InputError
from fcsim.problem import GlobalProblem, LocalProblem
from fcsim.problem.reduction import reduce
from fcsim.solvers import Status, solve
from fcsim.solvers.variational.convex import ENGINES

Problems = dict[str, Callable[[], LocalProblem]]
NAMES = ["TRESCA", "CYLINDER-QP", "FP-VI-CYL", "PANA", "ACLM", "IPM"]


@pytest.mark.parametrize("name", NAMES)
def test_answers(name: str, coulomb_problem: LocalProblem, error_of: Callable[..., float]) -> None:
    result = solve(coulomb_problem, name, tol=1e-9, error="published")
    assert result.status is Status.SOLVED
    assert error_of(coulomb_problem, result.r) <= 1.001e-9
    assert_allclose(result.u, solve(coulomb_problem, "NSGS-AC", tol=1e-11).u, atol=1e-7)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("problem", ["full rank", "full rank, 2D", "sparse", "frictionless"])
@pytest.mark.parametrize("name", ["TRESCA", "PANA", "ACLM"])
def test_engines(name: str, problem: str, engine: str, coulomb_problems: Problems, error_of: Callable[..., float]) -> None:
    if engine == "Clarabel":
        pytest.importorskip("clarabel")
    p = coulomb_problems[problem]()
    options = {"internal": engine} | ({"internal_normal": engine} if name == "PANA" else {})
    result = solve(p, name, tol=1e-8, **options)
    assert result.solved and error_of(p, result.r) <= 1.001e-8


@pytest.mark.parametrize("name", NAMES)
def test_given_internal_tolerance(name: str, coulomb_problems: Problems) -> None:
    """Exact programs need at most as many fixed-point iterations; a loose one ends above the tolerance, and says so."""
    p = coulomb_problems["full rank"]()
    adaptive = solve(p, name, tol=1e-8)
    exact = solve(p, name, tol=1e-8, internal_tolerance_rule="given", internal_tolerance=1e-11)
    assert exact.solved and exact.iterations <= adaptive.iterations + 1
    capped = solve(p, name, tol=1e-8, internal_iterations=1, max_iterations=2)
    assert not capped.solved and capped.status is Status.MAX_ITERATIONS


@pytest.mark.parametrize("name", [*NAMES, "SOCLCP"])
def test_warm_start_and_limits(name: str, coulomb_problems: Problems) -> None:
    p = coulomb_problems["sticking block"]()
    cold = solve(p, name, tol=1e-10)
    assert cold.solved
    assert solve(p, name, r=cold.r, tol=1e-9).iterations == 0
    p = coulomb_problems["full rank"]()
    assert solve(p, name, max_iterations=1, tol=1e-13).status in (Status.MAX_ITERATIONS, Status.STAGNATED)
    assert solve(p, name, time_limit=0.0, tol=1e-13).status is Status.TIME_LIMIT


def test_tresca_program_is_exact_when_the_threshold_is_known(coulomb_problems: Problems) -> None:
    """One Tresca program from the solution's own normal reactions gives the solution back."""
    p = coulomb_problems["full rank"]()
    solution = solve(p, "NSN-AC", tol=1e-13).r
    start = solution.copy().reshape(-1, 3)
    start[:, 1:] = 0
    result = solve(p, "TRESCA", r=start.ravel(), max_iterations=1, internal_tolerance_rule="given", internal_tolerance=1e-12)
    assert_allclose(result.r, solution, atol=1e-9)


@pytest.mark.parametrize(("problem", "slides"), [("sticking block", False), ("hyperstatic", False), ("sliding block", True)])
def test_relaxation_is_exact_without_sliding_only(problem: str, slides: bool, coulomb_problems: Problems) -> None:
    """SOCLCP lifts a sliding contact: u_N = mu ||u_T||, and the status admits it."""
    p = coulomb_problems[problem]()
    result = solve(p, "SOCLCP", tol=1e-9)
    assert result.solved is not slides
    if slides:
        assert result.status is Status.STAGNATED
        u = (p.W @ result.r + p.q)[:3]
        assert_allclose(u[0], p.mu[0] * np.linalg.norm(u[1:]), rtol=1e-6)


@pytest.mark.parametrize("name", ["ACLM", "IPM"])
def test_global_form(name: str, global_problem: GlobalProblem, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("clarabel")
    expected = solve(global_problem, "NSN-AC", tol=1e-12)
    reduction = reduce(global_problem)
    monkeypatch.setattr(type(reduction), "local", property(lambda self: pytest.fail("W was formed")))
    result = solve(reduction, name, linear="kkt", tol=1e-9)
    assert result.solved
    assert_allclose(result.r, expected.r, atol=1e-7)
    assert result.checks.momentum is not None and result.checks.momentum < 1e-12


def test_clarabel_is_optional(coulomb_problems: Problems, monkeypatch: pytest.MonkeyPatch) -> None:
    from fcsim.errors import MissingDependency

    monkeypatch.setitem(__import__("sys").modules, "clarabel", None)
    with pytest.raises(MissingDependency, match=r"fcsim\[optimisation\]"):
        solve(coulomb_problems["full rank"](), "ACLM", internal="Clarabel")
    assert solve(coulomb_problems["full rank"](), "IPM").solved


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("TRESCA", {"internal": "PATH"}),
        ("TRESCA", {"internal_iterations": 0}),
        ("ACLM", {"internal_tolerance": 0.0}),
        ("ACLM", {"internal_tolerance_rule": "guess"}),
        ("ACLM", {"internal_error_ratio": 0.5}),
        ("IPM", {"linear": "dense"}),
        ("PANA", {"internal_normal": "Lemke"}),
        ("PANA", {"stagnation": 0}),
        ("SOCLCP", {"threshold": 1.0}),
    ],
)
def test_refused_options(name: str, options: dict[str, Any], coulomb_problems: Problems) -> None:
    with pytest.raises(InputError):
        solve(coulomb_problems["full rank"](), name, **options)
