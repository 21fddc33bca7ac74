"""Options of the nonsmooth Newton methods: line searches against a non-monotone reference, gradient steps, adaptive rho, refusals."""

from __future__ import annotations

from collections import deque
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.errors import InputError
from fcsim.linear.factors import SingularMatrix
from fcsim.problem import Delassus, GlobalProblem, LocalProblem
from fcsim.solvers import SOLVERS, Memory, Status, solve
from fcsim.solvers.base import Monitor
from fcsim.solvers.newton.formulations import FORMULATIONS
from fcsim.solvers.newton.iterations import AdaptedRho, newton, newton_iterations
from fcsim.solvers.newton.line_search import REFERENCES, armijo, goldstein
from fcsim.solvers.newton.options import NewtonOptions
from fcsim.solvers.newton.spaces import LocalSpace
from fcsim.solvers.newton.systems.direct import DenseSystem


def random_problem(seed: int, nc: int = 10, d: int = 3, mu: float = 0.5) -> LocalProblem:
    rng = np.random.default_rng(seed)
    H = rng.standard_normal((d * nc + 5, d * nc)) / np.sqrt(d * nc)
    q = rng.standard_normal((nc, d))
    q[:, 0] -= 0.5
    return LocalProblem(H.T @ H + 0.1 * np.eye(d * nc), q.ravel(), rng.uniform(0, mu, nc), dimension=d)


def true_error(p: LocalProblem, r: np.ndarray) -> float:
    """Eq. 13 with the projection in polar coordinates, written again."""
    d, total = p.dimension, 0.0
    u = (p.W @ r + p.q).reshape(-1, d)
    for a, mu in enumerate(p.mu):
        z = r.reshape(-1, d)[a] - u[a]
        z[0] -= mu * np.linalg.norm(u[a, 1:])
        length, angle = np.linalg.norm(z[1:]), np.arctan(mu)
        theta = np.arctan2(length, z[0])
        if theta <= angle:
            P = z
        elif theta >= angle + np.pi / 2:
            P = np.zeros(d)
        else:
            along = np.hypot(z[0], length) * np.cos(theta - angle)
            P = along * np.r_[np.cos(angle), np.sin(angle) * z[1:] / length]
        total += float(np.sum((r.reshape(-1, d)[a] - P) ** 2))
    return np.sqrt(total) / float(np.linalg.norm(p.q))


NAMES = [name for name, method in SOLVERS.items() if isinstance(method.options, NewtonOptions) and 5 not in method.dimensions]
CHOICES: list[dict[str, Any]] = [
    {"rho": "adaptive"},
    {"line_search": "Armijo", "reference": "maximum", "window": 5},
    {"line_search": "Goldstein", "reference": "mean"},
    {"line_search": "Goldstein-Price", "reference": "Zhang-Hager"},
    {"line_search": "Armijo", "safeguard": True},
]


@pytest.mark.parametrize("options", CHOICES, ids=lambda options: ", ".join(map(str, options.values())))
@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_options_lead_to_the_same_answer(formulation: str, options: dict[str, Any]) -> None:
    rho = {} if formulation in ("AC", "JM") else {"rho": "spectral norm"}
    for seed, d in ((1, 3), (2, 2)):
        p = random_problem(seed, d=d)
        expected = solve(p, "NSN-AC", tol=1e-11)
        result = solve(p, "NSN-AC", tol=1e-11, **{"formulation": formulation, **rho, **options})
        assert result.solved == (true_error(p, result.r) <= 1e-11)
        assert result.solved
        assert_allclose(result.u, expected.u, atol=1e-9)


@pytest.mark.parametrize("name", NAMES)
def test_published_names(name: str) -> None:
    """NLS is Newton as it is, GP the Goldstein-Price search; the name's second part is the formulation."""
    options = SOLVERS[name].options
    assert options.formulation == name.split("-")[1]
    if name.endswith("-NLS"):
        assert options.line_search == "none"
    if name.endswith("-GP") or name == "NSN-FB":
        assert options.line_search == "Goldstein-Price"


def test_references() -> None:
    values = deque([4.0, 1.0, 2.0, 3.0], maxlen=4)
    assert REFERENCES["none"](values) == 3 and REFERENCES["maximum"](values) == 4 and REFERENCES["mean"](values) == 2.5
    # Zhang and Hager 2004: Q' = eta Q + 1, C' = (eta Q C + f) / Q'
    Q, C = 1.0, 4.0
    for f in (1.0, 2.0, 3.0):
        Q, C = 0.85 * Q + 1, (0.85 * Q * C + f) / (0.85 * Q + 1)
    assert_allclose(REFERENCES["Zhang-Hager"](values), C)


def test_a_reference_above_the_merit_allows_it_to_rise() -> None:
    """merit(1) = 1.5 lies above merit(0) = 1 but below the reference 2: the full step is taken, and never one that is too short."""

    def merit(t: float) -> float:
        return 1 - 2 * t + 2.5 * t**2

    for search in (armijo, goldstein):
        assert search(merit, 1.0, -2.0, reference=2.0) == 1
        t = search(merit, 1.0, -2.0)
        assert t < 1 and merit(t) < 1
    assert goldstein(merit, 1.0, -2.0, reference=1e9) >= 1


def test_searches_end_where_nothing_descends() -> None:
    """Along an ascent no step helps: the searches return a tiny one, and Newton says that it stagnates."""
    calls = 0

    def merit(t: float) -> float:
        nonlocal calls
        calls += 1
        return 1 + t

    for search in (armijo, goldstein):
        calls = 0
        assert search(merit, 1.0, -1.0) < 1e-15
        assert calls <= 60
    assert armijo(merit, 1.0, -1.0, 3) == 0.125


class _Singular(LocalSpace):
    """A Newton system that never has a solution."""

    def step(self, A: np.ndarray, B: np.ndarray, F: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        raise SingularMatrix("on purpose")


def test_gradient_steps_replace_newtons() -> None:
    p = random_problem(3)
    for safeguard, status in ((False, Status.SINGULAR), (True, Status.MAX_ITERATIONS)):
        options = NewtonOptions(line_search="Armijo", safeguard=safeguard, max_iterations=50)
        monitor = Monitor(p.q, p.mu, 3, 1e-12)
        r = np.zeros(30)
        iterate = newton_iterations(_Singular(DenseSystem(Delassus(p.W, 3)), p.q, r), r, p.diagonal_blocks, p.mu, monitor, options)
        assert iterate.status is status
    assert monitor.best < 0.3 * monitor.history[0][2]  # steepest descent alone comes closer


def test_gradient_is_the_merits() -> None:
    """The direction of steepest descent and its length against finite differences of 0.5 ||F||^2."""
    p, rng = random_problem(4), np.random.default_rng(0)
    r, rho = rng.standard_normal(30), np.full((10, 3), 0.4)
    space = LocalSpace(DenseSystem(Delassus(p.W, p.dimension)), p.q, r)

    def merit(r: np.ndarray) -> float:
        F = FORMULATIONS["AC"]((p.W @ r + p.q).reshape(10, 3), r.reshape(10, 3), p.mu, rho)[0]
        return 0.5 * float(np.sum(F * F))

    F, A, B = FORMULATIONS["AC"](space.u.reshape(10, 3), r.reshape(10, 3), p.mu, rho)
    dr, du = space.gradient(A, B, F)
    numeric = np.array([(merit(r + e) - merit(r - e)) / 2e-6 for e in 1e-6 * np.eye(30)])
    assert_allclose(dr / np.linalg.norm(dr), -numeric / np.linalg.norm(numeric), atol=1e-6)
    assert_allclose(du, p.W @ dr, atol=1e-12)
    J = np.einsum("aij,ajk->aik", A, p.W.reshape(10, 3, 30)).reshape(30, 30)
    for a in range(10):
        J[3 * a : 3 * a + 3, 3 * a : 3 * a + 3] += B[a]
    assert_allclose(J.T @ (J @ dr + F.ravel()) @ dr, 0, atol=1e-9)  # the minimum of the linear model along dr


@pytest.mark.parametrize("name", ["NSN-FB", "NSN-AC-GP", "NSN-JM-GP", "NSN-NM-GP"])
def test_line_search_on_the_global_form_takes_the_same_steps(name: str) -> None:
    rng = np.random.default_rng(5)
    X, H = rng.standard_normal((24, 24)), rng.standard_normal((24, 18))
    p = GlobalProblem(X @ X.T + 24 * np.eye(24), H, -H[:, ::3].sum(axis=1) + rng.standard_normal(24), np.zeros(18), np.full(6, 0.4))
    local, kkt = (solve(p, name, tol=1e-9, linear=linear) for linear in ("dense", "kkt"))
    assert local.solved and kkt.solved
    assert_allclose(kkt.r, local.r, atol=1e-7)
    if name == "NSN-NM-GP":
        return  # its derivative by u_T of a sticking contact, u_T = 0 up to round-off, is one of many
    assert_allclose([row[2] for row in kkt.history], [row[2] for row in local.history], rtol=1e-3, atol=1e-10)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"line_search_iterations": 0}, "line_search_iterations: expected an integer >= 1"),
        ({"window": 0}, "window: expected an integer >= 1"),
        ({"reference": "median"}, "reference: expected one of 'none', 'maximum', 'mean', 'Zhang-Hager'"),
    ],
)
def test_bad_options_are_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        solve(random_problem(0), "NSN-AC", **options)


def test_fischer_burmeister_on_a_hyperstatic_problem() -> None:
    """Rank 12 of 36: where AC's systems are singular, FB's are not always; an answer is an answer."""
    rng = np.random.default_rng(6)
    H = rng.standard_normal((12, 36))
    H[:, ::3] = np.abs(H[:, ::3])
    p = LocalProblem(H.T @ H, H.T @ -np.abs(rng.standard_normal(12)), np.full(12, 0.4))
    options = NewtonOptions(formulation="FB", rho="spectral norm")
    monitor = Monitor(p.q, p.mu, 3, 1e-8)
    iterate = newton(p, np.zeros(36), monitor, options)
    assert iterate.status.solved == (true_error(p, iterate.r) <= 1e-8)


def test_patience() -> None:
    """A run that cycles ends after `patience` iterations without a better error; one that converges is not touched by it."""
    cycling = random_problem(1, mu=5.0)
    options = NewtonOptions(rho="constant", rho_factor=100.0)
    endless, watched = (
        solve(cycling, "NSN-AC-NLS", tol=1e-10, rho=options.rho, rho_factor=options.rho_factor, patience=patience) for patience in (0, 10)
    )
    assert endless.status is Status.MAX_ITERATIONS
    assert watched.status is Status.STAGNATED
    assert watched.iterations % 10 == 0
    assert 0 < watched.iterations < 100
    easy = random_problem(0)
    without, within = (solve(easy, "NSN-AC", tol=1e-10, patience=patience) for patience in (0, 3))
    assert without.solved
    assert_allclose(within.r, without.r, atol=0)


def test_longest() -> None:
    """A step that only round-off says the length of is not taken: three equal contacts share the load, W has rank one (a table's legs).
    With W regular the shorter steps are taken as without."""
    W, q = np.kron(np.ones((3, 3)), np.eye(3)) + 1e-15 * np.diag(np.arange(1.0, 10.0)), np.tile([-1.0, 0.0, 0.0], 3)
    legs, start = LocalProblem(W, q, np.full(3, 0.5)), np.tile([1 / 3, 0.0, 0.0], 3)
    start[0] += 1e-9
    far, bounded = (solve(legs, "NSN-AC", r=start, tol=1e-12, longest=longest) for longest in (float("inf"), 1e6))
    assert np.abs(far.r - start).max() > 1e-3  # as good an answer, and any other
    assert bounded.status is Status.SINGULAR
    assert_allclose(bounded.r, start, atol=0)
    easy = random_problem(0)
    without, within = (solve(easy, "NSN-AC", tol=1e-10, longest=longest) for longest in (float("inf"), 1e6))
    assert without.solved
    assert_allclose(within.r, without.r, atol=0)
    with pytest.raises(InputError, match="longest: expected a number > 1, got 1"):
        NewtonOptions(longest=1.0)


def test_adapted_rho_is_kept_from_a_solution() -> None:
    """What a simulation keeps: the next solve begins with the adapted rho, on another path to the same answer; a failed one leaves none."""
    p = random_problem(3, nc=30)
    first = solve(p, "NSN-AC", tol=1e-10, rho_factor=50.0, memory=Memory.of(np.arange(30)))
    assert first.solved
    assert first.memory is not None
    kept = first.memory.earlier(AdaptedRho)
    assert kept is not None
    assert kept.rho.shape == (30, 3)
    again = solve(p, "NSN-AC", tol=1e-10, rho_factor=50.0, memory=first.memory)
    assert again.solved
    assert again.iterations != first.iterations
    assert_allclose(again.r, first.r, rtol=0, atol=1e-7 * np.abs(first.r).max())
    failed = solve(p, "NSN-AC", tol=1e-10, max_iterations=1, memory=first.memory)
    assert not failed.solved
    assert failed.memory is not None
    assert failed.memory.earlier(AdaptedRho) is None


class _Drifting(LocalSpace):
    """Steps whose du is not W dr: u of the iterates drifts towards what looks like a solution."""

    def step(self, A: np.ndarray, B: np.ndarray, F: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        dr, du = super().step(A, B, F)
        self._dr = dr + 1e-3 * np.abs(dr).max()
        return self._dr, du


def test_nothing_is_accepted_on_a_velocity_that_drifted() -> None:
    for seed in range(5):
        p, options = random_problem(seed), NewtonOptions(max_iterations=30)
        monitor = Monitor(p.q, p.mu, 3, 1e-6)
        r = np.zeros(30)
        iterate = newton_iterations(_Drifting(DenseSystem(Delassus(p.W, 3)), p.q, r), r, p.diagonal_blocks, p.mu, monitor, options)
        assert iterate.status.solved == (true_error(p, iterate.r) <= 1e-6)


@pytest.mark.parametrize("contact_order", [[0, 1, 2, 3, 4, 5], [3, 5, 0, 2, 1, 4]])
def test_the_first_step_has_the_last_solutions_statuses(contact_order: list[int]) -> None:
    """All contacts stick, so that Newton's equations are linear: one step solves them from any r whose statuses are known to be sticking.

    u = W r + q at an r that is off where W is stiff calls some of them sliding or open. Contacts are matched by their numbers, new ones
    begin with their own u."""
    rng = np.random.default_rng(5)
    H = rng.standard_normal((18, 18))
    W, r = 1e3 * (H.T @ H) + np.eye(18), np.tile([4.0, 1.0, 0.0], 6)
    first = LocalProblem(W, -W @ r, np.full(6, 0.5))
    memory = solve(first, "NSN-AC", memory=Memory.of(np.arange(6)), tol=1e-10).memory
    assert memory is not None
    order, dofs = np.array(contact_order), (3 * np.array(contact_order)[:, None] + np.arange(3)).ravel()
    following = LocalProblem(W[np.ix_(dofs, dofs)], -1.2 * (W @ r)[dofs], np.full(6, 0.5))
    stiff = np.linalg.eigh(W)[1][:, -1]
    start = (1.2 * r + 2.5 * stiff)[dofs]
    cold = solve(following, "NSN-AC", start, memory=Memory.of(order), tol=1e-9)
    warm = solve(following, "NSN-AC", start, memory=memory.follow(order), tol=1e-9)
    assert warm.solved and warm.iterations == 1 < cold.iterations
    assert_allclose(warm.r, 1.2 * r[dofs], atol=1e-6)
    unknown = solve(following, "NSN-AC", start, memory=memory.follow(order + 100), tol=1e-9)
    assert unknown.solved and unknown.iterations == cold.iterations


def test_from_zero_the_last_velocities_are_not_looked_at() -> None:
    p, memory = random_problem(3), Memory.of(np.arange(10))
    solved = solve(p, "NSN-AC", memory=memory, tol=1e-10)
    assert solved.memory is not None
    without = solved.memory.without(AdaptedRho)
    again = solve(p, "NSN-AC", np.zeros(30), memory=without, tol=1e-10)
    assert again.solved and again.iterations == solved.iterations
