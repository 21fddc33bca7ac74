"""The parts of `auto`: the storage it gives W, and when it ends ADMM."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
import scipy.sparse as sp
from numpy.testing import assert_array_equal

from fcsim.problem import LocalProblem
from fcsim.solvers import solve
from fcsim.solvers.automatic.stages import FAR, AutomaticOptions, _fitting_storage, _Run, _SplittingWatch
from fcsim.solvers.base import Monitor, Status


def chain(nc: int, d: int) -> np.ndarray:
    """A compliance that couples neighbours only."""
    rng = np.random.default_rng(nc)
    H = rng.standard_normal((nc, d, d)) + 2 * np.eye(d)
    W = np.zeros((nc, d, nc, d))
    for a in range(nc):
        W[a, :, a] = H[a] @ H[a].T + 3 * np.eye(d)
        if a:
            W[a, :, a - 1] = 0.3 * H[a]
            W[a - 1, :, a] = 0.3 * H[a].T
    return W.reshape(nc * d, nc * d)


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("kind", [np.asarray, sp.csr_array, sp.csc_array, sp.coo_array, sp.bsr_array])
def test_a_large_sparse_matrix_is_stored_by_sorted_block_rows(kind: type, d: int) -> None:
    nc = 120
    W = chain(nc, d)
    given = kind(W)
    fitting = _fitting_storage(LocalProblem(given, np.ones(nc * d), np.ones(nc), dimension=d), int(np.count_nonzero(W))).W
    assert fitting.format == "bsr" and fitting.blocksize == (d, d)
    assert_array_equal(fitting.toarray(), W)
    for a in range(nc):
        assert np.all(np.diff(fitting.indices[fitting.indptr[a] : fitting.indptr[a + 1]]) > 0)
    if kind is not np.asarray:
        assert given.format == kind.__name__[:3]
        assert_array_equal(given.toarray(), W)


@pytest.mark.parametrize("kind", [np.asarray, sp.csr_array, sp.bsr_array])
def test_a_small_matrix_is_dense(kind: type) -> None:
    W = chain(10, 3)
    fitting = _fitting_storage(LocalProblem(kind(W), np.ones(30), np.ones(10)), int(np.count_nonzero(W))).W
    assert isinstance(fitting, np.ndarray)
    assert_array_equal(fitting, W)


def iterations_of(errors: Iterator[float], share: int, tol: float = 1e-8) -> tuple[int, Status]:
    """Count the iterations after which the watch ends iterates of these errors; at u = r, mu = 0 the error is r_N."""
    monitor = Monitor(np.array([1.0, 0, 0]), np.zeros(1), 3, tol)
    monitor.record(np.array([1.0, 0, 0]), np.array([1.0, 0, 0]))  # the start of `auto`, of error 1
    watch = _SplittingWatch(lambda r: np.array([1.0, 0, 0]), monitor, 10_000, share)
    while True:
        r = np.array([next(errors), 0.0, 0.0])
        status = watch.visit(r, r, True)
        if status is not None:
            return monitor.iterations, status
        watch.tick()


def geometric(rate: float) -> Iterator[float]:
    error = 1.0
    while True:
        yield error
        error *= rate


def test_admm_goes_on_while_a_share_brings_a_tenth() -> None:
    iterations, status = iterations_of(geometric(0.1 ** (1 / 15)), share=20)
    assert status is Status.SOLVED and 119 <= iterations <= 121


def test_admm_ends_after_a_share_that_brought_less() -> None:
    assert iterations_of(geometric(0.1 ** (1 / 50)), share=20) == (20, Status.MAX_ITERATIONS)


def test_admm_ends_when_its_iterates_swing() -> None:
    def swinging() -> Iterator[float]:
        yield from (1.0, 0.1, 1e-2, 1e-3)
        while True:
            yield 0.5

    assert iterations_of(swinging(), share=20) == (14, Status.MAX_ITERATIONS)  # the best one, after 3, and 10 more than that


@pytest.mark.parametrize("storage", [np.asarray, sp.csc_array])
@pytest.mark.parametrize("nc", [8, 120])
def test_storage_does_not_change_the_answer(nc: int, storage: type) -> None:
    W = chain(nc, 3)
    q = np.random.default_rng(0).standard_normal(3 * nc)
    result = solve(LocalProblem(storage(W), q, np.full(nc, 0.4)), "auto", tol=1e-10)
    reference = solve(LocalProblem(W, q, np.full(nc, 0.4)), "NSGS-AC", tol=1e-12)
    assert result.solved and reference.solved
    assert np.linalg.norm(result.r - reference.r) <= 1e-8 * np.linalg.norm(reference.r)


@pytest.mark.parametrize(("error", "left", "sweeps"), [(0.1 * FAR, 1.0, True), (0.1 * FAR, 1e9, False), (10 * FAR, 1.0, False)])
def test_gauss_seidel_goes_on_after_newton_where_it_is_near_and_quicker(error: float, left: float, sweeps: bool) -> None:
    nc = 8
    problem = LocalProblem(chain(nc, 3), -np.ones(3 * nc), np.full(nc, 0.4))
    monitor = Monitor(problem.q, problem.mu, 3, 1e-8)
    run = _Run(problem, monitor, AutomaticOptions(), warm=False, joints=None)
    monitor.record(np.zeros(3 * nc), problem.q)
    monitor.best, run._sweeps_left = error, left
    run.second_race(np.zeros(3 * nc))
    assert (monitor.iterations > 0) == sweeps
