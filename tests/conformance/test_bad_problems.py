"""Problems that cannot be solved as they are: one clear error from Python, the same on the command line with exit code 2."""

from __future__ import annotations

import re
import shutil
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import scipy.sparse as sp
from numpy.testing import assert_allclose

from fcsim.command_line import main as cli
from fcsim.errors import FcsimError, InputError
from fcsim.export_fclib import read_fclib, write_fclib
from fcsim.linear.factors import SingularMatrix
from fcsim.problem import GlobalProblem, LocalProblem
from fcsim.solvers import SOLVERS, Status, solve

COULOMB = [name for name, method in SOLVERS.items() if min(method.dimensions) <= 3]
"""The methods for problems without rolling friction, which has problems of its own (tests/unit/solvers/test_rolling.py)."""


def global_problem(d: int = 3, nc: int = 2) -> dict[str, Any]:
    """The fields of a good problem of n = 8 degrees of freedom."""
    rng = np.random.default_rng(d)
    X, H = rng.standard_normal((8, 8)), rng.standard_normal((8, d * nc))
    fields = {"M": X @ X.T + 8 * np.eye(8), "H": H, "f": -H.sum(axis=1), "w": np.zeros(d * nc), "mu": np.full(nc, 0.4)}
    return fields | {"G": np.eye(8)[:, :1], "b": np.zeros(1), "dimension": d}


def local_problem(nc: int = 2) -> dict[str, Any]:
    m = 3 * nc
    fields = {"W": np.eye(m) + 0.1, "q": -np.ones(m), "mu": np.full(nc, 0.4)}
    return fields | {"V": np.full((m, 1), 0.2), "R": np.eye(1), "s": np.zeros(1), "dimension": 3}


def spoilt(field: str, values: Any) -> Callable[[], Any]:
    """Make the problem of the given form ("global.M") with that field replaced, solved by the default method."""
    form, name = field.split(".")
    fields = (global_problem() if form == "global" else local_problem()) | {name: values}
    return lambda: solve(GlobalProblem(**fields) if form == "global" else LocalProblem(**fields))


NAN, ONES = np.array([0, np.nan, 0, 0, 0, 0]), np.ones
SINGULAR = np.diag([1.0, 1, 1, 1, 1, 1, 1, 0])
SPRINGS = np.diag([2.0] * 8) - np.diag([1.0] * 7, 1) - np.diag([1.0] * 7, -1)
SPRINGS[0, 0] = SPRINGS[7, 7] = 1  # a row of springs without supports

PROBLEMS: dict[str, tuple[Callable[[], Any], type[FcsimError], str]] = {
    "M not square": (spoilt("global.M", ONES((8, 7))), InputError, r"M: expected shape \(8, 8\), got \(8, 7\)"),
    "M of another size": (spoilt("global.M", np.eye(7)), InputError, r"M: expected shape \(8, 8\), got \(7, 7\)"),
    "M NaN": (spoilt("global.M", np.full((8, 8), np.nan)), InputError, "M: expected finite numbers, got NaN or infinity"),
    "M infinite, sparse": (spoilt("global.M", sp.csr_array(np.diag([np.inf] * 8))), InputError, "M: expected finite numbers"),
    "M singular": (spoilt("global.M", SINGULAR), SingularMatrix, "M is singular"),
    "M without supports": (
        lambda: solve(GlobalProblem(**global_problem() | {"M": SPRINGS, "G": None, "b": None})),
        SingularMatrix,
        "singular",
    ),
    "G of dependent columns": (
        lambda: solve(GlobalProblem(**global_problem() | {"G": np.ones((8, 2)), "b": np.zeros(2)})),
        SingularMatrix,
        "M is singular",
    ),
    "H transposed": (spoilt("global.H", ONES((6, 8))), InputError, r"H: expected shape \(8, 6\), got \(6, 8\)"),
    "H NaN": (spoilt("global.H", np.full((8, 6), np.nan)), InputError, "H: expected finite numbers"),
    "f a matrix": (spoilt("global.f", ONES((8, 1))), InputError, r"f: expected a vector, got shape \(8, 1\)"),
    "f infinite": (spoilt("global.f", np.full(8, np.inf)), InputError, "f: expected finite numbers, got NaN or infinity in 8 entries"),
    "w NaN": (spoilt("global.w", NAN), InputError, "w: expected finite numbers, got NaN or infinity in 1 entries"),
    "w too short": (spoilt("global.w", ONES(5)), InputError, "every 3 contact unknowns in 3D, got 2 for 5"),
    "mu negative": (
        spoilt("global.mu", np.array([0.3, -0.1])),
        InputError,
        "mu: expected friction coefficients >= 0, got -0.1 at contact 1",
    ),
    "mu NaN": (spoilt("global.mu", np.array([0.3, np.nan])), InputError, "mu: expected finite numbers"),
    "mu too long": (spoilt("global.mu", ONES(3)), InputError, "mu: expected 2 friction coefficients for 6 contact unknowns in 3D, got 3"),
    "four dimensions": (spoilt("global.dimension", 4), InputError, "dimension: expected 2 or 3, got 4"),
    "G without b": (spoilt("global.b", None), InputError, "G and b: expected both or none"),
    "G of another size": (spoilt("global.G", ONES((7, 1))), InputError, r"G: expected shape \(8, 1\), got \(7, 1\)"),
    "b NaN": (spoilt("global.b", np.array([np.nan])), InputError, "b: expected finite numbers"),
    "W not square": (spoilt("local.W", ONES((6, 5))), InputError, r"W: expected shape \(6, 6\), got \(6, 5\)"),
    "W NaN": (spoilt("local.W", np.full((6, 6), np.nan)), InputError, "W: expected finite numbers"),
    "q NaN": (spoilt("local.q", NAN), InputError, "q: expected finite numbers"),
    "q of texts": (spoilt("local.q", np.array(["a"] * 6)), InputError, "q: expected a vector of numbers"),
    "V without R": (spoilt("local.R", None), InputError, "V, R and s: expected all or none"),
    "V without s": (spoilt("local.s", None), InputError, "V, R and s: expected all or none"),
    "V of another size": (spoilt("local.V", ONES((5, 1))), InputError, r"V: expected shape \(6, 1\), got \(5, 1\)"),
    "R not square": (spoilt("local.R", ONES((1, 2))), InputError, r"R: expected shape \(1, 1\), got \(1, 2\)"),
    "R singular": (spoilt("local.R", np.zeros((1, 1))), SingularMatrix, "R of 1 equality constraints is singular"),
    "no problem at all": (lambda: solve("problem.hdf5"), InputError, "problem: expected a GlobalProblem, .* got str"),  # type: ignore[arg-type]
    "W complex": (spoilt("local.W", np.eye(6) + 0j), InputError, "W: expected a matrix of real numbers, got complex ones"),
    "W complex, sparse": (spoilt("local.W", sp.csr_array(np.eye(6) + 1j)), InputError, "W: expected a matrix of real numbers"),
    "q complex": (spoilt("local.q", -ONES(6) + 1j), InputError, "q: expected a vector of real numbers, got complex ones"),
    "W masked": (spoilt("local.W", np.ma.masked_greater(np.eye(6), 0.5)), InputError, "W: .* got a masked array"),
    "dimension no whole number": (spoilt("local.dimension", 3.0), InputError, "dimension: expected 2 or 3, got 3.0"),
    "start of another size": (
        lambda: solve(LocalProblem(np.eye(3), -ONES(3), ONES(1)), r=ONES(6)),
        InputError,
        r"r: expected a starting point of shape \(3,\), got \(6,\)",
    ),
}


@pytest.mark.parametrize("name", PROBLEMS)
def test_python_refuses(name: str) -> None:
    call, kind, message = PROBLEMS[name]
    with pytest.raises(kind, match=message):
        call()


def test_the_good_ones_are_solved() -> None:
    """What the table above spoils."""
    for problem in (GlobalProblem(**global_problem()), GlobalProblem(**global_problem(2)), LocalProblem(**local_problem())):
        assert solve(problem).solved


# files


def put(file: h5py.File, name: str, values: Any) -> None:
    if name in file:
        del file[name]
    file[name] = values


def written(folder: Path, problem: GlobalProblem | LocalProblem) -> Path:
    return write_fclib(folder / "problem.hdf5", problem, compression=False)


def changed(change: Callable[[h5py.File], Any], form: str = "global") -> Callable[[Path], Path]:
    """Write the good problem of that form, then change the file."""

    def make(folder: Path) -> Path:
        path = written(folder, GlobalProblem(**global_problem()) if form == "global" else LocalProblem(**local_problem()))
        with h5py.File(path, "r+") as file:
            change(file)
        return path

    return make


def truncated(folder: Path) -> Path:
    path = written(folder, GlobalProblem(**global_problem()))
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    return path


def foreign(folder: Path) -> Path:
    with h5py.File(folder / "problem.hdf5", "w") as file:
        file.create_group("mesh")["points"] = np.zeros((4, 3))
    return folder / "problem.hdf5"


def not_hdf5(folder: Path) -> Path:
    (folder / "problem.hdf5").write_text("<?xml version='1.0'?>")
    return folder / "problem.hdf5"


def empty(folder: Path) -> Path:
    (folder / "problem.hdf5").touch()
    return folder / "problem.hdf5"


FILES: dict[str, tuple[Callable[[Path], Path], str]] = {
    "not there": (lambda folder: folder / "problem.hdf5", "no such file"),
    "a folder": (lambda folder: folder, "expected an FCLIB file, found a folder"),
    "not HDF5": (not_hdf5, "expected an HDF5 file"),
    "empty": (empty, "expected an HDF5 file"),
    "truncated": (truncated, "the HDF5 file is truncated or damaged|expected an HDF5 file"),
    "foreign": (foreign, "expected one of the groups /fclib_global, .* got none"),
    "no M": (changed(lambda file: file.pop("fclib_global/M")), "/fclib_global/M: expected a group, got nothing"),
    "no entries of H": (changed(lambda file: file.pop("fclib_global/H/x")), "/fclib_global/H/x: expected a vector of numbers, got nothing"),
    "no f": (changed(lambda file: file.pop("fclib_global/vectors/f")), "vectors/f: expected a vector of numbers, got nothing"),
    "no mu": (changed(lambda file: file.pop("fclib_global/vectors/mu")), "vectors/mu: expected a vector of numbers, got nothing"),
    "no spacedim": (changed(lambda file: file.pop("fclib_global/spacedim")), "spacedim: expected an integer, got nothing"),
    "G without b": (changed(lambda file: file.pop("fclib_global/vectors/b")), "vectors/b: expected a vector"),
    "V without R": (changed(lambda file: file.pop("fclib_local/R"), "local"), "/fclib_local/R: expected a group, got nothing"),
    "f NaN": (changed(lambda file: put(file, "fclib_global/vectors/f", np.full(8, np.nan))), "vectors/f: expected finite numbers"),
    "f too short": (
        changed(lambda file: put(file, "fclib_global/vectors/f", np.ones(7))),
        r"expected the shape \(7, 7\) of the vectors .f, f., got m, n = 8, 8",
    ),
    "mu negative": (changed(lambda file: put(file, "fclib_global/vectors/mu", np.array([0.3, -1]))), "mu: .*>= 0, got -1.0 at contact 1"),
    "mu too long": (changed(lambda file: put(file, "fclib_global/vectors/mu", np.ones(3))), "mu: expected 2 friction coefficients"),
    "M NaN": (changed(lambda file: put(file, "fclib_global/M/x", np.full(64, np.nan))), "/fclib_global/M/x: expected finite numbers"),
    "M of another size": (changed(lambda file: put(file, "fclib_global/M/m", np.array([9]))), "/fclib_global/M"),
    "q NaN": (changed(lambda file: put(file, "fclib_local/vectors/q", np.full(6, np.nan)), "local"), "vectors/q: expected finite numbers"),
    "W infinite": (changed(lambda file: put(file, "fclib_local/W/x", np.full(36, np.inf)), "local"), "W/x: expected finite numbers"),
    "M singular": (lambda folder: written(folder, GlobalProblem(**global_problem() | {"M": SINGULAR})), "M is singular"),
    "R singular": (
        lambda folder: written(folder, LocalProblem(**local_problem() | {"R": np.zeros((1, 1))})),
        "R of 1 equality constraints",
    ),
}


@pytest.mark.parametrize("name", FILES)
def test_command_line_refuses(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Exit code 2, one line on the standard error that says what is wrong, nothing printed as a result."""
    make, message = FILES[name]
    path = make(tmp_path)
    assert cli.main(["solve", str(path)]) == cli.EXIT_BAD_INPUT == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("fcsim: ") and err.count("\n") == 1 and "Traceback" not in err
    assert re.search(message, err), err
    if name not in ("M singular", "R singular"):
        assert str(path) in err


@pytest.mark.parametrize("name", FILES)
def test_python_refuses_the_file(name: str, tmp_path: Path) -> None:
    """Reading or solving raises an error of fcsim's own."""
    path = FILES[name][0](tmp_path)
    with pytest.raises(FcsimError):
        problem: Any = read_fclib(path).problem
        solve(problem)


def test_command_line_refuses_bad_arguments(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = str(written(tmp_path, GlobalProblem(**global_problem())))
    for arguments, message in (
        (["--solver", "NSN-XY"], "solver 'NSN-XY': expected one of"),
        (["--solver", "2D-LEMKE"], "solver '2D-LEMKE': works in 2D, the problem has 3D"),
        (["--tol", "-1"], "tol: expected a number > 0, got -1.0"),
        (["--tol", "nan"], "tol: expected a number > 0, got nan"),
        (["--solver", "NSN-AC", "--set", "rho=large"], "option rho: expected one of"),
        (["--solver", "NSN-AC", "--set", "speed=9"], "speed"),
        (["--solver", "NSN-AC", "--set", "max_iterations=many"], "max_iterations=many: solver NSN-AC expects a value of type int"),
        (["--start", "guess"], "expects /guesses, the file holds none"),
    ):
        assert cli.main(["solve", path, *arguments]) == 2
        out, err = capsys.readouterr()
        assert out == "" and message in err and err.count("\n") == 1


def test_the_good_files_are_solved(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """What the tables above spoil."""
    for problem in (GlobalProblem(**global_problem()), LocalProblem(**local_problem())):
        assert cli.main(["solve", str(written(tmp_path, problem))]) == 0
    assert "solved" in capsys.readouterr().out


# problems with a trivial or an honest answer


@pytest.mark.parametrize("name", COULOMB)
def test_zero_contacts(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """M v = f alone."""
    d = SOLVERS[name].dimensions[0]
    p = GlobalProblem(2 * np.eye(4), np.zeros((4, 0)), np.arange(4.0), np.zeros(0), np.zeros(0), dimension=d)
    result = solve(p, name)
    assert result.status is Status.SOLVED and result.r.shape == result.u.shape == (0,) and result.error == 0
    assert_allclose(result.v, [0, 0.5, 1, 1.5])  # type: ignore[arg-type]
    local = solve(LocalProblem(np.zeros((0, 0)), np.zeros(0), np.zeros(0), dimension=d), name)
    assert local.solved and local.r.shape == (0,)
    assert cli.main(["solve", str(written(tmp_path, p)), "--solver", name]) == 0
    assert "0 contacts" in capsys.readouterr().out


def true_error(p: LocalProblem, r: np.ndarray) -> float:
    """||r - P_K(r - (u + g(u)))|| / ||q|| contact by contact."""
    d, u, total = p.dimension, p.W @ r + p.q, 0.0
    for a, mu in enumerate(p.mu):
        own = slice(d * a, d * a + d)
        z = r[own] - u[own]
        z[0] -= mu * np.linalg.norm(u[own][1:])
        length = np.linalg.norm(z[1:])
        P = z if length <= mu * z[0] else np.zeros(d)
        if mu * length > -z[0] and length > mu * z[0]:
            P = (z[0] + mu * length) / (1 + mu**2) * np.r_[1, mu * z[1:] / length]
        total += float(np.sum((r[own] - P) ** 2))
    return float(np.sqrt(total) / np.linalg.norm(p.q))


def contradictory(d: int) -> LocalProblem:
    """Two bodies that do not move, pressed into each other: no reaction helps."""
    return LocalProblem(np.zeros((d, d)), np.r_[-1.0, np.zeros(d - 1)], np.full(1, 0.3), dimension=d)


def unsymmetric(d: int) -> LocalProblem:
    """M far from symmetric, so that W is (no mechanics behind it; methods for convex programmes have no programme)."""
    rng = np.random.default_rng(0)
    X, H = rng.standard_normal((12, 12)), rng.standard_normal((12, 4 * d))
    M = X @ X.T + 6 * np.eye(12) + 10 * (X - X.T)
    return LocalProblem(H.T @ np.linalg.solve(M, H), H.T @ np.linalg.solve(M, -H.sum(axis=1)), np.full(4, 0.4), dimension=d)


def indefinite(d: int) -> LocalProblem:
    """A compliance below zero: more reaction, more penetration."""
    W = np.diag(np.tile(np.r_[-1.0, np.ones(d - 1)], 2))
    return LocalProblem(W, np.tile(np.r_[-1.0, 0.3 * np.ones(d - 1)], 2), np.full(2, 0.5), dimension=d)


@pytest.mark.parametrize("make", [contradictory, unsymmetric, indefinite])
@pytest.mark.parametrize("name", COULOMB)
def test_status_is_honest_where_theory_ends(name: str, make: Callable[[int], LocalProblem]) -> None:
    """Solved only where the law holds; no exception but a clear one, no endless run."""
    p = make(SOLVERS[name].dimensions[-1])
    began = time.thread_time()
    try:
        result = solve(p, name, tol=1e-8, error="published", time_limit=0.2)
    except FcsimError:
        return
    assert time.thread_time() - began < 60  # of the processor, compilation included
    if np.abs(result.r).max() < 1e6:  # beyond, r - (r - u) is round-off
        found = true_error(p, result.r)
        assert_allclose(result.error, found, rtol=1e-5, atol=1e-9)
        assert result.solved == (found <= 1e-8)
    assert not (result.solved and make is not unsymmetric)  # the others have no solution


def test_unsymmetric_problem_that_is_solvable() -> None:
    """Newton and Gauss-Seidel need no symmetry."""
    p = unsymmetric(3)
    results = [solve(p, name, tol=1e-9, error="published") for name in ("NSN-AC", "NSGS-AC", "PATH")]
    assert any(result.solved for result in results)
    for result in results:
        assert result.solved == (true_error(p, result.r) <= 1e-9)


def test_two_good_copies_of_a_file_are_one_problem(tmp_path: Path) -> None:
    """Nothing of a path is part of a problem: a copy under another name and suffix is read as well."""
    path = written(tmp_path, GlobalProblem(**global_problem()))
    shutil.copy(path, tmp_path / "copy.dat")
    first, second = (read_fclib(name).problem for name in (path, tmp_path / "copy.dat"))
    assert isinstance(first, GlobalProblem) and isinstance(second, GlobalProblem)
    assert_allclose(solve(first).r, solve(second).r, atol=0)
    assert replace(first, f=first.f).n == 8


def test_who_meets_infinity_hands_back_numbers() -> None:
    """Without an iterate whose error was a number the starting point is handed back, not infinity."""
    W = np.array(
        [
            *([7.2, -2.8, -3.2, -1.7, -3.9, 2.2], [-2.2, 3.8, -1.0, -1.2, 1.0, -4.0], [-3.3, -0.5, 4.6, 0.0, 1.2, 0.2]),
            *([-1.5, -0.8, 0.4, 2.7, 0.5, -0.8], [-3.7, 1.6, 1.1, 0.4, 2.1, -2.1], [2.3, -3.7, 0.3, -0.5, -1.5, 5.4]),
        ]
    )
    q = np.array([8.9, -2.6, -7.3, -3.0, -3.9, 4.2])
    result = solve(LocalProblem(W, q, np.full(3, 0.5), dimension=2), "SOCLCP", tol=1e-8)
    assert not result.solved and np.all(np.isfinite(result.r)) and np.isfinite(result.error)
