"""The faceted-cone method: LCP of the polyhedral law, refinement of the facets, PATH behind its file formats."""

from __future__ import annotations

import stat
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
from numpy.testing import assert_allclose

from fcsim.errors import InputError, MissingDependency
from fcsim.problem import LocalProblem
from fcsim.solvers import Status, solve
from fcsim.solvers.lcp.coulomb_lcp import coulomb_lcp
from fcsim.solvers.lcp.faceted import FacetedOptions, Polygons
from fcsim.solvers.lcp.lcp import lemke
from fcsim.solvers.lcp.path import nl_text, read_sol


def random_problem(seed: int, nc: int = 10, mu: float = 0.5, d: int = 3) -> LocalProblem:
    rng = np.random.default_rng(seed)
    H = rng.standard_normal((d * nc + 5, d * nc)) / np.sqrt(d * nc)
    q = rng.standard_normal((nc, d))
    q[:, 0] -= 0.5
    return LocalProblem(H.T @ H + 0.1 * np.eye(d * nc), q.ravel(), rng.uniform(0.1, mu, nc), dimension=d)


def violation(p: LocalProblem, r: np.ndarray) -> float:
    """The largest violation of Coulomb's law, in its case-by-case words."""
    u, r = (p.W @ r + p.q).reshape(-1, p.dimension), r.reshape(-1, p.dimension)
    size = np.linalg.norm(u[:, 1:], axis=1)
    opposed = np.linalg.norm(r[:, 1:] * size[:, None] + (p.mu * r[:, 0])[:, None] * u[:, 1:], axis=1)
    outside = np.linalg.norm(r[:, 1:], axis=1) - p.mu * r[:, 0]
    return float(np.max([-r[:, 0], -u[:, 0], np.abs(r[:, 0] * u[:, 0]), outside, opposed]))


@pytest.mark.parametrize("crash_sweeps", [0, 100])
@pytest.mark.parametrize("seed", range(4))
def test_reaches_the_true_cone(seed: int, crash_sweeps: int) -> None:
    p = random_problem(seed)
    expected = solve(p, "NSN-AC", tol=1e-12)
    result = solve(p, "PATH", tol=1e-10, crash_sweeps=crash_sweeps)
    assert expected.solved and result.solved
    assert violation(p, result.r) < 1e-8
    assert_allclose(result.r, expected.r, atol=1e-7)
    warm = solve(p, "PATH", 1.01 * expected.r, tol=1e-10)
    assert warm.solved and violation(p, warm.r) < 1e-8


@pytest.mark.parametrize(
    ("q", "mu", "r"),
    [
        ((1.0, 0.4, 0.1), 0.5, (0, 0, 0)),
        ((-1.0, 0.15, 0.2), 0.5, (2, -0.3, -0.4)),  # sticks, |r_T| = mu r_N / 2
        ((-1.0, 0.29, 0.4), 0.5, (2, -0.58, -0.8)),  # sticks, nearly sliding, between the first polygon's corners
        ((-1.0, 0.6, 0.8), 0.5, (2, -0.6, -0.8)),  # slides along (0.6, 0.8)
        ((-1.0, 0.6, 0.8), 0.0, (2, 0, 0)),
    ],
)
@pytest.mark.parametrize("facets", [4, 5, 8, 13])
def test_one_block(q: tuple[float, ...], mu: float, r: tuple[float, ...], facets: int) -> None:
    """W = 1/2, a mass of 2 pushed by q."""
    p = LocalProblem(0.5 * np.eye(3), np.array(q), np.array([mu]))
    result = solve(p, "PATH", tol=1e-12, facets=facets, crash_sweeps=0)
    assert result.solved
    assert_allclose(result.r, r, atol=1e-10)


def test_without_refinement_the_status_is_the_true_cones() -> None:
    """f regular facets: the error falls as f grows, but the LCP's exact answer is not called solved."""
    p, errors = random_problem(7), []
    for facets in (4, 8, 16, 32):
        result = solve(p, "PATH", tol=1e-10, facets=facets, max_iterations=1, crash_sweeps=0)
        assert result.status is Status.MAX_ITERATIONS
        assert result.error > 1e-6
        errors.append(result.error)
    assert errors[3] < 0.5 * errors[1] < 0.5 * errors[0]
    r = result.r.reshape(-1, 3)
    assert np.all(np.linalg.norm(r[:, 1:], axis=1) <= p.mu * r[:, 0] + 1e-12)  # polygons from inside


def test_two_dimensions_need_no_facets() -> None:
    p = random_problem(3, d=2)
    result = solve(p, "PATH", tol=1e-12)
    assert result.solved
    assert_allclose(result.r, solve(p, "2D-LEMKE", tol=1e-12).r, atol=1e-10)


def test_hyperstatic_and_unsymmetric_problems() -> None:
    rng = np.random.default_rng(4)
    H = rng.standard_normal((12, 30))
    H[:, ::3] = np.abs(H[:, ::3])
    p = LocalProblem(H.T @ H, H.T @ -np.abs(rng.standard_normal(12)), np.full(10, 0.3))
    result = solve(p, "PATH", tol=1e-8)
    assert result.solved and violation(p, result.r) < 1e-6
    p = random_problem(5)
    p = LocalProblem(sp.bsr_array(p.W + 0.005 * rng.standard_normal(p.W.shape), blocksize=(3, 3)), p.q, p.mu)
    result = solve(p, "PATH", tol=1e-9)
    assert result.solved and violation(p, result.r) < 1e-7


def test_limits() -> None:
    p = random_problem(6, nc=30)
    result = solve(p, "PATH", tol=1e-12, max_iterations=3, crash_sweeps=0)
    assert result.status is Status.MAX_ITERATIONS and result.iterations == 3
    assert solve(p, "PATH", max_iterations=0).iterations == 0
    assert solve(p, "PATH", tol=1e-12, time_limit=0.0).status is Status.TIME_LIMIT
    impossible = LocalProblem(np.zeros((3, 3)), np.array([-1.0, 0, 0]), np.array([0.3]))
    assert solve(impossible, "PATH").status is Status.STAGNATED
    huge = LocalProblem(sp.eye_array(3 * 1300, format="csr"), -np.ones(3 * 1300), np.full(1300, 0.3))
    with pytest.raises(InputError, match=r"an LCP of 13000 unknowns.*up to 12000"):
        solve(huge, "PATH", crash_sweeps=0, tol=1e-12)


@pytest.mark.parametrize("facets", [4, 5, 8, 9])
def test_generators(facets: int) -> None:
    """Unit vectors around the whole circle, regular at first, gathered at the centre afterwards."""
    polygons = Polygons(random_problem(1), FacetedOptions(facets=facets))
    regular = 2 * np.pi / facets
    for spread in (regular, 0.1, 1e-3):
        polygons.spread[:] = spread
        polygons.centre = np.linspace(-3, 3, 10)
        D = polygons.generators
        assert D.shape == (10, facets, 2)
        assert_allclose(np.linalg.norm(D, axis=2), 1)
        angle = np.sort((np.arctan2(D[:, :, 1], D[:, :, 0]) - polygons.centre[:, None]) % (2 * np.pi), axis=1)
        gaps = np.diff(np.column_stack([angle, angle[:, 0] + 2 * np.pi]), axis=1)
        assert np.all(gaps > 0) and np.all(gaps < np.pi)  # positively spanning: friction in every direction
        assert_allclose(gaps.min(axis=1), spread)
        if spread == regular:
            assert_allclose(gaps, regular)


def test_support_of_solved_problems() -> None:
    """An LCP's answer gives its own basis back, up to degenerate pairs: pivoting from it changes nothing."""
    for seed in range(5):
        p = random_problem(seed, mu=1.0)
        lcp = coulomb_lcp(p, Polygons(p, FacetedOptions()).generators)
        cold = lemke(lcp.M, lcp.q)
        r = lcp.reaction(cold.z)
        warm = lemke(lcp.M, lcp.q, start=lcp.support(r, p.W @ r + p.q))
        assert warm.pivots <= 2 < cold.pivots
        assert_allclose(lcp.reaction(warm.z), r, atol=1e-9)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"facets": 3}, "facets: expected an integer >= 4, got 3"),
        ({"engine": "Gurobi"}, "engine: expected one of 'Lemke', 'PATH'"),
        ({"max_pivots": 0}, "max_pivots: expected an integer >= 1"),
        ({"crash_sweeps": -1}, "crash_sweeps: expected an integer >= 0"),
        ({"window": 0}, "window: expected an integer >= 1"),
    ],
)
def test_bad_options_are_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        solve(random_problem(0), "PATH", **options)


STAND_IN = r'''#!{python}
"""Reads any linear complementarity .nl of free and nonnegative variables and solves it by trying every basis."""
import sys
import numpy as np
lines = open(sys.argv[1] + ".nl").read().split("\n")
assert sys.argv[2] == "-AMPL" and lines[0].startswith("g3")
nv, nc, no, ranges, equations = map(int, lines[1].split())
conditions = int(lines[2].split()[2])
J, rows, bounds, columns, i = np.zeros((nc, nv)), [], [], [], 10
while i < len(lines) and lines[i]:
    head = lines[i]
    i += 1
    if head[0] in "CO":
        assert lines[i] == "n0"
        i += 1
    elif head == "r":
        rows, i = [line.split() for line in lines[i : i + nc]], i + nc
    elif head == "b":
        bounds, i = lines[i : i + nv], i + nv
    elif head[0] == "k":
        assert int(head[1:]) == nv - 1
        columns, i = [int(line) for line in lines[i : i + nv - 1]], i + nv - 1
    elif head[0] == "J":
        number, count = map(int, head[1:].split())
        for line in lines[i : i + count]:
            j, value = line.split()
            J[number, int(j)] = float(value)
        i += count
assert int(lines[7].split()[0]) == np.count_nonzero(J)
assert columns == np.cumsum(np.count_nonzero(J, axis=0))[:-1].tolist()
equal = [k for k, row in enumerate(rows) if row[0] == "4"]
paired = [(k, int(row[2]) - 1) for k, row in enumerate(rows) if row[0] == "5" and row[1] == "1"]
assert len(equal) == equations and len(paired) == conditions and all(bounds[v] == "2 0" for _, v in paired)
right = np.array([float(rows[k][1]) for k in equal])
for basis in range(2 ** len(paired)):
    # of each pair, the variable or the row's body is zero
    A = np.vstack([J[equal]] + [J[k][None] if basis >> b & 1 else np.eye(nv)[v][None] for b, (k, v) in enumerate(paired)])
    if abs(np.linalg.det(A)) < 1e-12:
        continue
    x = np.linalg.solve(A, np.r_[right, np.zeros(len(paired))])
    if all(x[v] >= -1e-10 and J[k] @ x >= -1e-10 for k, v in paired):
        break
else:
    sys.exit(1)
with open(sys.argv[1] + ".sol", "w") as file:
    file.write("stand-in: solved\n\nOptions\n3\n0\n1\n0\n%d\n%d\n%d\n%d\n" % (nc, nc, nv, nv))
    file.write("".join("0\n" for _ in range(nc)) + "".join("%.17g\n" % value for value in x) + "objno 0 0\n")
'''


@pytest.fixture
def stand_in(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A program that keeps to AMPL's interface, as pathampl does."""
    program = tmp_path / "pathampl"
    program.write_text(STAND_IN.replace("{python}", sys.executable))
    program.chmod(program.stat().st_mode | stat.S_IEXEC)
    monkeypatch.setenv("FCSIM_PATHAMPL", str(program))
    return program


def test_path_is_run_through_its_files(stand_in: Path) -> None:
    for q, r in (((-1.0, 0.6, 0.8), (2, -0.6, -0.8)), ((-1.0, 0.15, 0.2), (2, -0.3, -0.4))):
        p = LocalProblem(0.5 * np.eye(3), np.array(q), np.array([0.5]))
        result = solve(p, "PATH", tol=1e-9, engine="PATH", facets=4, crash_sweeps=0)
        assert result.solved and result.iterations >= 1
        assert_allclose(result.r, r, atol=1e-8)


def test_path_that_fails_or_hangs(stand_in: Path) -> None:
    p = LocalProblem(0.5 * np.eye(3), np.array([-1.0, 0.6, 0.8]), np.array([0.5]))
    stand_in.write_text("#!/bin/sh\nexit 1\n")
    failed = solve(p, "PATH", engine="PATH", crash_sweeps=0)
    assert failed.status is Status.STAGNATED
    assert "return code 1" in failed.message
    stand_in.write_text("#!/bin/sh\nexec sleep 60\n")
    result = solve(p, "PATH", engine="PATH", crash_sweeps=0, time_limit=0.3)
    assert result.status is Status.TIME_LIMIT and result.time < 50


def test_path_that_is_not_there(monkeypatch: pytest.MonkeyPatch) -> None:
    p = LocalProblem(0.5 * np.eye(3), np.array([-1.0, 0.6, 0.8]), np.array([0.5]))
    monkeypatch.setenv("FCSIM_PATHAMPL", "no-such-program")
    with pytest.raises(MissingDependency, match=r"FCSIM_PATHAMPL='no-such-program' is no program.*engine 'Lemke'"):
        solve(p, "PATH", engine="PATH", crash_sweeps=0)
    monkeypatch.delenv("FCSIM_PATHAMPL")
    monkeypatch.setenv("PATH", "")
    with pytest.raises(MissingDependency, match="no program pathampl on the search path"):
        solve(p, "PATH", engine="PATH", crash_sweeps=0)


def test_nl_file_of_a_small_problem() -> None:
    """Written out by hand from the format's description: z_0 >= 0 ⊥ w_0 = 2 z_0 + z_1 - 1, z_1 >= 0 ⊥ w_1 = 3 z_1."""
    text = nl_text(np.array([[2.0, 1], [0, 3]]), np.array([-1.0, 0]))
    header, rest = text.split("\n")[:10], text.split("\n", 10)[10]
    assert header[1].split() == ["4", "4", "1", "0", "2"] and header[2].split() == ["0", "0", "2", "0", "0", "0"]
    assert header[7].split() == ["7", "0"]
    assert rest == (
        "C0\nn0\nC1\nn0\nC2\nn0\nC3\nn0\nO0 0\nn0\nr\n4 -1.0\n4 0.0\n5 1 1\n5 1 2\nb\n2 0\n2 0\n3\n3\nk3\n1\n3\n5\n"
        "J0 3\n0 -2.0\n1 -1.0\n2 1.0\nJ1 2\n1 -3.0\n3 1.0\nJ2 1\n2 1\nJ3 1\n3 1\n"
    )


def test_sol_files() -> None:
    good = "message\n\nOptions\n3\n1\n1\n0\n2\n0\n4\n4\n0.5\n-1e-17\n3\n4\nobjno 0 0\n"
    found = read_sol(good, 2)
    assert found is not None
    assert_allclose(found, [0.5, 0])
    with_duals = good.replace("2\n0\n4\n4\n", "2\n2\n4\n4\n9\n9\n")
    assert_allclose(read_sol(with_duals, 2), [0.5, 0])  # type: ignore[arg-type]
    for bad in (
        "",
        "no options\n",
        good[:30],
        good.replace("objno 0 0", "objno 0 200"),
        good.replace("0.5", "nan"),
        good.replace("0.5", "?"),
    ):
        assert read_sol(bad, 2) is None
