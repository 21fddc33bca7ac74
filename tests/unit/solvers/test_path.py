"""PROX-PATH: the law by velocities, the pieces of a path and their ends, folds, and problems on which proximal Newton stays."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as sla
import scipy.sparse as sp
from numpy.testing import assert_allclose, assert_array_equal

from fcsim.bench.families import problems
from fcsim.errors import InputError
from fcsim.linear import storage
from fcsim.linear.block_factors._single_factor_kernels import factorise_single
from fcsim.linear.block_factors._single_kernels import solve_single
from fcsim.linear.factors import DenseLU
from fcsim.problem import Delassus, LocalProblem, scaled_error
from fcsim.problem.motion import Motion
from fcsim.problem.reduction import reduce
from fcsim.solvers import Status, solve
from fcsim.solvers.base import Monitor
from fcsim.solvers.newton.systems._velocity_kernels import add_shares_to_rows
from fcsim.solvers.proximal import _path_kernels as kernels
from fcsim.solvers.proximal import path as path_module
from fcsim.solvers.proximal import path_steps
from fcsim.solvers.proximal import pieces as pieces_module
from fcsim.solvers.proximal._following_kernels import by_ranks
from fcsim.solvers.proximal.path import Regularised
from fcsim.solvers.proximal.pieces import InReactions, InVelocities, Pieces

OPEN, STICK, SLIP = 0, 1, 2


def operator(d: int, nc: int, n: int, seed: int) -> Delassus:
    """W = H^T M^-1 H of rank n < m, every contact on some of the unknowns."""
    rng = np.random.default_rng(seed)
    H = rng.standard_normal((n, d * nc)) * np.repeat(rng.random((n, nc)) < 0.5, d, axis=1)
    M = sla.block_diag(*(x @ x.T + np.eye(2) for x in rng.standard_normal((n // 2, 2, 2))))
    W = H.T @ np.linalg.solve(M, H)
    return Delassus(W, d, None, Motion(sp.csr_array(H.T), sp.csr_array(M), W))


def states(nc: int, d: int, rng: np.random.Generator) -> np.ndarray:
    """z of contacts of all statuses."""
    z = rng.standard_normal((nc, d))
    z[:, 0] = np.abs(z[:, 0]) * rng.choice([-1, 1, 3], nc)
    return z


def whole(K: np.ndarray, W: np.ndarray) -> np.ndarray:
    """1 + K W."""
    return np.eye(len(W)) + sla.block_diag(*K) @ W


@pytest.mark.parametrize("d", [2, 3])
def test_the_law_is_coulombs_and_its_derivative_that_of_differences(d: int) -> None:
    """What a spring of stiffness rho leaves of the velocity, (r - z) / rho, is 0 along the normal, or r is; ||r_T|| <= mu r_N."""
    rng = np.random.default_rng(3)
    nc = 40
    z, mu, rho = states(nc, d, rng), rng.choice([0.0, 0.3, 2.0], nc), np.exp(rng.standard_normal(nc))
    status = kernels.statuses(z, mu)
    assert set(status) == {OPEN, STICK, SLIP}
    r, K = kernels.law(z, mu, rho, status)
    left = (r - z) / rho[:, None]  # what the spring leaves of the velocity
    closed = r[:, 0] > 0
    assert np.all(left[~closed, 0] >= 0) and not r[~closed].any()
    assert_allclose(left[closed, 0], 0, atol=1e-14)
    size, limit = np.linalg.norm(r[:, 1:], axis=1), mu * r[:, 0]
    assert np.all(size <= limit * (1 + 1e-14))
    power = np.einsum("ai,ai->a", r[:, 1:], left[:, 1:])
    assert_allclose(power[closed], -(limit * np.linalg.norm(left[:, 1:], axis=1))[closed], atol=1e-13)
    for k in range(d):
        step = np.zeros(d)
        step[k] = 1e-7
        difference = (kernels.law(z + step, mu, rho, status)[0] - kernels.law(z - step, mu, rho, status)[0]) / 2e-7
        assert_allclose(K[:, :, k], rho[:, None] * difference, atol=1e-6)


@pytest.mark.parametrize("d", [2, 3])
def test_the_end_of_a_piece_is_where_the_first_status_changes(d: int) -> None:
    """Against the statuses of many points along the way."""
    for seed in range(20):
        rng = np.random.default_rng(seed)
        z, dz, mu = states(5, d, rng), rng.standard_normal((5, d)), rng.choice([0.3, 1.0], 5)
        status = kernels.statuses(z, mu)
        length, contact, to = kernels.end_of_piece(z, dz, mu, status, np.inf)
        along = np.linspace(0, min(length, 1e3) * (1 - 1e-9), 300)
        assert all(np.array_equal(kernels.statuses(z + t * dz, mu), status) for t in along)
        if np.isfinite(length):
            following = status.copy()
            following[contact] = to
            assert_array_equal(kernels.statuses(z + length * (1 + 1e-7) * dz, mu), following)


def test_a_sliding_contact_turns_by_so_much() -> None:
    z, dz = np.array([[1.0, 5.0, 0.0]]), np.array([[0.0, 0.0, 1.0]])
    length, contact, _ = kernels.end_of_piece(z, dz, np.array([0.5]), np.array([SLIP]), 0.2)
    assert contact == -1
    assert_allclose(length, 0.2 * 5.0)


@pytest.mark.parametrize("kind", [InVelocities, InReactions])
@pytest.mark.parametrize("sparse", [False, True])
@pytest.mark.parametrize("d", [2, 3])
def test_pieces_solve_what_they_say(d: int, sparse: bool, kind: type[Pieces], monkeypatch: pytest.MonkeyPatch) -> None:
    """Also after changes at contacts, the same one again and more than are kept; and with the sign of the determinant."""
    if sparse:
        monkeypatch.setattr(storage, "DENSE_UP_TO", 0)
    monkeypatch.setattr(pieces_module, "MOST_CHANGED", 3)
    nc, signs = 20, set()
    for seed in range(6):
        rng, W = np.random.default_rng(seed), operator(d, nc, 12, seed)
        system = kind(W)  # type: ignore[call-arg]
        mu, rho, z = np.full(nc, 5.0), np.full(nc, 30.0), states(nc, d, rng)
        K = kernels.law(z, mu, rho, kernels.statuses(z, mu))[1]
        system.factor(K)
        for contact in (-1, 0, 4, 4, 7, 9, 0, 11, 3):
            if contact >= 0:
                z[contact] = states(1, d, rng)
                K = kernels.law(z, mu, rho, kernels.statuses(z, mu))[1]
                system.change(contact, K)
            assert_array_equal(system.K, K)
            rhs = rng.standard_normal((nc, d))
            dr, Wdr = system.solve(rhs)
            matrix = whole(K, W.W)
            assert_allclose(dr.ravel(), np.linalg.solve(matrix, rhs.ravel()), rtol=1e-6, atol=1e-7)
            assert_allclose(Wdr.ravel(), W.W @ dr.ravel(), rtol=1e-6, atol=1e-7)
            assert_allclose(system.product(rhs).ravel(), W.W @ rhs.ravel(), atol=1e-10)
            assert system.sign == np.sign(np.linalg.det(matrix))
            signs.add(system.sign)
    assert signs == {-1, 1}


def test_the_sign_of_a_dense_determinant() -> None:
    rng = np.random.default_rng(1)
    for _ in range(10):
        A = rng.standard_normal((5, 5))
        assert DenseLU(A).sign == np.sign(np.linalg.det(A))


@pytest.mark.parametrize("kind", [InVelocities, InReactions])
def test_the_end_of_a_path_solves_the_regularised_problem(kind: type[Pieces]) -> None:
    """From velocities that are wrong by as much as they are large; the answer is put in the law itself."""
    d, nc = 3, 20
    reached = 0
    for seed in range(10):
        rng, W = np.random.default_rng(seed), operator(d, nc, 12, seed)
        q, mu, rho = rng.standard_normal((nc, d)), np.full(nc, 0.6), np.full(nc, 10.0)
        monitor = Monitor(q.ravel(), mu, d, 1e-10)
        inner = Regularised(kind(W), q, mu, rho, monitor)  # type: ignore[call-arg]
        z = states(nc, d, rng)
        status = kernels.statuses(z, mu)
        centre = kernels.law(z, mu, rho, status)[0]
        found = inner.end(z, status, 1e-12, 5, 500, 500, 1000)
        if found is None:
            continue
        u = (W.W @ found.ravel()).reshape(nc, d) + q
        z = centre - rho[:, None] * u
        assert_allclose(kernels.law(z, mu, rho, kernels.statuses(z, mu))[0], found, atol=1e-9)
        reached += 1
    assert reached == 10


@pytest.mark.parametrize(("d", "changes"), [(2, 8), (2, 0), (3, 0)])
def test_the_compiled_path_is_that_of_the_pieces(d: int, changes: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Through folds; the last bits differ, and in 3D how old the sliding contacts' directions are, but where no changes are kept. In 2D
    nothing bends, so that it does not matter how seldom what is left is looked at."""
    monkeypatch.setattr(path_module, "ROOM", changes)
    monkeypatch.setattr(pieces_module, "MOST_CHANGED", changes)
    monkeypatch.setattr(path_module, "ACCURACY", 1e-12)
    reached, pieces = 0, []
    for seed in range(12):
        rng, W, nc = np.random.default_rng(seed), operator(d, 20, 12, seed), 20
        q, mu, rho = rng.standard_normal((nc, d)), rng.choice([0.0, 0.6, 2.0], nc), np.full(nc, 10.0)
        monitor = Monitor(q.ravel(), mu, d, 1e-10)
        inner = Regularised(InVelocities(W), q, mu, rho, monitor)
        z = states(nc, d, rng)
        status = kernels.statuses(z, mu)
        w = (-rho[:, None] * (inner.pieces.product(kernels.law(z, mu, rho, status)[0]) + q) - z) / rho[:, None]
        ends, counts = [], []
        for compiled in (False, True):
            before = monitor.iterations
            ends.append(inner.follow(z, status, w, 500, 500) if compiled else inner.along(z, status, w, 500, 500))
            counts.append(monitor.iterations - before)
        assert counts[0] == counts[1]
        assert (ends[0] is None) == (ends[1] is None)
        if ends[0] is not None and ends[1] is not None:
            assert_allclose(ends[1][0], ends[0][0], rtol=1e-6, atol=1e-6)
            assert isinstance(inner.pieces, InVelocities)
            assert_allclose(ends[1][1], inner.pieces.impulses(ends[0][1]), rtol=1e-6, atol=1e-6)
            reached += 1
            pieces.append(counts[0])
    assert reached >= 6 and max(pieces) > 20  # some contacts change twice


@pytest.mark.parametrize("d", [2, 3])
def test_compiled_newton_is_that_of_the_pieces(d: int) -> None:
    """Iterations, what they find and where they give up; what is found solves the regularised problem."""
    found_some = not_found = 0
    for seed in range(40):
        rng, W, nc = np.random.default_rng(seed), operator(d, 20, 12, seed), 20
        q, mu, rho = rng.standard_normal((nc, d)), rng.choice([0.0, 0.6, 2.0], nc), np.full(nc, 10.0)
        monitor = Monitor(q.ravel(), mu, d, 1e-10)
        inner = Regularised(InVelocities(W), q, mu, rho, monitor)
        centre = kernels.law(states(nc, d, rng), mu, rho, np.ones(nc, dtype=np.int64))[0]
        z, ends, counts = centre - rho[:, None] * (inner.pieces.product(centre) + q), [], []
        for way in (inner.newton_by_pieces, inner.newton):
            before = monitor.iterations
            ends.append(way(z, centre, 1e-9, 8))
            counts.append(monitor.iterations - before)
        assert counts[0] == counts[1]
        assert (ends[0] is None) == (ends[1] is None)
        if ends[0] is None or ends[1] is None:
            not_found += counts[0] == 8
            continue
        assert_allclose(ends[1], ends[0], rtol=1e-7, atol=1e-7)
        z = centre - rho[:, None] * ((W.W @ ends[1].ravel()).reshape(nc, d) + q)
        assert_allclose(kernels.law(z, mu, rho, kernels.statuses(z, mu))[0], ends[1], atol=1e-5)
        found_some += counts[0] > 1
    assert found_some >= 2 and not_found >= 1


@pytest.mark.parametrize("d", [2, 3])
def test_what_contacts_that_share_bodies_have_in_common_is_read_once(d: int) -> None:
    """Faces of several contacts, those of a face apart from each other, some on one body alone: shares and product by NumPy."""
    rng, n = np.random.default_rng(4), 12
    pairs = [(0, 3), (3, 6), (0, 3), (9, None), (3, 6), (0, 9), (0, 3), (9, None), (3, 6)]
    H = np.zeros((n, d * len(pairs)))
    for a, pair in enumerate(pairs):
        for first in pair:
            if first is not None:
                H[first : first + 3, d * a : d * (a + 1)] = rng.standard_normal((3, d))
    W = H.T @ H
    system = InVelocities(Delassus(W, d, None, Motion(sp.csr_array(H.T), sp.csr_array(np.eye(n)), W)))
    assert len(system.arrays.faces) == 5
    r, K = rng.standard_normal((len(pairs), d)), rng.standard_normal((len(pairs), d, d))
    assert_allclose(system.product(r).ravel(), W @ r.ravel(), atol=1e-13)
    K[2] = 0.0  # open
    arrays = system.arrays
    values = arrays.masses.copy()
    add_shares_to_rows(values, arrays.places, arrays.rows, K[system.order])
    order, first, starts, below, offsets, *factor = arrays.fronts
    assert factorise_single(arrays.plan, first, starts, offsets, values, *factor)
    b, x = rng.standard_normal(n), np.empty(n)
    solve_single(order, first, starts, below, offsets, *factor, b, np.empty(n), np.empty(n), x)
    assert_allclose((np.eye(n) + H @ sla.block_diag(*K) @ H.T) @ x, b, atol=1e-12)


def test_a_change_is_taken_apart_by_its_rank() -> None:
    rng = np.random.default_rng(2)
    for rank in range(4):
        C = rng.standard_normal((3, rank)) @ rng.standard_normal((rank, 3))
        found, p, n = by_ranks(C.copy(), 1e-12)
        assert found == rank
        assert_allclose(p[:found].T @ n[:found], C, atol=1e-12)


def test_which_paths_go_on() -> None:
    """Each has its pieces; then those that do not chatter, by their rate end soon, and, where they are long, still come on."""
    assert kernels.on_its_way(199, 200, 800, -0.3, 150, 0.0)
    assert kernels.on_its_way(200, 200, 800, 0.5, 10, 0.5)
    assert not kernels.on_its_way(200, 200, 800, 0.5, 100, 0.5)
    assert not kernels.on_its_way(200, 200, 800, 0.1, 0, 0.0)
    assert not kernels.on_its_way(200, 200, 800, -0.1, 0, 0.0)
    assert not kernels.on_its_way(800, 200, 800, 0.9, 0, 0.5)
    assert kernels.on_its_way(499, 200, 800, 0.9, 0, 0.9)
    assert kernels.on_its_way(500, 200, 800, 0.9, 0, 0.87)
    assert not kernels.on_its_way(500, 200, 800, 0.9, 0, 0.89)
    assert kernels.on_its_way(500, 600, 800, 0.9, 0, 0.9)


def test_contacts_begin_apart_from_borders() -> None:
    """Open ones at rest, sliding ones without speed: each at a place of its own, with its status and nearly its reaction."""
    r = np.array([[0.0, 0, 0], [0, 0, 0], [1.0, 0.5, 0], [2.0, 0, 1.0], [1.0, 0.1, 0]])
    z, status = kernels.beginning(r, np.zeros((5, 3)), np.full(5, 0.5), np.full(5, 1e8))
    assert_array_equal(status, [OPEN, OPEN, SLIP, SLIP, STICK])
    assert_array_equal(kernels.statuses(z, np.full(5, 0.5)), status)
    assert z[0, 0] != z[1, 0] < 0
    assert_allclose(kernels.law(z, np.full(5, 0.5), np.full(5, 1e8), status)[0], r, atol=1e-3)


@pytest.mark.parametrize("d", [2, 3])
def test_rigid_bodies_of_the_families(d: int) -> None:
    """Walls and towers of rigid blocks on more contacts than they need, and a pile without bodies behind W."""
    for family in ("walls" if d == 3 else "walls-2D", "towers", "rocks") if d == 3 else ("walls-2D", "disks"):
        given = problems(family, 60, 3)
        p = given if isinstance(given, LocalProblem) else reduce(given).local
        result = solve(p, "PROX-PATH", tol=1e-8)
        assert result.solved and scaled_error(p, result.r) <= 1e-8
    bare = LocalProblem(p.W, p.q, p.mu, dimension=p.dimension)
    assert solve(bare, "PROX-PATH", tol=1e-8, before=0).solved


NEWTON, PATH, LOST = "Newton's method alone", "a path that arrives", "a path that is lost"


@pytest.mark.parametrize(
    ("options", "falls", "first"),
    [
        ({}, [10, 10, 1 / 30, 10, 10, 10, 10], [10] * 8),
        ({"newton_along": 0, "along": 2.0, "regained": 3.0}, [10, 2, 1 / 30, 3, 3, 2, 10], [10, 10, 0, 10, 10, 10, 0, 10]),
    ],
    ids=["the table's", "in motion"],
)
def test_how_alpha_falls_after_newton_and_after_a_path_and_where_a_path_was_lost(
    options: dict[str, float], falls: list[float], first: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """What alpha is divided by after each step, and how many of Newton's iterations come before a path: none where the last step took one,
    since that says that they do not arrive."""
    ways = iter([NEWTON, PATH, LOST, NEWTON, NEWTON, PATH, NEWTON, NEWTON])
    alphas: list[float] = []
    counts: list[int] = []

    def told(
        inner: Regularised, r: np.ndarray, u: np.ndarray, target: float, newton: int, options: path_steps.PathOptions
    ) -> tuple[np.ndarray | None, bool]:
        alphas.append(float(1 / (inner.rho * problem.delassus.compliance)[0]))
        counts.append(newton)
        inner.monitor.iterations += 1
        way = next(ways)
        return None if way == LOST else r, way != NEWTON

    problem = LocalProblem(np.eye(6), np.array([-1.0, 0.5, 0.0, -1.0, 0.0, 0.5]), np.full(2, 0.5))
    monkeypatch.setattr(path_steps, "_solved", told)
    monitor = Monitor(problem.q, problem.mu, 3, 1e-8)
    turns = path_steps.path_turns(problem, np.full(6, 0.1), monitor, path_steps.PathOptions(alpha_most=1e-2, **options))
    for _ in range(8):
        next(turns)
    assert_allclose(np.array(alphas[:-1]) / alphas[1:], falls)
    assert counts == first


def test_limits_and_options() -> None:
    given = problems("towers", 60, 3)
    few = solve(given, "PROX-PATH", tol=1e-12, max_iterations=12, before=5)
    assert few.status is Status.MAX_ITERATIONS and few.iterations <= 13
    wrong = (("alpha", 0.0), ("fall", 1.0), ("regained", 1.0), ("pieces", -1), ("longest", -1), ("newton", 0), ("newton_along", -1))
    for name, value in wrong:
        with pytest.raises(InputError, match=name):
            solve(given, "PROX-PATH", **{name: value})
