"""Engines on convex programs (cones, half-cylinders, disks, half-lines): the natural residual in NumPy, agreement, conic rows."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import scipy.sparse as sp
from numpy.testing import assert_allclose

from fcsim.problem import Delassus, LocalProblem
from fcsim.problem.cone import project_cone
from fcsim.problem.delassus import power_norm
from fcsim.problem.shifted_factor import ShiftedInverse
from fcsim.solvers.base import Monitor, Status
from fcsim.solvers.interior_point.cones import ConeAlgebra, NesterovTodd
from fcsim.solvers.variational.conic import conic_rows
from fcsim.solvers.variational.convex import ENGINES
from fcsim.solvers.variational.convex_sets import Cone, Cylinder, Disk
from fcsim.solvers.variational.inequality import Inequality
from fcsim.solvers.variational.watches import SubproblemWatch
from tests.unit.problem.disk import project_disk

RADIUS = np.array([0.0, 0.3, 0.1, 1.0, 0.02, 5.0])
MU = np.array([0.0, 0.3, 0.1, 1.0, 0.02, 0.5])
PROGRAMS = ["cones", "cones, 2D", "cylinders", "cylinders, 2D", "disks", "intervals", "half-lines", "cones, sparse"]


def program(name: str) -> tuple[Inequality, Callable[[np.ndarray], np.ndarray]]:
    """The program and its projection in NumPy."""
    kind, _, rest = name.partition(", ")
    d = {"cones": 3, "cylinders": 3, "disks": 2, "intervals": 1, "half-lines": 1}[kind] - (rest == "2D")
    rng = np.random.default_rng(6)
    n = 6 * d
    B = rng.standard_normal((n, n + 3)) / np.sqrt(n)
    W, q = B @ B.T + 0.3 * np.eye(n), rng.standard_normal(n)
    if d > 1 and kind in ("cones", "cylinders"):
        q[::d] -= 0.8
    if rest == "sparse":
        W = sp.bsr_array(np.kron(np.eye(6) + np.eye(6, k=1) + np.eye(6, k=-1), np.ones((3, 3))) * W + np.eye(n), blocksize=(3, 3))
    if kind == "cones":
        return Inequality(Delassus(W, d), q, Cone(MU)), lambda z: project_cone(z.reshape(-1, d), MU).ravel()
    if kind in ("disks", "intervals"):
        return Inequality(Delassus(W, d), q, Disk(RADIUS)), lambda z: project_disk(z.reshape(-1, d), RADIUS).ravel()

    def half_cylinder(z: np.ndarray) -> np.ndarray:
        rows = z.reshape(-1, d)
        return np.column_stack([np.maximum(rows[:, 0], 0), project_disk(rows[:, 1:], RADIUS)]).ravel()

    return Inequality(Delassus(W, d), q, Cylinder(RADIUS)), half_cylinder


@pytest.mark.parametrize("name", PROGRAMS)
@pytest.mark.parametrize("engine", ENGINES)
def test_engines_reach_the_natural_residual(engine: str, name: str) -> None:
    if engine == "Clarabel":
        pytest.importorskip("clarabel")
    vi, project = program(name)
    monitor = Monitor(vi.q, np.zeros(6), vi.operator.dimension, 1.0)
    watch = SubproblemWatch(vi, monitor, 1e-9, 20_000)
    iterate = ENGINES[engine](vi, np.zeros(len(vi.q)), watch)
    assert iterate.status is Status.SOLVED
    r = iterate.r
    assert np.linalg.norm(r - project(r - (vi.operator.W @ r + vi.q))) <= 1.001e-9
    assert r.any()
    warm = SubproblemWatch(vi, monitor, 1e-8, 20_000)
    assert ENGINES[engine](vi, r, warm).status is Status.SOLVED and warm.iterations == 0
    reference = ENGINES["FP-VI-UPK"](vi, np.zeros(len(vi.q)), SubproblemWatch(vi, monitor, 1e-11, 20_000)).r
    assert_allclose(r, reference, atol=1e-8)


@pytest.mark.parametrize("engine", ENGINES)
def test_engines_keep_to_their_cap(engine: str) -> None:
    if engine == "Clarabel":
        pytest.importorskip("clarabel")
    vi, _ = program("cones")
    watch = SubproblemWatch(vi, Monitor(vi.q, MU, 3, 1.0), 0.0, 3)
    assert not ENGINES[engine](vi, np.zeros(len(vi.q)), watch).status.solved
    assert watch.iterations <= 4


@pytest.mark.parametrize("name", PROGRAMS)
def test_conic_rows_describe_the_set(name: str) -> None:
    """h - A x in the cones exactly where the projection leaves r alone."""
    vi, project = program(name)
    rows = conic_rows(vi)
    rng = np.random.default_rng(8)
    inside = 0
    for trial in range(300):
        r = np.zeros(len(vi.q))
        r[rows.free] = rng.standard_normal(len(rows.free)) * 10 ** rng.uniform(-3, 0)
        if trial % 2:
            r = project(r) * (1 - 1e-9)
        s = rows.h - rows.A @ r[rows.free]
        line, cone = s[: rows.half_lines], s[rows.half_lines :].reshape(rows.cones, rows.cone_size)
        in_cones = bool(np.all(line >= 0) and np.all(cone[:, 0] >= np.linalg.norm(cone[:, 1:], axis=1) - 1e-13))
        in_set = bool(np.allclose(project(r), r, atol=1e-12, rtol=0))
        assert in_cones == in_set
        inside += in_set
    assert 100 <= inside < 300


def test_nesterov_todd_scaling() -> None:
    """V z = V^-1 s, V symmetric with inverse V^-1, V^-2 as a matrix."""
    rows = conic_rows(program("cylinders")[0])
    rng = np.random.default_rng(2)
    algebra = ConeAlgebra(rows)

    def interior() -> np.ndarray:
        x = rng.standard_normal(len(rows.h))
        return x + (0.1 - min(algebra.least(x), 0)) * algebra.identity

    s, z = interior(), interior()
    V = NesterovTodd(rows, s, z)
    assert_allclose(V.point, V.apply(s, inverse=True), rtol=1e-10)
    assert_allclose(V.point @ V.point, s @ z)
    x, y = rng.standard_normal((2, len(s)))
    assert_allclose(V.apply(V.apply(x, inverse=True)), x, rtol=1e-9)
    assert_allclose(V.apply(x) @ y, x @ V.apply(y))
    assert_allclose(V.inverse_square() @ x, V.apply(V.apply(x, inverse=True), inverse=True), rtol=1e-9)
    assert_allclose(algebra.product(z, algebra.divide(z, x)), x, atol=1e-10)
    assert_allclose(algebra.product(x, algebra.identity), x)


def test_longest_step_reaches_the_boundary() -> None:
    rows = conic_rows(program("cylinders")[0])
    algebra = ConeAlgebra(rows)
    rng = np.random.default_rng(3)
    x = algebra.identity
    for _ in range(200):
        dx = 3 * rng.standard_normal(len(x))
        t = algebra.longest_step(x, dx)
        assert algebra.least(x + 0.999 * t * dx) > 0
        assert t == 1 or algebra.least(x + 1.001 * t * dx) < 0


def test_operator_numbers() -> None:
    rng = np.random.default_rng(4)
    Q = np.linalg.qr(rng.standard_normal((30, 30)))[0]
    for values in (np.linspace(0.5, 4, 30), np.r_[np.zeros(10), np.linspace(1, 3, 20)]):
        operator = Delassus((Q * values) @ Q.T, 3)
        assert 0.9 * values[-1] <= operator.norm <= values[-1] * (1 + 1e-9)
        if values[0] > 0:
            assert_allclose(operator.least_singular_value, values[0], rtol=0.1)
        else:
            assert operator.least_singular_value <= 2e-6 * values[-1]
        assert operator.symmetric and operator.symmetric_part is operator
    skewed = Delassus(operator.W + 0.1 * np.triu(np.ones((30, 30)), 1), 3)
    assert not skewed.symmetric
    assert_allclose(skewed.symmetric_part.W, 0.5 * (skewed.W + skewed.W.T))
    assert power_norm(lambda x: x, 0) == 0.0


def test_shifted_inverse_gives_the_same_answer_before_and_after_it_inverts() -> None:
    rng = np.random.default_rng(5)
    B = rng.standard_normal((20, 25))
    A, b = B @ B.T + np.eye(20), rng.standard_normal(20)
    inverse = ShiftedInverse(A, patience=2)
    answers = [inverse.solve(b) for _ in range(4)]
    assert inverse._inverse is not None
    for x in answers:
        assert_allclose(A @ x, b, atol=1e-11)


def test_lipschitz_constant_of_coulombs_map(coulomb_problems: dict[str, Callable[[], LocalProblem]]) -> None:
    problem = coulomb_problems["full rank"]()
    vi = Inequality.coulomb(problem)
    rng = np.random.default_rng(9)
    for _ in range(300):
        a, b = rng.standard_normal((2, problem.m))
        change = np.linalg.norm(vi.map(vi.velocity(a)) - vi.map(vi.velocity(b)))
        assert change <= 1.05 * vi.lipschitz * np.linalg.norm(a - b)
