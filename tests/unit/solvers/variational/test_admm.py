"""ADMM: answers, every option, both forms, the number of factorisations."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
from numpy.testing import assert_allclose

from fcsim.errors import InputError
from fcsim.problem import Delassus, GlobalProblem, LocalProblem
from fcsim.problem.reduction import reduce
from fcsim.solvers import Memory, Status, solve
from fcsim.solvers.base import Monitor
from fcsim.solvers.variational.admm import AdmmOptions, split
from fcsim.solvers.variational.convex_sets import Cone
from fcsim.solvers.variational.inequality import Inequality
from fcsim.solvers.variational.splittings import LocalSplitting, SplittingFactor
from fcsim.solvers.variational.watches import ProblemWatch, SubproblemWatch

Problems = dict[str, Callable[[], LocalProblem]]
OPTIONS: list[dict[str, Any]] = [
    {},
    {"initial_rho": "given"},
    {"initial_rho": "norm"},
    {"rho_update": "constant"},
    {"rho_update": "residual balancing"},
    {"relaxation": 1.6},
    {"relaxation": 0.7, "acceleration": "none"},
    {"acceleration": "none"},
    {"acceleration": "accelerated with restart", "restart_eta": 0.5},
    {"rescaling": "scalar"},
    {"rescaling": "contacts"},
    {"symmetry": "assume"},
    {"symmetry": "symmetrise"},
    {"symmetry": "unsymmetric"},
]


def test_answers(coulomb_problem: LocalProblem, error_of: Callable[..., float]) -> None:
    result = solve(coulomb_problem, "ADMM", tol=1e-10)
    assert result.status is Status.SOLVED
    assert error_of(coulomb_problem, result.r) <= 1.001e-10 + 1e-15
    assert_allclose(result.u, solve(coulomb_problem, "NSGS-AC", tol=1e-11).u, atol=1e-8)
    assert np.all(result.checks.cone < 1e-14)  # the answer is a projection


@pytest.mark.parametrize("options", OPTIONS, ids=str)
@pytest.mark.parametrize("name", ["full rank", "full rank, 2D", "sparse", "hyperstatic"])
def test_options(name: str, options: dict[str, Any], coulomb_problems: Problems, error_of: Callable[..., float]) -> None:
    problem = coulomb_problems[name]()
    result = solve(problem, "ADMM", tol=1e-9, **options)
    assert result.solved and error_of(problem, result.r) <= 1.001e-9


def test_symmetrised_operator_solves_another_problem(coulomb_problems: Problems) -> None:
    """Dropping the skew part of W leaves an error, which the status admits."""
    problem = coulomb_problems["unsymmetric"]()
    for symmetry, solved in (("check", True), ("unsymmetric", True), ("symmetrise", False)):
        assert solve(problem, "ADMM", symmetry=symmetry, max_iterations=500).solved is solved


def test_units(coulomb_problems: Problems) -> None:
    problem = coulomb_problems["full rank"]()
    expected = solve(problem, "ADMM", tol=1e-12)
    for mass in (1e-5, 1e5):
        scaled = solve(LocalProblem(problem.W / mass, problem.q, problem.mu), "ADMM", tol=1e-9 if mass > 1 else 1e-13)
        assert scaled.solved and scaled.iterations < 3 * expected.iterations
        assert_allclose(scaled.r / mass, expected.r, atol=1e-7)


@pytest.mark.parametrize("sparse", [False, True])
def test_one_factorisation_for_each_rho(sparse: bool, coulomb_problems: Problems, monkeypatch: pytest.MonkeyPatch) -> None:
    problem = coulomb_problems["sparse" if sparse else "full rank"]()
    shifts: list[float] = []
    factor = Delassus.factor
    monkeypatch.setattr(Delassus, "factor", lambda self, rho, *, symmetric: shifts.append(rho) or factor(self, rho, symmetric=symmetric))
    assert solve(problem, "ADMM", initial_rho="given", rho=1.0, rho_update="constant").solved
    assert shifts == [1.0]
    shifts.clear()
    assert solve(problem, "ADMM", initial_rho="given", rho=1e3, balancing_interval=5).solved
    assert shifts[0] == 1e3 and len(shifts) == len(set(shifts)) > 1
    powers = np.log(np.array(shifts) / 1e3) / np.log(5)
    assert_allclose(powers, np.round(powers), atol=1e-9)


def test_a_bad_rho_is_balanced_away(coulomb_problems: Problems) -> None:
    problem = coulomb_problems["full rank"]()
    for rho in (1e-4, 1e4):
        constant = solve(problem, "ADMM", initial_rho="given", rho=rho, rho_update="constant", max_iterations=3000)
        balanced = solve(problem, "ADMM", initial_rho="given", rho=rho)
        assert balanced.solved and balanced.iterations < constant.iterations / 2


@pytest.mark.parametrize("initial_rho", ["given", "norm", "eigenvalues"])
def test_global_form(initial_rho: str, global_problem: GlobalProblem) -> None:
    expected = solve(global_problem, "NSN-AC", tol=1e-12)
    for problem in (global_problem, reduce(global_problem)):
        result = solve(problem, "ADMM", linear="kkt", initial_rho=initial_rho, tol=1e-11)
        assert result.solved and expected.solved
        assert_allclose(result.r, expected.r, atol=1e-8)
        assert result.v is not None and global_problem.b is not None
        assert_allclose(global_problem.G.T @ result.v, -global_problem.b, atol=1e-12)
        assert result.checks.momentum is not None and result.checks.momentum < 1e-12


def test_global_form_does_not_form_the_delassus_operator(global_problem: GlobalProblem, monkeypatch: pytest.MonkeyPatch) -> None:
    reduction = reduce(global_problem)
    monkeypatch.setattr(type(reduction), "local", property(lambda self: pytest.fail("W was formed")))
    assert solve(reduction, "ADMM", linear="kkt").solved


def test_warm_start_and_limits(coulomb_problems: Problems, global_problem: GlobalProblem) -> None:
    problem = coulomb_problems["full rank"]()
    cold = solve(problem, "ADMM", tol=1e-9)
    assert solve(problem, "ADMM", r=cold.r).iterations == 0
    assert solve(problem, "ADMM", r=1.0001 * cold.r).iterations <= cold.iterations
    for limited, options in ((problem, {}), (global_problem, {"linear": "kkt"})):
        assert solve(limited, "ADMM", tol=1e-13, max_iterations=2, **options).status is Status.MAX_ITERATIONS
        assert solve(limited, "ADMM", tol=1e-13, time_limit=0.0, **options).status is Status.TIME_LIMIT


def test_singular_shift_is_a_status(coulomb_problems: Problems) -> None:
    problem = coulomb_problems["sticking block"]()
    negative = LocalProblem(-0.5 * np.eye(3), problem.q, problem.mu)
    assert solve(negative, "ADMM", initial_rho="given", rho=0.5, symmetry="unsymmetric").status in (Status.SINGULAR, Status.DIVERGED)


def test_convex_program(coulomb_problems: Problems) -> None:
    """Without De Saxcé's term: the KKT conditions of the second-order cone program in NumPy."""
    problem = coulomb_problems["full rank"]()
    vi = Inequality(Delassus(problem.W, 3), problem.q, Cone(problem.mu))
    watch = SubproblemWatch(vi, Monitor(problem.q, problem.mu, 3, 1e-8), 1e-10, 5000)
    iterate = split(vi, np.zeros(problem.m), watch, AdmmOptions())
    assert iterate.status is Status.SOLVED
    r, u = iterate.r.reshape(-1, 3), (problem.W @ iterate.r + problem.q).reshape(-1, 3)
    assert np.all(np.linalg.norm(r[:, 1:], axis=1) <= problem.mu * r[:, 0] + 1e-9)
    assert np.all(problem.mu * np.linalg.norm(u[:, 1:], axis=1) <= u[:, 0] + 1e-9)
    assert_allclose(np.sum(r * u, axis=1), 0, atol=1e-9)


@pytest.mark.parametrize("name", ["full rank", "full rank, 2D", "hyperstatic"])
def test_the_speed_that_is_told_is_that_of_the_answer(name: str, coulomb_problems: Problems) -> None:
    """||u + g(u)|| with u = W r + q, r by Gauss-Seidel."""
    problem = coulomb_problems[name]()
    vi = Inequality.coulomb(problem)
    watch = ProblemWatch(vi.velocity, Monitor(problem.q, problem.mu, problem.dimension, 1e-10), 20_000)
    assert split(vi, np.zeros(problem.m), watch, AdmmOptions()).status is Status.SOLVED
    u = (problem.W @ solve(problem, "NSGS-AC", tol=1e-10).r + problem.q).reshape(problem.nc, -1)
    u[:, 0] += problem.mu * np.linalg.norm(u[:, 1:], axis=1)
    assert watch.speed == pytest.approx(np.linalg.norm(u), rel=1e-6, abs=1e-6 * np.linalg.norm(problem.q))


def test_shared_operator_keeps_its_factors(coulomb_problems: Problems) -> None:
    problem = coulomb_problems["full rank"]()
    vi = Inequality.coulomb(problem)
    first = vi.factor(0.5, True)
    assert vi.factor(0.5, True) is first
    split(vi, np.zeros(problem.m), ProblemWatch(vi.velocity, Monitor(problem.q, problem.mu, 3, 1e-8), 100), AdmmOptions(rho=2.0))
    assert vi.factor(0.5, True) is first or len(vi.factors._made) <= 4


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("kind", ["csr", "csc", "bsr", "bsr without a diagonal block"])
@pytest.mark.parametrize("definite", [True, False])
def test_factor_of_a_sparse_operator(definite: bool, kind: str, d: int) -> None:
    """(W + rho I)^-1 whatever the storage, also where W + rho I is indefinite and Cholesky's factorisation must give way."""
    nc, rng = 12, np.random.default_rng(3)
    coupled = np.triu(rng.random((nc, nc)) < 0.2) | np.eye(nc, dtype=bool)
    coupled[4] = coupled[:, 4] = False  # a contact without compliance of its own
    W = rng.standard_normal((nc * d, nc * d)) * np.kron(coupled | coupled.T, np.ones((d, d)))
    W = W + W.T
    rho = 1.5 * float(-np.linalg.eigvalsh(W)[0]) if definite else 0.3
    given = {"csr": sp.csr_array, "csc": sp.csc_array}.get(kind, lambda W: sp.bsr_array(W, blocksize=(d, d)))(W)
    if kind == "bsr":
        given = given + sp.bsr_array(np.zeros_like(W) + np.kron(np.eye(nc), np.ones((d, d))), blocksize=(d, d))
        given.data[np.repeat(np.arange(nc), np.diff(given.indptr)) == given.indices] -= 1
    factor = Delassus(given, d).factor(rho, symmetric=True)
    assert ("Cholesky" in factor.name) is definite
    b = rng.standard_normal(nc * d)
    assert_allclose(factor.solve(b), np.linalg.solve(W + rho * np.eye(nc * d), b), rtol=1e-9)


def test_sparse_matrix_stays_sparse(coulomb_problems: Problems, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fcsim.linear.storage.BLOCK_UP_TO", 0)
    for cls in (sp.csr_array, sp.bsr_array):
        monkeypatch.setattr(cls, "toarray", lambda *a, **k: pytest.fail("a sparse W was made dense"))
    assert solve(coulomb_problems["sparse"](), "ADMM").solved


@pytest.mark.parametrize(
    "options",
    [
        {"rho": 0.0},
        {"relaxation": 2.0},
        {"restart_eta": 1.0},
        {"balancing_factor": 1.0},
        {"balancing_ratio": 0.5},
        {"balancing_interval": 0},
        {"initial_rho": "spectral"},
        {"rho_update": "always"},
        {"acceleration": "fast"},
        {"symmetry": "maybe"},
        {"rescaling": "rows"},
        {"linear": "dense"},
    ],
    ids=str,
)
def test_refused_options(options: dict[str, Any], coulomb_problems: Problems) -> None:
    with pytest.raises(InputError):
        solve(coulomb_problems["full rank"](), "ADMM", **options)


def test_rescaling_needs_the_local_form(global_problem: GlobalProblem) -> None:
    with pytest.raises(InputError, match="rescaling"):
        solve(global_problem, "ADMM", linear="kkt", rescaling="contacts")


@pytest.mark.parametrize("storage", ["dense", "block rows"])
def test_factor_of_an_earlier_operator(storage: str) -> None:
    """What a simulation keeps: for a W that changed little the factor serves again and the answer is that W's; for another it does not."""
    rng = np.random.default_rng(4)
    nc, d = 12, 3
    H = rng.standard_normal((nc * d + 5, nc * d)) / 6
    W, q = H.T @ H + 0.1 * np.eye(nc * d), rng.standard_normal(nc * d)
    change = rng.standard_normal(W.shape)
    near = W + 1e-3 * (change + change.T) / nc
    options = {"initial_rho": "norm", "rho": 0.05, "rho_update": "constant", "max_iterations": 3000}
    memory: Memory | None = Memory.of(np.arange(nc))

    def solved(W: np.ndarray, memory: Memory | None) -> tuple[np.ndarray, Memory | None]:
        stored = W if storage == "dense" else sp.bsr_array(W, blocksize=(d, d))
        result = solve(LocalProblem(stored, q, np.full(nc, 0.4), dimension=d), "ADMM", tol=1e-9, memory=memory, **options)
        assert result.solved
        return result.r, result.memory

    def factor(memory: Memory | None) -> object:
        assert memory is not None
        kept = memory.earlier(SplittingFactor)
        assert kept is not None
        return kept.factor

    _, memory = solved(W, memory)
    first = factor(memory)
    r, memory = solved(near, memory)
    assert_allclose(r, solved(near, None)[0], rtol=0, atol=1e-6)
    assert factor(memory) is first
    assert memory is not None
    _, turned = solved(near, memory.follow(np.arange(nc)[::-1]))  # the same shape, other contacts: another factor
    assert factor(turned) is not first
    soft = np.linalg.eigh(W)[1][:, 0]
    other = W + 0.5 * np.linalg.norm(W, 2) * np.outer(soft, soft)  # of the same norm
    r, memory = solved(other, memory)
    assert_allclose(r, solved(other, None)[0], rtol=0, atol=1e-6)
    assert factor(memory) is not first


def test_the_spectral_update_changes_rho_by_powers_of_the_condition(coulomb_problems: Problems, monkeypatch: pytest.MonkeyPatch) -> None:
    """rho = sqrt(L m) (L / m)^p, p from 0 by steps of the power (Carpentier, Le Lidec, Montaut 2024), L and m the eigenvalues of W."""
    p = coulomb_problems["full rank"]()
    eigenvalues = np.linalg.eigvalsh(p.W)
    seen, set_rho = [], LocalSplitting.set_rho
    monkeypatch.setattr(LocalSplitting, "set_rho", lambda self, rho: (seen.append(rho), set_rho(self, rho))[1])
    result = solve(p, "ADMM-SPECTRAL", tol=1e-10, initial_rho="given", rho=1e3 * eigenvalues[-1], spectral_power=0.25, balancing_interval=3)
    assert result.solved and len(seen) > 2
    steps = np.diff(np.log(seen)) / np.log(eigenvalues[-1] / eigenvalues[0])
    assert_allclose(np.abs(steps), 0.25, rtol=0.05)  # the eigenvalues are estimates within a few per cent


def test_the_spectral_update_needs_the_local_form(global_problem: GlobalProblem) -> None:
    with pytest.raises(InputError, match="rho_update"):
        solve(global_problem, "ADMM", linear="kkt", rho_update="spectral")
    with pytest.raises(InputError, match="the local form alone"):
        solve(global_problem, "ADMM-SPECTRAL", linear="kkt")
    with pytest.raises(InputError, match="spectral_power"):
        solve(global_problem, "ADMM-SPECTRAL", spectral_power=1.0)


def test_the_proximal_term_holds_x_to_the_last_one(coulomb_problems: Problems, global_problem: GlobalProblem) -> None:
    """(W + (rho + eta) I) x = rho a + eta x_before - q - g, as published; the spectral update counts with eta where that is above the least
    eigenvalue; the answer stays the problem's."""
    p = coulomb_problems["full rank"]()
    L, rng = float(np.linalg.norm(p.W, 2)), np.random.default_rng(0)
    rho, eta = 0.7 * L, 0.2 * L
    splitting = LocalSplitting(Inequality.coulomb(p), True, eta=eta)
    splitting.set_rho(rho)
    x, _ = splitting.start(rng.standard_normal(p.m))
    for _ in range(3):
        a, g = rng.standard_normal((2, p.m))
        expected = np.linalg.solve(p.W + (rho + eta) * np.eye(p.m), rho * a + eta * x - p.q - g)
        found = splitting.linear(a, g)
        assert_allclose(found, expected, rtol=0, atol=1e-12 * np.abs(expected).max())
        assert_allclose(splitting.moved, eta * np.linalg.norm(expected - x), rtol=1e-10)
        x = expected
    assert_allclose(splitting.condition, L / eta, rtol=0.05)
    plain, held = (solve(p, "ADMM-SPECTRAL", tol=1e-10, proximal=share) for share in (0.0, 0.2))
    assert plain.solved and held.solved
    assert_allclose(held.u, plain.u, atol=1e-8 * np.abs(p.q).max())
    with pytest.raises(InputError, match="proximal"):
        solve(global_problem, "ADMM", linear="kkt", proximal=1e-6)
    with pytest.raises(InputError, match="proximal"):
        solve(p, "ADMM", proximal=-1e-6)
