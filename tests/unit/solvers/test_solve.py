"""`solve`: what it refuses, why it says it stopped, and that it believes no method."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.errors import InputError
from fcsim.linear.factors import SingularMatrix
from fcsim.problem import GlobalProblem, LocalProblem
from fcsim.solvers import ALIASES, SOLVERS, Method, Result, Status, method, solve
from fcsim.solvers.base import Iterate, Monitor, override
from fcsim.solvers.gauss_seidel.sweeps import GaussSeidelOptions, nsgs
from fcsim.solvers.hybrid import HybridOptions, Stage, hybrid
from fcsim.solvers.newton.iterations import newton
from fcsim.solvers.newton.line_search import armijo, goldstein_price
from fcsim.solvers.newton.options import NewtonOptions

COULOMB = [name for name, method in SOLVERS.items() if 5 not in method.dimensions]


def problem(seed: int = 0, nc: int = 10, d: int = 3) -> LocalProblem:
    rng = np.random.default_rng(seed)
    m = d * nc
    H = rng.standard_normal((m + 4, m))
    return LocalProblem(H.T @ H / nc + 0.1 * np.eye(m), rng.standard_normal(m) - 0.5, np.full(nc, 0.3), dimension=d)


@pytest.fixture(scope="module", autouse=True)
def compiled_kernels() -> None:
    """Compilation takes seconds and must not count against a time limit."""
    assert solve(problem(), "NSGS-AC").solved


def true_error(p: LocalProblem, r: np.ndarray) -> float:
    """||r - P_K(r - (u + g(u)))|| / ||q|| contact by contact."""
    total = 0.0
    for a, mu in enumerate(p.mu):
        own = slice(p.dimension * a, p.dimension * (a + 1))
        z = r[own] - (p.W @ r + p.q)[own]
        z[0] -= mu * np.linalg.norm((p.W @ r + p.q)[own][1:])
        length = np.linalg.norm(z[1:])
        if length <= mu * z[0]:
            P = z
        elif mu * length <= -z[0]:
            P = np.zeros(p.dimension)
        else:
            s = (z[0] + mu * length) / (1 + mu**2)
            P = np.r_[s, mu * s * z[1:] / length]
        total += float(np.sum((r[own] - P) ** 2))
    return float(np.sqrt(total) / np.linalg.norm(p.q))


# what is refused


def test_unknown_solver_lists_the_table() -> None:
    with pytest.raises(InputError) as caught:
        solve(problem(), "NSN-XY")
    assert "'NSN-XY'" in str(caught.value)
    assert all(name in str(caught.value) for name in (*SOLVERS, *ALIASES))


@pytest.mark.parametrize("alias", ALIASES)
def test_an_alias_is_the_method_that_it_stands_for(alias: str) -> None:
    assert alias not in SOLVERS and method(alias) is SOLVERS[ALIASES[alias]]
    answer, meant = solve(problem(), alias), solve(problem(), ALIASES[alias])
    assert answer.method == alias and answer.solved and np.array_equal(answer.r, meant.r)


def test_no_method_stands_twice_in_the_table() -> None:
    rows = [(m.run, m.options, m.dimensions, m.run_global, m.run_mixed) for m in SOLVERS.values()]
    assert not [row for i, row in enumerate(rows) if row in rows[:i]]


@pytest.mark.parametrize("name", SOLVERS)
def test_unknown_option_lists_the_known_ones(name: str) -> None:
    known = SOLVERS[name].options.__dataclass_fields__
    with pytest.raises(InputError) as caught:
        solve(problem(), name, no_such_option=1)
    assert "'no_such_option'" in str(caught.value)
    assert known and all(option in str(caught.value) for option in known)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"r": np.zeros(29)}, r"r: expected a starting point of shape \(30,\), got \(29,\)"),
        ({"r": np.zeros((10, 3))}, r"r: .* got \(10, 3\)"),
        ({"r": np.full(30, np.nan)}, "r: .* finite"),
        ({"tol": 0.0}, "tol: expected a number > 0, got 0.0"),
        ({"tol": -1e-8}, "tol"),
        ({"tol": float("nan")}, "tol: .* got nan"),
        ({"tol": 1.0}, "tol: expected a number < 1, since r = 0 meets that, got 1.0"),
        ({"tol": float("inf")}, "tol: expected a number < 1"),
        ({"tol": "1e-8"}, "tol: expected a number, got '1e-8'"),
        ({"floor": -1.0}, "floor: expected a number >= 0"),
        ({"floor": float("inf")}, "floor: expected a number >= 0"),
        ({"time_limit": float("nan")}, "time_limit: expected a number"),
        ({"safeguard": "flase"}, "option safeguard: expected True or False, got 'flase'"),
        ({"safeguard": 1}, "option safeguard: expected True or False, got '1'"),
        ({"max_iterations": 10**20}, "option max_iterations: expected a whole number from -9007199254740992 to 9007199254740992"),
        ({"max_iterations": 7.0}, "option max_iterations: expected a whole number"),
        ({"max_iterations": True}, "option max_iterations: expected a whole number"),
        ({"rho_factor": float("nan")}, "option rho_factor: expected a number, got 'nan'"),
        ({"rho": 3}, "option rho: expected a text, got '3'"),
        ({"max_iterations": -1}, "max_iterations"),
        ({"formulation": "XY"}, "formulation: expected one of 'AC', 'JM', 'NM', 'FB', got 'XY'"),
        ({"rho": "best"}, "rho: expected one of .*'split spectral norm'"),
        ({"rho_factor": 0.0}, "rho_factor"),
        ({"line_search": "golden"}, "line_search: expected one of .*'Goldstein-Price'"),
        ({"linear": "magic"}, "linear: expected one of .*'condensed'"),
    ],
)
def test_bad_argument_is_refused(arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        solve(problem(), "NSN-AC", **arguments)


@pytest.mark.parametrize("options", [{"local_tolerance": -1.0}, {"local_tolerance": float("nan")}, {"local_iterations": 0}])
def test_bad_gauss_seidel_option_is_refused(options: dict[str, Any]) -> None:
    with pytest.raises(InputError, match=next(iter(options))):
        solve(problem(), "NSGS-AC", **options)


def test_bad_hybrid_option_is_refused() -> None:
    with pytest.raises(InputError, match="cycles"):
        solve(problem(), "NSN-AC-HYBRID", cycles=0)


def test_a_method_that_nobody_chose_carries_a_block_on_four_points() -> None:
    """Twelve unknowns for six velocities: Newton's method on W alone finds it singular. Statics: the points bear m g h together."""
    arms = np.array([(x, y, -0.4) for x in (-1.0, 1.0) for y in (-0.5, 0.5)])
    frame = np.eye(3)[[2, 0, 1]]  # N, T1, T2
    H = np.vstack([np.hstack([frame, np.cross(arm, frame)]) for arm in arms]).T
    mass = np.array([2.0, 2.0, 2.0, 0.28, 0.78, 0.84])
    f = np.array([0.0, 0.0, -2.0 * 9.81e-3, 0.0, 0.0, 0.0])
    assert not solve(GlobalProblem(np.diag(mass), H, f, np.zeros(12), np.full(4, 0.4)), "NSN-AC").solved
    result = solve(GlobalProblem(np.diag(mass), H, f, np.zeros(12), np.full(4, 0.4)))
    assert result.solved
    assert_allclose(H @ result.r, -f, atol=1e-9)


def test_other_things_than_problems_are_refused() -> None:
    with pytest.raises(InputError, match="problem: expected a GlobalProblem"):
        solve(np.eye(3))  # type: ignore[arg-type]


def test_wrong_dimension_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(SOLVERS, "NSN-AC", replace(SOLVERS["NSN-AC"], dimensions=(2,)))
    with pytest.raises(InputError, match="'NSN-AC': works in 2D, the problem has 3D"):
        solve(problem(), "NSN-AC")


def test_gradient_steps_are_refused_on_the_global_form() -> None:
    p = GlobalProblem(np.eye(3), np.eye(3), -np.ones(3), np.zeros(3), np.array([0.3]))
    with pytest.raises(InputError, match="safeguard"):
        solve(p, "NSN-AC", linear="kkt", safeguard=True)


def test_override_leaves_the_original() -> None:
    options = NewtonOptions()
    changed = override(options, {"formulation": "JM", "max_iterations": 7})
    assert (changed.formulation, changed.max_iterations, options.formulation, options.max_iterations) == ("JM", 7, "AC", 200)


# why it stopped


@pytest.mark.parametrize("name", [name for name in COULOMB if hasattr(SOLVERS[name].options, "max_iterations")])
def test_max_iterations(name: str) -> None:
    p = problem(d=SOLVERS[name].dimensions[-1])
    for limit in (0, 1, 2):
        result = solve(p, name, tol=1e-14, max_iterations=limit)
        if name in ("PATH", "2D-ENUM") and limit > 0 and result.solved:  # their first LCP's basis may be the answer's
            assert result.iterations <= limit
            continue
        assert result.status is Status.MAX_ITERATIONS and not result.solved
        assert result.iterations == limit
        assert_allclose(result.published_error, true_error(p, result.r), rtol=1e-8)
        assert_allclose(result.error, min(row[2] for row in result.history), rtol=1e-8)  # the best iterate, not the last


@pytest.mark.parametrize("name", COULOMB)
def test_time_limit(name: str) -> None:
    p = problem(d=SOLVERS[name].dimensions[-1])
    result = solve(p, name, tol=1e-14, time_limit=0.0)
    assert result.status is Status.TIME_LIMIT
    assert_allclose(result.published_error, true_error(p, result.r), rtol=1e-8)


def test_gauss_seidel_out_of_time_returns_its_last_sweep(monkeypatch: pytest.MonkeyPatch) -> None:
    """The full error is computed now and then only: sweeps made since the last time are not lost."""
    p, calls = problem(1), iter([False] * 5 + [True])
    expected = solve(p, "NSGS-AC", tol=1e-14, max_iterations=5)
    monkeypatch.setattr(Monitor, "out_of_time", lambda self: next(calls))
    monkeypatch.setattr("fcsim.solvers.gauss_seidel.sweeps.UNWATCHED", 0)  # a look at the clock before each sweep
    result = solve(p, "NSGS-AC", tol=1e-14, time_limit=0.5)  # a longer one does not keep so small a problem from its front door
    assert result.status is Status.TIME_LIMIT and result.iterations == 5
    assert expected.error < 0.1
    assert_allclose(result.r, expected.r, atol=0)


def test_unreachable_tolerance_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    """Below round-off no method may claim success, nor run for ever."""
    monkeypatch.setattr(time, "perf_counter", time.thread_time)  # half a second of the processor: what else it does changes nothing
    for name in COULOMB:
        p = problem(d=SOLVERS[name].dimensions[-1])
        solve(p, name, tol=1e-300, max_iterations=3)  # loads what is compiled
        result = solve(p, name, tol=1e-300, time_limit=0.5)
        assert (result.error <= 1e-300) == result.solved
        assert result.error < 1e-13 or SOLVERS[name].limits


def test_singular_system_is_told() -> None:
    """Two contacts at one point, both sticking: Newton's matrix has no inverse."""
    W = np.kron(np.ones((2, 2)), np.eye(3))
    result = solve(LocalProblem(W, np.tile([-1.0, 0, 0], 2), np.full(2, 0.5)), "NSN-AC")
    assert result.status is Status.SINGULAR
    assert_allclose(result.r, 0)


def test_divergence_is_told_and_the_best_iterate_returned(monkeypatch: pytest.MonkeyPatch) -> None:
    def diverging(p: LocalProblem, r: np.ndarray, monitor: Monitor, options: Any) -> Iterate:
        monitor.record(r, p.W @ r + p.q)
        monitor.record(r + 1e200, p.W @ (r + 1e200) + p.q)
        return Iterate(np.full_like(r, np.nan), Status.DIVERGED)

    monkeypatch.setitem(SOLVERS, "DIVERGING", Method(diverging, NewtonOptions(), "test", "test"))
    start = np.full(30, 0.1)
    result = solve(problem(), "DIVERGING", start)
    assert result.status is Status.DIVERGED
    assert_allclose(result.r, start)
    assert_allclose(result.published_error, true_error(problem(), start))


@pytest.mark.parametrize("claimed", [0.0, 0.3, float("nan")])
@pytest.mark.parametrize("form", ["local", "global"])
def test_a_lying_method_is_found_out(monkeypatch: pytest.MonkeyPatch, claimed: float, form: str) -> None:
    def lying(p: LocalProblem, r: np.ndarray, monitor: Monitor, options: Any) -> Iterate:
        return Iterate(np.full_like(r, claimed), Status.SOLVED)

    monkeypatch.setitem(SOLVERS, "LYING", Method(lying, NewtonOptions(), "test", "test"))
    p: Any = problem()
    if form == "global":
        p = GlobalProblem(np.eye(3), np.eye(3), -np.ones(3), np.zeros(3), np.array([0.3]))
    result = solve(p, "LYING")
    assert result.status is Status.STAGNATED and not result.solved
    assert not result.error <= 1e-8


def test_zero_is_recognised_as_the_answer() -> None:
    """All contacts leave: r = 0 whatever the starting point; and at rest up to round-off when the floor says so."""
    p = LocalProblem(np.eye(6), np.array([1.0, 3, 0, 0, 0, 2]), np.full(2, 0.4))
    result = solve(p, "NSN-AC", np.ones(6))
    assert result.solved and result.error == 0 and not result.r.any()
    at_rest = LocalProblem(np.eye(3), np.array([-1e-13, 1e-13, 0]), np.array([0.4]))
    result = solve(at_rest, "NSN-AC", floor=1e-3)
    assert result.solved and result.iterations == 0 and not result.r.any()
    assert solve(at_rest, "NSN-AC").r.any()  # without a floor the round-off is a problem like any other
    still = solve(LocalProblem(np.eye(3), np.zeros(3), np.array([0.4])), "NSN-AC", np.ones(3))
    assert still.solved and still.error == 0


# stages and line searches


def test_hybrid_goes_on_from_the_best_iterate_and_counts_all_iterations() -> None:
    seen: list[tuple[np.ndarray, int]] = []

    def stage(steps: int, status: Status) -> Stage:
        def run_stage(p: LocalProblem, r: np.ndarray, monitor: Monitor, options: NewtonOptions) -> Iterate:
            seen.append((r, options.max_iterations))
            monitor.iterations += steps
            monitor.record(r + 1, p.W @ (r + 1) + p.q)
            return Iterate(np.full_like(r, 9.0), status)

        return Stage(run_stage, NewtonOptions(max_iterations=10))

    p = problem()
    monitor = Monitor(p.q, p.mu, 3, 1e-8)
    options = HybridOptions(stages=(stage(4, Status.MAX_ITERATIONS), stage(5, Status.SINGULAR)), cycles=2)
    assert hybrid(p, np.zeros(30), monitor, options).status is Status.SINGULAR
    assert monitor.iterations == 18
    assert [limit for _, limit in seen] == [10, 14, 19, 23]  # ten more for each stage
    assert_allclose(seen[0][0], 0)
    assert monitor.best_r is not None
    assert_allclose(seen[1][0], 1)
    assert not any((r == 9).all() for r, _ in seen)


def test_hybrid_repeats_its_stages_until_solved() -> None:
    p = problem()
    one_sweep, one_step = Stage(nsgs, GaussSeidelOptions(max_iterations=1)), Stage(newton, NewtonOptions(max_iterations=1))
    few = solve(p, "NSN-AC-HYBRID", stages=(one_sweep, one_step), cycles=1, tol=1e-12)
    assert few.status is Status.MAX_ITERATIONS and few.iterations == 2
    many = solve(p, "NSN-AC-HYBRID", stages=(one_sweep, one_step), cycles=50, tol=1e-12)
    assert many.solved and many.iterations > 2
    assert true_error(p, many.r) <= 1.1e-12


def test_stagnation_is_counted_from_the_start_of_the_stage() -> None:
    p, start = problem(), np.zeros(30)
    monitor = Monitor(p.q, p.mu, 3, 1e-12)
    monitor.iterations = 500
    options = GaussSeidelOptions(max_iterations=700, stagnation_sweeps=150)
    assert nsgs(p, start, monitor, options).status is Status.SOLVED
    assert monitor.iterations > 500


def test_line_searches_keep_their_promises() -> None:
    """Along merit(t) = (1 - t)^2 / 2 + c t^4: Armijo's decrease and both of Goldstein-Price's bounds."""
    for c in (0.0, 0.1, 1.0, 100.0, 1e4):

        def merit(t: float, c: float = c) -> float:
            return 0.5 * (1 - t) ** 2 + c * t**4

        slope = -1.0
        t = armijo(merit, merit(0), slope)
        assert merit(t) <= merit(0) + 1e-4 * t * slope
        t = goldstein_price(merit, merit(0), slope)
        assert 0.99 * slope <= (merit(t) - merit(0)) / t <= 0.01 * slope
    t = goldstein_price(lambda t: 0.5 * (1 - t / 8) ** 2, 0.5, -0.125, m1=0.1, m2=0.6)
    assert t > 1  # a step that is too short is made longer
    assert 0.6 * -0.125 <= (0.5 * (1 - t / 8) ** 2 - 0.5) / t <= 0.1 * -0.125


def test_line_searches_from_a_bad_start() -> None:
    p = problem(3)
    for search in ("Armijo", "Goldstein-Price"):
        result: Result = solve(p, "NSN-AC", 100 * np.ones(30), line_search=search, tol=1e-10)
        assert (true_error(p, result.r) <= 1e-10) == result.solved
        assert result.solved


# trust inside the chains


def _drifting(problem: LocalProblem, r: np.ndarray, monitor: Monitor, options: Any) -> Iterate:
    """A method whose u has drifted to where r = 0 would be the answer."""
    lifted = np.zeros_like(problem.q)
    lifted[:: problem.dimension] = 1.0
    return Iterate(r, Status.SOLVED if monitor.record(r, lifted) <= monitor.tol else Status.STAGNATED)


def test_a_drifted_velocity_does_not_end_a_chain(monkeypatch: pytest.MonkeyPatch) -> None:
    """The stage believes its own u; what counts is u recomputed from r, so that the hybrid goes on to one that solves."""
    stages = (Stage(_drifting, NewtonOptions()), Stage(newton, NewtonOptions()))
    monkeypatch.setitem(SOLVERS, "DRIFTS-FIRST", replace(SOLVERS["NSN-AC"], run=hybrid, options=HybridOptions(stages=stages)))
    result = solve(problem(), "DRIFTS-FIRST", tol=1e-10)
    assert result.solved
    assert true_error(problem(), result.r) <= 1.1e-10


def test_a_singular_matrix_inside_a_method_is_a_status(monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*_: Any) -> Iterate:
        raise SingularMatrix("zero pivot 3")

    monkeypatch.setitem(SOLVERS, "FAILS", replace(SOLVERS["NSN-AC"], run=fails))
    result = solve(problem(), "FAILS")
    assert (result.status, result.message) == (Status.SINGULAR, "zero pivot 3")
    stages = (Stage(fails, NewtonOptions()), Stage(newton, NewtonOptions()))
    monkeypatch.setitem(SOLVERS, "FAILS-FIRST", replace(SOLVERS["NSN-AC"], run=hybrid, options=HybridOptions(stages=stages)))
    assert solve(problem(), "FAILS-FIRST").solved


def test_a_hybrid_keeps_to_its_iterations() -> None:
    result = solve(problem(nc=30), "NSN-AC-HYBRID", tol=1e-14, max_iterations=3)
    assert result.iterations <= 3
    with pytest.raises(InputError, match="max_iterations"):
        solve(problem(), "NSN-AC-HYBRID", max_iterations=-1)


@pytest.mark.parametrize("name", [name for name in COULOMB if not name.startswith("2D")])
def test_not_a_number_is_never_solved(name: str) -> None:
    """Entries near the largest number overflow to infinity and NaN in products; whatever a method makes of that, it is not SOLVED."""
    huge = LocalProblem(1e300 * np.array([[2.0, 1, 0], [1, 2, 1], [0, 1, 2]]), np.array([-1e200, 1e180, 3.0]), np.array([0.5]))
    result = solve(huge, name, np.array([1e200, 1e200, -1e200]), tol=1e-8, max_iterations=50)
    assert result.solved is (result.error <= 1e-8)


def test_kkt_is_refused_where_it_cannot_be_honoured() -> None:
    with pytest.raises(InputError, match="option linear: expected 'kkt' with a global or mixed local problem for 'NSN-AC'"):
        solve(problem(), "NSN-AC", linear="kkt")
    mixed = LocalProblem(np.eye(3), -np.ones(3), np.array([0.5]), np.zeros((3, 1)), np.eye(1), np.zeros(1))
    with pytest.raises(InputError, match="expected 'kkt' with a global problem for 'ADMM', got it with a mixed local problem"):
        solve(mixed, "ADMM", linear="kkt")


def test_whole_numbers_beyond_64_bits_are_floats_or_refused() -> None:
    problem = LocalProblem(np.eye(3), np.array([-1.0, 0.5, 0.0]), np.array([0.3]))
    assert solve(problem, "EG-VI-UTK", rho=10**20, max_iterations=5).error >= 0
    with pytest.raises(InputError, match="option rho: expected a number, got '1000"):
        solve(problem, "EG-VI-UTK", rho=10**400)


@pytest.mark.parametrize("form", ["local", "global"])
@pytest.mark.parametrize("solver", ["NSN-AC", "NSGS-AC"])
def test_a_wrong_sign_of_the_matrix_is_named(form: str, solver: str) -> None:
    """W = -1 has no answer where q_N < 0: u_N = q_N - r_N < 0 for every r_N >= 0. It was STAGNATED, without a word."""
    mu, q = np.array([0.5]), np.array([-1.0, 0.5, 0.2])
    wrong = LocalProblem(-np.eye(3), q, mu) if form == "local" else GlobalProblem(-np.eye(3), np.eye(3), -q, np.zeros(3), mu)
    found = solve(wrong, solver, max_iterations=50)
    assert not found.solved and "W is not positive semidefinite" in found.message
    assert "semidefinite" not in solve(problem(), "NSGS-AC", tol=1e-12, max_iterations=3).message


def test_a_tolerance_below_round_off_is_called_so() -> None:
    """Of numbers of 16 digits that do not cancel it was said that w and H^T M^-1 f cancel, or that reactions are large."""
    p = problem()
    said = solve(GlobalProblem(np.eye(p.m), np.linalg.cholesky(p.W).T, np.zeros(p.m), p.q, p.mu), "NSN-AC", tol=1e-17).message
    assert "a tolerance of 1e-17 does not leave room for" in said and "cancel" not in said
