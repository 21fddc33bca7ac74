"""Numbers at the end of what floats hold: a status or an error of ours, and no answer that is none."""

import numpy as np
import pytest
import scipy.sparse as sp

from fcsim.errors import FcsimError
from fcsim.problem import GlobalProblem, LocalProblem
from fcsim.problem.judge import relative
from fcsim.problem.rolling import GlobalRollingProblem
from fcsim.solvers import SOLVERS, Status, solve

COULOMB = [name for name, method in SOLVERS.items() if 5 not in method.dimensions]
EXTREMES = (1e300, 1e160, 1e100, 1e-160, 1e-300, 5e-324)


def extreme(rng: np.random.Generator, d: int) -> LocalProblem | GlobalProblem:
    """A problem of one to three contacts some of whose numbers are near the largest or the smallest."""
    nc = int(rng.integers(1, 4))
    A = rng.standard_normal((nc * d, nc * d))
    W, q, mu = A @ A.T + 0.1 * np.eye(nc * d), rng.standard_normal(nc * d), rng.uniform(0, 1, nc)
    for _ in range(rng.integers(1, 3)):
        number = EXTREMES[rng.integers(len(EXTREMES))]
        place = int(rng.integers(nc))
        with np.errstate(all="ignore"):
            match rng.integers(5):
                case 0:
                    W[rng.integers(nc * d), rng.integers(nc * d)] = number
                case 1:
                    q[rng.integers(nc * d)] = number * rng.choice([-1, 1])
                case 2:
                    W = W * number
                case 3:
                    q = q * number
                case _:
                    rows = slice(place * d, place * d + d)
                    W[rows] *= number
                    W[:, rows] *= number
    if rng.integers(3) == 0:
        return GlobalProblem(sp.csc_array(W), sp.csc_array(np.eye(nc * d)), q, np.zeros(nc * d), mu, dimension=d)
    return LocalProblem(W if rng.integers(2) else sp.csc_array(W), q, mu, dimension=d)


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", COULOMB)
def test_no_foreign_exception(name: str) -> None:
    rng = np.random.default_rng([5, *name.encode()])
    for _ in range(12):
        try:
            p = extreme(rng, SOLVERS[name].dimensions[-1])
            result = solve(p, name, tol=1e-6, time_limit=0.3)
        except FcsimError:
            continue
        assert result.solved <= (np.all(np.isfinite(result.r)) and np.isfinite(result.u @ result.u) and result.error <= 1e-6)


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", ["NSN-AC", "NSN-JM", "NSGS-EXACT", "NSGS-FP-VI-UPK", "auto"])
def test_velocities_whose_squares_overflow_are_solved_by_nothing(name: str) -> None:
    """r = 0 with u_N < 0 was called SOLVED, since an error over infinity is zero."""
    f = np.array([-1e308, 2e307, 0.0])
    result = solve(GlobalProblem(sp.csc_array(np.eye(3)), sp.csc_array(np.eye(3)), f, np.zeros(3), np.array([0.3])), name)
    assert result.u[0] < 0 and result.status is not Status.SOLVED
    assert np.isnan(relative(1.0, np.inf)) and np.isnan(relative(0.0, np.inf)) and np.isnan(relative(0.0, np.nan))


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("error", ["scaled", "published"])
@pytest.mark.parametrize("name", ["NSN-AC", "NSGS-AC", "ADMM", "PROX-NEWTON", "auto"])
def test_velocities_whose_squares_underflow_are_no_rest(name: str, error: str) -> None:
    """r = 0 with u_N < 0 was called SOLVED, since an error of 0 over 0 is zero; solutions are proportional to q."""
    rng = np.random.default_rng(2)
    H = rng.standard_normal((12, 9))
    f, mu = rng.standard_normal(12), np.array([0.2, 0.5, 0.9])
    for size in (1.0, 1e-130, 1e-158, 1e-200, 1e-290):
        for p in (GlobalProblem(np.eye(12), H, f * size, np.zeros(9), mu), LocalProblem(H.T @ H, H.T @ f * size, mu)):
            result = solve(p, name, error=error, tol=1e-6)
            r, u = result.r / size, result.u / size
            lost = np.einsum("ai,ai->a", r.reshape(3, 3)[:, 1:], u.reshape(3, 3)[:, 1:])
            slides = np.linalg.norm(u.reshape(3, 3)[:, 1:], axis=1)
            holds = u[::3].min() > -1e-4 and np.abs(r[::3] * u[::3]).max() < 1e-4 and np.abs(lost + mu * r[::3] * slides).max() < 1e-4
            assert result.solved <= holds, (size, result.error)
            assert result.solved or size < 1
        zero = solve(LocalProblem(H.T @ H, np.zeros(9), mu), name, error=error)
        assert zero.solved and not zero.r.any()


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", [name for name, method in SOLVERS.items() if 5 in method.dimensions])
def test_velocities_whose_squares_underflow_are_no_rest_with_rolling_friction(name: str) -> None:
    f = np.array([-1.0, 0.2, 0.0, 0.1, 0.0])
    for size in (1.0, 1e-158, 1e-200, 1e-290):
        p = GlobalRollingProblem(np.eye(5), np.eye(5), f * size, np.zeros(5), np.array([0.5]), np.array([0.5]))
        result = solve(p, name, tol=1e-6)  # it sticks: r = -f
        assert result.solved <= (np.abs(result.r / size + f).max() < 1e-5)
        assert result.solved or size < 1


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("name", ["EG", "FP-VI-UPK", "IPM-COULOMB", "2D-ENUM"])
@pytest.mark.parametrize("scale", [1e300, 1e-300])
def test_large_and_small_compliances_are_no_reason_for_warnings(name: str, scale: float) -> None:
    """Users who make errors of NumPy's warnings had a division by zero in place of an answer."""
    A, q = np.split(np.random.default_rng(0).standard_normal((7, 6)), [6])
    d = SOLVERS[name].dimensions[0]
    assert solve(LocalProblem(A @ A.T * scale, q[0], np.full(6 // d, 0.5), dimension=d), name, time_limit=1.0).status in Status


def test_least_squares_without_an_end_pass_a_basis_over(monkeypatch: pytest.MonkeyPatch) -> None:
    """SciPy's nnls raises RuntimeError at the end of its iterations, as for 700 contacts on three unknowns, which ended 2D-ENUM."""

    def endless(*_: object) -> None:
        raise RuntimeError("Maximum number of iterations reached.")

    monkeypatch.setattr("scipy.optimize.nnls", endless)
    p = LocalProblem(np.zeros((2, 2)), np.array([-1.0, 0.0]), np.array([0.5]), dimension=2)
    assert solve(p, "2D-ENUM", guess_sweeps=0).status is Status.STAGNATED
