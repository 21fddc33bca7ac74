"""Real problem files against a plain reading of their entries, and our files against the reference library."""

import os
import re
import shutil
import subprocess
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.sparse as sp

from fcsim.export_fclib import GlobalRollingProblem, Solution, read_fclib, write_fclib
from fcsim.problem import GlobalProblem, LocalProblem

SHARED = Path(__file__).parents[4] / "shared"
FILES = sorted((SHARED / "fclib").glob("*.hdf5"))


def dense(group):
    """The matrix of a group, entry by entry, from the definitions of the storages."""
    (rows,), (columns,), (nz,) = group["m"][:], group["n"][:], group["nz"][:]
    p, i, x = group["p"][:], group["i"][:], group["x"][:]
    A = np.zeros((rows, columns))
    if nz >= 0:
        for k in range(nz):
            A[i[k], p[k]] += x[k]
    elif nz == -1:
        for column in range(columns):
            for k in range(p[column], p[column + 1]):
                A[i[k], column] += x[k]
    else:
        for row in range(rows):
            for k in range(p[row], p[row + 1]):
                A[row, i[k]] += x[k]
    return A


@pytest.mark.skipif(not FILES, reason=f"no FCLIB files in {SHARED / 'fclib'}")
class TestRealFiles:
    @pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
    def test_entries_are_those_of_the_file(self, path):
        content = read_fclib(path)
        with h5py.File(path) as file:
            group = file[f"fclib_{content.form}"]
            for letter, about in content.matrices.items():
                if about.shape[0] * about.shape[1] < 2_000_000:
                    assert np.array_equal(getattr(content.problem, letter).toarray(), dense(group[letter])), letter
            for letter in group["vectors"]:
                assert np.array_equal(getattr(content.problem, letter), group["vectors"][letter][:]), letter
            assert content.problem.dimension == group["spacedim"][0]
            if "solution" in file:
                for letter in file["solution"]:
                    assert np.array_equal(getattr(content.solution, letter), file["solution"][letter][:])

    @pytest.mark.parametrize("storage", ["csc", "csr", "triplet"])
    def test_all_three_storages_are_among_them(self, storage):
        assert any(about.storage == storage for path in FILES for about in read_fclib(path).matrices.values())

    def test_the_wall_is_symmetric_and_read_as_a_sparse_product_says(self):
        """7212 unknowns are too many for a dense copy: compare M x with sums over the stored rows."""
        walls = [path for path in FILES if path.stem.startswith("wall-688")]
        if not walls:
            pytest.skip("no file of the wall")
        content = read_fclib(walls[0])
        x = np.random.default_rng(0).standard_normal(content.problem.n)
        with h5py.File(walls[0]) as file:
            group = file["fclib_global/M"]
            assert group["nz"][0] == -2
            product = np.add.reduceat(group["x"][:] * x[group["i"][:]], group["p"][:-1])
        np.testing.assert_allclose(content.problem.M @ x, product, rtol=1e-12, atol=1e-12 * np.abs(product).max())

    def test_a_rolling_problem_is_among_them(self):
        rolling = [content for path in FILES if (content := read_fclib(path)).form == "global_rolling"]
        if not rolling:
            pytest.skip("no file with rolling friction")
        assert isinstance(rolling[0].problem, GlobalRollingProblem)
        assert rolling[0].problem.m == 5 * rolling[0].problem.nc


@pytest.fixture(scope="module")
def reference(tmp_path_factory):
    """The reference reader: run(paths) -> (exit code, printed text)."""
    source, compiler = SHARED / "tools" / "fclib_check.c", shutil.which("cc")
    if not source.is_file() or compiler is None:
        pytest.skip(f"no C compiler, or no {source}")
    program = tmp_path_factory.mktemp("reference") / "fclib_check"
    if shutil.which("pkg-config") is None:
        pytest.skip("no pkg-config to find the serial HDF5 library")
    hdf5 = subprocess.run(["pkg-config", "--cflags", "--libs", "hdf5-serial"], capture_output=True, text=True).stdout.split()
    made = subprocess.run([compiler, "-O1", "-o", program, source, *hdf5, "-lfclib", "-lm"], capture_output=True, text=True)
    if made.returncode:
        if re.search(r"fclib\.h|hdf5\.h|cannot find -l", made.stderr):
            pytest.skip("the reference library is not installed (Debian: libfclib-dev)")
        pytest.fail(made.stderr)

    def run(*paths):
        done = subprocess.run([program, *paths], capture_output=True, text=True, env={**os.environ, "LC_ALL": "C"})
        return done.returncode, done.stdout

    return run


def pressed_mass():
    """A point mass pressed with 2 N on a plane, mu = 0.5, and pushed with 0.5 N: it sticks, u = 0, r = (2, -0.5, 0), by statics."""
    problem = GlobalProblem(sp.eye_array(3), sp.eye_array(3), np.array([-2.0, 0.5, 0.0]), np.zeros(3), np.array([0.5]))
    return problem, Solution(np.zeros(3), np.array([2.0, -0.5, 0.0]), np.zeros(3))


@pytest.mark.parametrize("compression", [True, False])
@pytest.mark.parametrize("storage", ["csc", "csr", "triplet"])
@pytest.mark.parametrize("form", ["global", "local", "global with constraints", "local with constraints"])
def test_the_reference_library_reads_our_files(reference, tmp_path, form, storage, compression):
    problem, solution = pressed_mass()
    if form.startswith("local"):
        problem = LocalProblem(sp.eye_array(3), problem.f, problem.mu)
    if form == "global with constraints":
        problem = GlobalProblem(problem.M, problem.H, problem.f, problem.w, problem.mu, sp.csr_array([[0.0], [0], [1]]), np.zeros(1))
    if form == "local with constraints":
        problem = LocalProblem(problem.W, problem.q, problem.mu, sp.csr_array([[0.0], [0], [1]]), sp.eye_array(1), np.zeros(1))
    solution = Solution(solution.u, solution.r, solution.v, np.zeros(1) if "constraints" in form else None)
    texts = {"title": "Point mass", "description": "brûlé", "math_info": "unique"} if compression else {}
    path = write_fclib(
        tmp_path / "mass.hdf5", problem, solution=solution, guesses=[solution] * 2, storage=storage, compression=compression, **texts
    )
    code, printed = reference(path)
    assert code == 0 and printed.rstrip().endswith("OK"), printed
    assert f" {form.split()[0]} dim=3" in printed and "guesses=2" in printed
    if form == "local":  # the reference program's own natural map and balance at the exact solution
        assert float(re.search(r"natmap=(\S+)", printed)[1]) == 0
        assert float(re.search(r"\|Wr\+q-u\|/\|q\|=(\S+)", printed)[1]) == 0
        if storage == "csc":
            assert float(re.search(r"merit_lib=(\S+)", printed)[1]) == 0
    if form == "global":
        assert float(re.search(r"\|Mv-Hr-f\|/\|f\|=(\S+)", printed)[1]) == 0
        assert float(re.search(r"natmap_abs=(\S+)", printed)[1]) == 0


@pytest.mark.parametrize("storage", ["csc", "csr", "triplet"])
def test_real_problems_written_again_pass_the_reference_reader(reference, tmp_path, storage):
    """Every real file but the rolling ones (the library has no reader for them): numbers printed as for the original file."""
    if not FILES:
        pytest.skip(f"no FCLIB files in {SHARED / 'fclib'}")
    originals, copies = [], []
    for path in FILES:
        content = read_fclib(path)
        if content.form != "global_rolling":
            copy = tmp_path / path.name
            write_fclib(copy, content.problem, solution=content.solution, guesses=content.guesses, storage=storage)
            originals.append(path)
            copies.append(copy)
    (_, expected), (code, printed) = reference(*originals), reference(*copies)
    assert code == 0, printed
    norms = [[re.findall(r"\|[qfw]\|=\S+", line) for line in text.splitlines()] for text in (expected, printed)]
    assert norms[0] == norms[1] and all(norms[0]) and len(norms[0]) == len(originals)
