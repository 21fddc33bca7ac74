"""Gauss-Seidel on reactions and on velocities: one sweep beside its NumPy twin, what every option does, every kind of problem."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
from numpy.testing import assert_allclose, assert_array_equal

from fcsim.errors import InputError
from fcsim.linear._block_rows_kernels import product
from fcsim.linear.block_rows import block_rows
from fcsim.linear.sparse.short_indices import with_short_indices
from fcsim.problem import LocalProblem
from fcsim.solvers import SOLVERS, Status, solve
from fcsim.solvers.gauss_seidel.one_contact import ONE_CONTACT
from fcsim.solvers.gauss_seidel.sweeps import GaussSeidelOptions, contact_order, local_tolerance
from fcsim.solvers.newton.formulations import alart_curnier

NSGS = [name for name, method in SOLVERS.items() if isinstance(method.options, GaussSeidelOptions) and 3 in method.dimensions]
SWEEPING = [*NSGS, "NSGSV"]


def random_problem(
    seed: int, nc: int = 12, d: int = 3, friction: float = 0.5, unsymmetric: float = 0.0, rank: int | None = None
) -> LocalProblem:
    rng = np.random.default_rng(seed)
    H = rng.standard_normal((d * nc + 10 if rank is None else rank, d * nc)) / np.sqrt(d * nc)
    if rank is not None:
        H[:, ::d] = np.abs(H[:, ::d])
    W = H.T @ H + (0.2 * np.eye(d * nc) if rank is None else 0)
    W = W + unsymmetric * rng.standard_normal(W.shape)
    q = rng.standard_normal((nc, d)) - np.eye(d)[0] if rank is None else (-H.T @ np.abs(rng.standard_normal(rank))).reshape(nc, d)
    return LocalProblem(W, q.ravel(), rng.uniform(0.3, 1, nc) * friction, dimension=d)


def sparse_problem(seed: int, nc: int = 15) -> LocalProblem:
    rng = np.random.default_rng(seed)
    pattern = np.kron(rng.random((2 * nc, nc)) < 0.15, np.ones((3, 3)))
    H = 0.5 * rng.standard_normal(pattern.shape) * pattern
    W = sp.bsr_array(sp.csr_array(H.T @ H + 0.3 * np.eye(3 * nc)), blocksize=(3, 3))
    return LocalProblem(W, rng.standard_normal(3 * nc) - np.tile([1.0, 0, 0], nc), rng.uniform(0.1, 0.5, nc))


def one_contact_twin(W: np.ndarray, q: np.ndarray, mu: float, rho: np.ndarray, r: np.ndarray) -> np.ndarray:
    for _ in range(50):
        F, A, B = (x[0] for x in alart_curnier((W @ r + q)[None], r[None], np.array([mu]), rho[None]))
        if np.linalg.norm(F) <= 1e-13:
            return r
        r = r - np.linalg.solve(A @ W + B, F)
    raise AssertionError("the twin did not converge")


class Sweeping:
    """One system with everything that the compiled sweep takes."""

    def __init__(self, seed: int = 2, storage: str = "dense") -> None:
        rng = np.random.default_rng(seed)
        nc = 8
        H = 0.4 * rng.standard_normal((30, 3 * nc)) * np.kron(rng.random((30, nc)) < 0.5, np.ones(3))
        self.nc, self.W = nc, H.T @ H + np.eye(3 * nc)
        self.q, self.mu = 2 * rng.standard_normal((nc, 3)), rng.uniform(0, 0.5, nc)
        self.diagonal = np.array([self.W[3 * a : 3 * a + 3, 3 * a : 3 * a + 3] for a in range(nc)])
        self.rho = np.array([[1 / D[0, 0], 1 / np.linalg.eigvalsh(D[1:, 1:])[-1]] for D in self.diagonal])
        self.start, self.order = np.abs(rng.standard_normal((nc, 3))), rng.permutation(nc)
        self.rows = block_rows(self.W if storage == "dense" else sp.bsr_array(self.W, blocksize=(3, 3)), 3)
        self.frozen = np.zeros(nc, dtype=np.int64)

    def __call__(
        self, name: str = "AC", shift: float = 0.0, rho: float = 1.0, filtered: bool = False, **given: Any
    ) -> tuple[np.ndarray, tuple]:
        r = given.pop("r", self.start).copy()
        own = self.diagonal + shift * np.eye(3)
        numbers = (
            1e-14,
            50,
            given.pop("relaxation", 1.0),
            filtered,
            given.pop("freezing", 0),
            given.pop("settled", 0.0),
            given.pop("sweeps", 1),
            given.pop("enough", 0.0),
        )
        assert not given
        told = ONE_CONTACT[name].sweep(
            *(*self.rows, own, np.full(self.nc, shift), self.q, self.mu, rho * self.rho, self.order, r, self.frozen), *numbers
        )
        return r, told

    def expected(self, shift: float = 0.0, relaxation: float = 1.0) -> np.ndarray:
        r = self.start.copy()
        for a in self.order:
            own = slice(3 * a, 3 * a + 3)
            D = self.diagonal[a] + shift * np.eye(3)
            others = self.W[own] @ r.ravel() - self.diagonal[a] @ r[a] + self.q[a] - shift * r[a]
            new = one_contact_twin(D, others, self.mu[a], np.r_[self.rho[a], self.rho[a, 1]], r[a])
            r[a] += relaxation * (new - r[a])
        return r


@pytest.mark.parametrize("storage", ["dense", "block sparse"])
@pytest.mark.parametrize("name", ["AC", "JM", "AC-GP", "AC-GP-HYBRID", "EXACT", "NCP-FB", "NCP-FP"])
def test_one_sweep(name: str, storage: str) -> None:
    sweeping = Sweeping(storage=storage)
    r, (change, size, failures, _) = sweeping(name)
    assert_allclose(r, sweeping.expected(), atol=1e-10)
    assert_allclose(change, np.sum((r - sweeping.start) ** 2))
    assert_allclose(size, np.sum(r**2))
    assert failures <= sweeping.nc


def test_sweeps_in_one_call() -> None:
    """Seven sweeps at once are seven sweeps, and one that changes little enough is the last."""
    sweeping = Sweeping()
    r = sweeping.start
    changes = []
    for _ in range(7):
        r, (change, size, _, done) = sweeping(r=r)
        changes.append(np.sqrt(change / size))
        assert done == 1
    together, (*_, done) = sweeping(sweeps=7)
    assert done == 7
    assert_array_equal(together, r)
    assert changes[3] < min(changes[:3])
    *_, (*_, done) = sweeping(sweeps=7, enough=0.5 * (changes[2] + changes[3]))
    assert done == 4


@pytest.mark.parametrize("relaxation", [0.7, 1.5])
def test_relaxation_of_a_sweep(relaxation: float) -> None:
    sweeping = Sweeping()
    assert_allclose(sweeping(relaxation=relaxation)[0], sweeping.expected(relaxation=relaxation), atol=1e-10)


def test_regularisation_of_a_sweep() -> None:
    """Each contact makes a proximal step with W_aa + alpha I."""
    sweeping = Sweeping()
    assert_allclose(sweeping(shift=0.8)[0], sweeping.expected(shift=0.8), atol=1e-10)


def test_filter_keeps_what_was_better() -> None:
    """A projection with rho far too long makes contacts worse; filtered, no contact is worse off after its visit."""
    sweeping = Sweeping()
    solution = sweeping.start
    for _ in range(60):
        solution, _ = sweeping(r=solution)
    assert np.abs(sweeping("FP-DS-ONE", rho=20.0, r=1.01 * solution)[0] - solution).max() > 0.05
    filtered, _ = sweeping("FP-DS-ONE", rho=20.0, r=1.01 * solution, filtered=True)
    assert np.abs(filtered - solution).max() <= 0.02 * np.abs(solution).max()
    broken = sweeping("FP-DS-ONE", rho=np.nan, r=solution)[0]
    assert not np.all(np.isfinite(broken))
    assert_allclose(sweeping("FP-DS-ONE", rho=np.nan, r=solution, filtered=True)[0], solution, atol=0)


def test_frozen_contacts_are_left_out() -> None:
    sweeping = Sweeping()
    moved = np.linalg.norm(sweeping()[0] - sweeping.start, axis=1)
    settled = float(np.median(moved))
    r, _ = sweeping(freezing=3, settled=settled)
    assert_allclose(sweeping.frozen, np.where(moved <= settled, 3, 0))
    asleep = sweeping.frozen > 0
    again, _ = sweeping(freezing=3, r=r)
    assert_allclose(again[asleep], r[asleep], atol=0)
    assert np.abs(again[~asleep] - r[~asleep]).max() > 0
    assert_allclose(sweeping.frozen[asleep], 2)


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("storage", ["dense", "csr", "csc", "coo", "bsr", "scalar bsr"])
def test_block_rows(storage: str, d: int) -> None:
    rng = np.random.default_rng(3)
    nc = 5
    pattern = (rng.random((nc, nc)) < 0.4) | np.eye(nc, dtype=bool)
    W = rng.standard_normal((nc * d, nc * d)) * np.kron(pattern, np.ones((d, d)))
    W[:d, :d] = 0  # a contact without compliance of its own keeps its block
    sparse = {"csr": sp.csr_array, "csc": sp.csc_array, "coo": sp.coo_array, "scalar bsr": lambda W: sp.bsr_array(W, blocksize=(1, 1))}
    given = W if storage == "dense" else sparse.get(storage, lambda W: sp.bsr_array(W, blocksize=(d, d)))(W)
    indptr, indices, blocks = block_rows(given, d)
    if storage not in ("bsr", "scalar bsr"):
        assert len(blocks) == pattern.sum()
        assert all(np.all(np.diff(indices[b:e]) > 0) for b, e in pairwise(indptr))  # sorted
    back = sp.bsr_array((blocks, indices, indptr), shape=(3 * nc, 3 * nc)).toarray().reshape(nc, 3, nc, 3)
    assert_allclose(back[:, :d, :, :d].reshape(nc * d, nc * d), W, atol=0)
    x, y = rng.standard_normal((2, nc, 3))
    assert_allclose(product(indptr, indices, blocks, y, x).ravel(), back.reshape(3 * nc, 3 * nc) @ x.ravel() + y.ravel(), atol=1e-13)
    if d == 2 and storage == "dense":  # the added tangent is coupled to nothing
        assert_allclose(back[:, 2, :, 2], np.eye(nc), atol=0)
        assert not back[:, 2, :, :2].any() and not back[:, :2, :, 2].any()


@pytest.mark.parametrize("form", [sp.csr_array, sp.csc_array])
def test_block_rows_of_repeated_entries_in_any_order(form: type) -> None:
    """Entries that are stored several times count together, and blocks come sorted whatever the order of the entries."""
    rng = np.random.default_rng(4)
    nc, d, count = 6, 3, 80
    major, minor, values = rng.integers(nc * d, size=count), rng.integers(nc * d, size=count), rng.standard_normal(count)
    major = np.sort(major)
    W = with_short_indices(form((values, minor, np.searchsorted(major, np.arange(nc * d + 1))), shape=(nc * d, nc * d)))
    row, column = (major, minor) if form is sp.csr_array else (minor, major)
    dense = np.zeros((nc * d, nc * d))
    np.add.at(dense, (row, column), values)
    indptr, indices, blocks = block_rows(W, d)
    stored = {(a, b): block for a in range(nc) for b, block in zip(indices[indptr[a] : indptr[a + 1]], blocks[indptr[a] :], strict=False)}
    assert len(stored) == len(indices)
    assert stored.keys() == {*zip(row // d, column // d, strict=True)} | {(a, a) for a in range(nc)}
    assert all(np.all(np.diff(indices[b:e]) > 0) for b, e in pairwise(indptr))
    for (a, b), block in stored.items():
        assert_allclose(block, dense[d * a : d * a + d, d * b : d * b + d], atol=1e-14)
    own = LocalProblem(W, np.zeros(nc * d), np.zeros(nc)).diagonal_blocks
    assert_allclose(own, [stored[a, a] for a in range(nc)], atol=1e-14)


# whole problems


@pytest.mark.parametrize("start", ["zero", "warm"])
@pytest.mark.parametrize("kind", ["3D", "2D", "mu = 0", "unsymmetric", "block-sparse"])
@pytest.mark.parametrize("name", SWEEPING)
def test_solves(name: str, kind: str, start: str, natural_map_error) -> None:
    p = {
        "3D": lambda: random_problem(1),
        "2D": lambda: random_problem(2, d=2),
        "mu = 0": lambda: random_problem(3, friction=0.0),
        "unsymmetric": lambda: random_problem(4, unsymmetric=0.01),
        "block-sparse": lambda: sparse_problem(5),
    }[kind]()
    r = None if start == "zero" else np.random.default_rng(6).standard_normal(p.m)
    result = solve(p, name, r, tol=1e-10)
    assert result.status is Status.SOLVED
    assert natural_map_error(p, result.r) <= 1.01e-10
    assert_allclose(result.u, solve(p, "NSN-AC", tol=1e-12).u, atol=1e-8)


@pytest.mark.parametrize("name", NSGS)
def test_hyperstatic_problem(name: str, natural_map_error) -> None:
    p = random_problem(7, nc=12, rank=20)
    result = solve(p, name, tol=1e-6, max_iterations=50_000)
    assert result.status is Status.SOLVED
    assert natural_map_error(p, result.r) <= 1.01e-6


def test_velocities_of_a_singular_problem() -> None:
    """NSGSV needs W^-1: it says so where there is none, or where it would be too large."""
    result = solve(random_problem(7, nc=12, rank=20), "NSGSV")
    assert result.status is Status.SINGULAR and not result.r.any()
    assert solve(LocalProblem(np.zeros((3, 3)), np.array([-1.0, 0, 0]), np.array([0.3])), "NSGSV").status is Status.SINGULAR
    with pytest.raises(InputError, match="at most largest_inverse = 30 contact unknowns, the problem has 36"):
        solve(random_problem(1), "NSGSV", largest_inverse=30)


def test_velocities_in_one_sweep() -> None:
    """Uncoupled contacts are solved by a single sweep, on velocities as on reactions."""
    p = random_problem(8, nc=6)
    blocks = np.kron(np.eye(6), np.ones((3, 3)))
    p = LocalProblem(p.W * blocks, p.q, p.mu)
    for name in ("NSGS-AC", "NSGS-EXACT", "NSGSV"):
        result = solve(p, name, tol=1e-12)
        assert result.solved and result.iterations <= 2


# options


@pytest.mark.parametrize(
    "options",
    [
        {"relaxation": 0.8},
        {"relaxation": 1.2},
        {"shuffle": "once"},
        {"shuffle": "each sweep", "seed": 3},
        {"error_evaluation": "full"},
        {"error_evaluation": "full", "error_frequency": 7},
        {"error_evaluation": "adaptive"},
        {"local_tolerance_rule": "adaptive"},
        {"local_tolerance_rule": "adaptive per contact", "local_error_ratio": 100.0},
        {"filter_local": True},
        {"freezing": 5},
        {"regularisation": 0.3},
        {"one_contact": "AC-GP-HYBRID"},
        {"one_contact": "JM-GP-HYBRID"},
        {"one_contact": "CYL-LOCAL", "local_iterations": 100},
        {"one_contact": "NCP-FP"},
    ],
    ids=str,
)
@pytest.mark.parametrize("d", [2, 3])
def test_options_do_not_change_the_answer(options: dict[str, Any], d: int) -> None:
    p = random_problem(9, nc=20, d=d)
    result = solve(p, "NSGS-AC", tol=1e-10, **options)
    assert result.solved
    assert_allclose(result.r, solve(p, "NSN-AC", tol=1e-12).r, atol=1e-7)
    own = {key: value for key, value in options.items() if key not in ("filter_local", "freezing", "regularisation")}
    assert solve(p, "NSGSV", tol=1e-10, **own).solved


def test_order_of_the_contacts() -> None:
    orders = {}
    for shuffle in ("never", "once", "each sweep"):
        for seed in (0, 0, 1):
            order = contact_order(30, GaussSeidelOptions(shuffle=shuffle, seed=seed))
            orders.setdefault((shuffle, seed), []).append([order().tolist() for _ in range(3)])
    assert orders["never", 0][0] == [list(range(30))] * 3
    for (shuffle, seed), drawn in orders.items():
        assert all(sorted(one) == list(range(30)) for one in drawn[0])
        assert (drawn[0][0] == drawn[0][1]) == (shuffle != "each sweep")
        if shuffle != "never":
            assert drawn[0] != orders[shuffle, 1 - seed][0]
    assert all(len(drawn) == 1 or drawn[0] == drawn[1] for drawn in orders.values())


def test_when_the_full_error_is_computed() -> None:
    p = random_problem(10, nc=30)

    def computed(**options: Any) -> list[int]:
        return [int(row[0]) for row in solve(p, "NSGS-AC", tol=1e-12, **options).history]

    every = computed(error_evaluation="full")
    assert every == list(range(len(every)))
    seventh = computed(error_evaluation="full", error_frequency=7)
    assert seventh == [7 * k for k in range(len(seventh))] and seventh[-1] - every[-1] < 7
    for rule in ("light", "adaptive"):
        few = computed(error_evaluation=rule)
        assert len(few) < len(every) / 2
        assert every[-1] <= few[-1] <= 1.5 * every[-1]


def test_local_tolerance_rules(natural_map_error) -> None:
    def found(rule: str, error: float) -> float:
        return local_tolerance(error, 100, GaussSeidelOptions(local_tolerance_rule=rule, local_tolerance=1e-12))

    assert found("given", 1.0) == 1e-12
    assert_allclose([found("adaptive", e) for e in (1e3, 1e-3, 1e-8, 1e-12)], [0.1, 1e-4, 1e-9, 1e-12])
    assert_allclose([found("adaptive per contact", e) for e in (1e-3, 1e-8, 1e-12)], [1e-6, 1e-11, 1e-12])
    p = random_problem(11)
    loose = solve(p, "NSGS-FP-DS", tol=1e-9, local_tolerance_rule="adaptive")
    assert loose.solved and natural_map_error(p, loose.r) <= 1.01e-9


def test_broken_iteration_is_told(natural_map_error) -> None:
    """Far too strong an over-relaxation of an unsymmetric problem: whatever happens, no wrong SOLVED."""
    p = random_problem(12, unsymmetric=2.0)
    result = solve(p, "NSGS-FP-DS-ONE", relaxation=1.9, tol=1e-10, max_iterations=3000)
    assert result.solved == (natural_map_error(p, result.r) <= 1e-10)
    assert not result.solved


@pytest.mark.parametrize(
    "options",
    [
        {"one_contact": "magic"},
        {"local_tolerance": -1.0},
        {"local_tolerance": float("nan")},
        {"local_tolerance_rule": "loose"},
        {"local_error_ratio": 0.0},
        {"local_iterations": 0},
        {"shuffle": "always"},
        {"seed": -1},
        {"relaxation": 0.0},
        {"relaxation": 2.0},
        {"error_evaluation": "never"},
        {"error_frequency": 0},
        {"stagnation_sweeps": -1},
        {"regularisation": -0.1},
        {"freezing": -1},
    ],
    ids=str,
)
def test_bad_option_is_refused(options: dict[str, Any]) -> None:
    with pytest.raises(InputError, match=next(iter(options))):
        solve(random_problem(1), "NSGS-AC", **options)
    with pytest.raises(InputError, match=next(iter(options))):
        solve(random_problem(1), "NSGSV", **options)


def test_bad_velocity_option_is_refused() -> None:
    with pytest.raises(InputError, match="largest_inverse"):
        solve(random_problem(1), "NSGSV", largest_inverse=-1)
