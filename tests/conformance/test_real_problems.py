"""Real finite element problems from FCLIB files, solved cold by NSN-AC at 1e-8 and verified with M itself.

The files are the test data of FCLIB and of the published comparisons; the tests skip where the folder is absent.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from numpy.testing import assert_allclose

from fcsim.export_fclib.read import read_fclib
from fcsim.problem import GlobalProblem
from fcsim.solvers import Status, solve

FOLDER = Path(__file__).parents[3] / "shared" / "fclib"
FILES = ["CubeH8.hdf5", "LMGC_GlobalFrictionContactProblem00046.hdf5", "wall-688-00122.hdf5", "wall-688-00310.hdf5"]

pytestmark = pytest.mark.skipif(not FOLDER.is_dir(), reason="the folder of real FCLIB problems, ../shared/fclib, is absent")


@pytest.fixture(scope="module", params=FILES)
def real(request: pytest.FixtureRequest) -> tuple[GlobalProblem, Callable[[np.ndarray], np.ndarray], np.ndarray]:
    """The problem, r -> u through one sparse factorisation of M by SciPy, and q."""
    if not (FOLDER / request.param).is_file():
        pytest.skip(f"{request.param} is absent")
    problem = read_fclib(FOLDER / request.param).problem
    assert isinstance(problem, GlobalProblem) and problem.G is None
    M, H = sp.csc_matrix(problem.M), sp.csr_array(problem.H)
    factor = spla.splu(M, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})

    def velocity(r: np.ndarray) -> np.ndarray:
        rhs = H @ r + problem.f
        v = factor.solve(rhs)
        v += factor.solve(rhs - M @ v)
        return H.T @ v + problem.w

    return problem, velocity, velocity(np.zeros(problem.m))


@pytest.mark.parametrize("linear", ["auto", "kkt"])
def test_newton_from_zero(real: Any, linear: str, verdict: Callable[..., Any]) -> None:
    problem, velocity, q = real
    result = solve(problem, "NSN-AC", tol=1e-8, linear=linear)
    assert result.status is Status.SOLVED
    assert result.r.any()
    u = velocity(result.r)
    found = verdict(result.r, u, problem.mu, problem.dimension, q)
    assert found.error <= 1.01e-8
    assert_allclose(result.u, u, rtol=0, atol=1e-9 * np.linalg.norm(q))
    # the law's parts, each relative to its own size: what an error of 1e-8 ||q|| leaves where u is far smaller than q
    assert found.cone <= 1e-6
    assert found.dual_cone <= 1e-6
    assert found.complementarity <= 1e-6
    assert result.v is not None
    residual = problem.M @ result.v - problem.H @ result.r - problem.f
    assert np.linalg.norm(residual) <= 1e-9 * np.linalg.norm(problem.f)
