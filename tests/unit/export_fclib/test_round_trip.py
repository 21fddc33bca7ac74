"""What is written is read back bit by bit, in every form and storage, and the file has the types that the format states."""

import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fcsim.errors import InputError
from fcsim.export_fclib import GlobalRollingProblem, Solution, file_name, read_fclib, write_fclib
from fcsim.export_fclib.chunks import Compressor
from fcsim.export_fclib.write import _write_matrix
from fcsim.problem import GlobalProblem, LocalProblem
from fcsim.solvers import solve

STORAGES = ("csc", "csr", "triplet")


def random_sparse(rng, rows, columns, density=0.3):
    dense = rng.standard_normal((rows, columns)) * (rng.random((rows, columns)) < density)
    return sp.csr_array(dense)


def make_problem(form, seed=0, nc=4, n=17, p=0, dimension=3):
    rng = np.random.default_rng(seed)
    m = nc * (5 if form == "global_rolling" else dimension)
    mu = rng.random(nc)
    M = random_sparse(rng, n, n) + sp.eye_array(n)
    W = random_sparse(rng, m, m) + sp.eye_array(m)
    G, b = (random_sparse(rng, n, p), rng.standard_normal(p)) if p else (None, None)
    H, f, w = random_sparse(rng, n, m), rng.standard_normal(n), rng.standard_normal(m)
    if form == "global":
        return GlobalProblem(M, H, f, w, mu, G, b, dimension)
    if form == "global_rolling":
        return GlobalRollingProblem(M, H, f, w, mu, rng.random(nc), G, b)
    V, R, s = (random_sparse(rng, m, p), random_sparse(rng, p, p), rng.standard_normal(p)) if p else (None, None, None)
    return LocalProblem(W, w, mu, V, R, s, dimension)


def make_solution(problem, p=0, seed=1):
    rng = np.random.default_rng(seed)
    v = rng.standard_normal(problem.n) if hasattr(problem, "n") else None
    return Solution(rng.standard_normal(problem.m), rng.standard_normal(problem.m), v, rng.standard_normal(p) if p else None)


def same_bits(a, b):
    if a is None or b is None:
        return a is b
    dense = [x.toarray() if sp.issparse(x) else np.asarray(x) for x in (a, b)]
    return dense[0].shape == dense[1].shape and dense[0].tobytes() == dense[1].tobytes()


def assert_same(problem, other):
    assert type(problem) is type(other)
    for name in problem.__dataclass_fields__:
        assert same_bits(getattr(problem, name), getattr(other, name)), name


@pytest.mark.parametrize("compression", [True, False])
@pytest.mark.parametrize("storage", STORAGES)
@pytest.mark.parametrize(
    ("form", "p", "dimension"),
    [("global", 0, 3), ("global", 2, 2), ("local", 0, 2), ("local", 3, 3), ("global_rolling", 0, 5), ("global_rolling", 2, 5)],
)
def test_problem_solution_and_guesses_come_back(tmp_path, form, p, dimension, storage, compression):
    problem = make_problem(form, p=p, dimension=dimension)
    solution, guesses = make_solution(problem, p), [make_solution(problem, p, seed) for seed in (2, 3, 4)]
    path = write_fclib(
        tmp_path / "problem.hdf5",
        problem,
        solution=solution,
        guesses=guesses,
        title="A title",
        description="brûlé, 3 contacts ∥",
        math_info="",
        storage=storage,
        compression=compression,
    )
    content = read_fclib(path)
    assert_same(problem, content.problem)
    assert content.form == form
    assert (content.info.title, content.info.description, content.info.math_info) == ("A title", "brûlé, 3 contacts ∥", "")
    for written, read in zip([solution, *guesses], [content.solution, *content.guesses], strict=True):
        for name in ("v", "u", "r", "l"):
            assert same_bits(getattr(written, name), getattr(read, name)), name
    assert {about.storage for about in content.matrices.values()} == {storage}
    assert [entry.name for entry in tmp_path.iterdir()] == ["problem.hdf5"]


@settings(max_examples=30, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(seed=st.integers(0, 2**32), nc=st.integers(1, 6), n=st.integers(1, 12), p=st.integers(0, 3), storage=st.sampled_from(STORAGES))
def test_any_sizes_come_back(tmp_path, seed, nc, n, p, storage):
    problem = make_problem("global", seed, nc, n, p)
    assert_same(problem, read_fclib(write_fclib(tmp_path / "problem.hdf5", problem, storage=storage)).problem)


@pytest.mark.parametrize("storage", STORAGES)
@pytest.mark.parametrize("form", ["global", "local"])
def test_a_problem_without_contacts_comes_back(tmp_path, form, storage):
    problem = make_problem(form, nc=0)
    assert_same(problem, read_fclib(write_fclib(tmp_path / "none.hdf5", problem, storage=storage)).problem)


@pytest.mark.parametrize("convert", [lambda W: W.toarray(), sp.bsr_array, sp.coo_array, sp.csc_array])
def test_any_kind_of_matrix_is_written(tmp_path, convert):
    problem = make_problem("local")
    other = LocalProblem(convert(problem.W), problem.q, problem.mu)
    assert_same(problem, read_fclib(write_fclib(tmp_path / "problem.hdf5", other)).problem)


def test_the_writer_sums_duplicates_without_changing_its_argument(tmp_path):
    W = sp.csc_array((np.array([1.0, 2.0, 4.0]), np.array([1, 0, 1]), np.array([0, 3, 3])), shape=(2, 2))
    write_fclib(tmp_path / "problem.hdf5", LocalProblem(W, np.zeros(2), np.ones(1), dimension=2))
    assert W.data.tolist() == [1, 2, 4]
    assert read_fclib(tmp_path / "problem.hdf5").problem.W.toarray().tolist() == [[2, 0], [5, 0]]


@pytest.mark.parametrize(("storage", "nz"), [("csc", -1), ("csr", -2), ("triplet", 3)])
def test_layout_of_a_small_matrix(tmp_path, storage, nz):
    """[[0, 5, 0], [7, 0, 9]], whose three storages are written down by hand (CSparse: triplets have columns in p, rows in i)."""
    with h5py.File(tmp_path / "matrix.hdf5", "w") as file:
        _write_matrix(file.create_group("A"), sp.csr_array([[0.0, 5, 0], [7, 0, 9]]), storage, Compressor())
        group = {name: file["A"][name] for name in file["A"]}
        assert {name: group[name][0] for name in ("m", "n", "nz", "nzmax")} == {"m": 2, "n": 3, "nz": nz, "nzmax": 3}
        assert all(group[name].shape == (1,) and group[name].dtype == np.int32 for name in ("m", "n", "nz", "nzmax"))
        assert [group[name].dtype for name in "pix"] == [np.int32, np.int32, np.float64]
        assert all(group[name].shuffle and group[name].compression == "gzip" for name in "pix")
        entries = {"csc": ([0, 1, 2, 3], [1, 0, 1], [7, 5, 9]), "csr": ([0, 1, 3], [1, 0, 2], [5, 7, 9])}
        if storage == "triplet":
            assert set(zip(group["i"], group["p"], group["x"], strict=True)) == {(0, 1, 5), (1, 0, 7), (1, 2, 9)}
        else:
            assert tuple(group[name][:].tolist() for name in "pix") == entries[storage]


def test_layout_of_vectors_texts_and_guesses(tmp_path):
    problem = make_problem("global", p=2)
    path = write_fclib(tmp_path / "a.hdf5", problem, guesses=[make_solution(problem, 2)], title="Ä")
    with h5py.File(path) as file:
        assert set(file) == {"fclib_global", "guesses"}
        assert set(file["fclib_global"]) == {"spacedim", "M", "H", "G", "vectors", "info"}
        assert set(file["fclib_global/vectors"]) == {"f", "w", "mu", "b"}
        assert file["fclib_global/spacedim"].shape == (1,)
        assert file["fclib_global/spacedim"].dtype == np.int32
        assert all(dataset.dtype == np.float64 for dataset in file["fclib_global/vectors"].values())
        assert set(file["fclib_global/info"]) == {"title"}
        title = file["fclib_global/info/title"]
        assert title.shape == () and not title.id.get_type().is_variable_str()
        assert title.id.get_type().get_size() == len("Ä".encode()) + 1
        assert file["guesses/number_of_guesses"][:].tolist() == [1]
        assert set(file["guesses/1"]) == {"v", "u", "r", "l"}


def test_compression_pays(tmp_path):
    problem = GlobalProblem(sp.eye_array(9000), sp.eye_array(9000), np.zeros(9000), np.zeros(9000), np.full(3000, 0.5))
    plain = write_fclib(tmp_path / "plain.hdf5", problem, compression=False).stat().st_size
    assert 5 * write_fclib(tmp_path / "small.hdf5", problem).stat().st_size < plain


def test_a_failed_write_leaves_the_old_file_whole(tmp_path):
    problem = make_problem("global")
    path = write_fclib(tmp_path / "a.hdf5", problem)
    before = path.read_bytes()
    with pytest.raises(InputError, match=r"solution, u: expected shape \(12,\), got \(3,\)"):
        write_fclib(path, problem, solution=Solution(np.zeros(3), np.zeros(12), np.zeros(17)))
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"storage": "coo"}, "storage: expected 'csc', 'csr' or 'triplet', got 'coo'"),
        ({"solution": Solution(np.zeros(12), np.zeros(12))}, "expected the vector v of 17 entries, got none"),
        ({"guesses": [Solution(np.zeros(12), np.full(12, np.nan), np.zeros(17))]}, "r: expected finite numbers"),
        # the real parts, and what lies under a mask, were written without a word
        ({"solution": Solution(np.zeros(12), np.zeros(12, complex), np.zeros(17))}, "r: expected a vector of real numbers, got values of"),
        ({"solution": Solution(np.zeros(12), np.ma.masked_all(12), np.zeros(17))}, "r: expected a vector .*, got a masked array"),
        ({"solution": {"r": 1}}, "solution: expected a Solution, got {'r': 1}"),
        ({"guesses": None}, "guesses: expected a list of Solutions, got None"),
        ({"title": b"x"}, "title: expected a text, got b'x'"),
        ({"compression": "gzip"}, "compression: expected True, False or a Compressor, got 'gzip'"),
    ],
)
def test_what_cannot_be_written_is_refused(tmp_path, changes, message):
    with pytest.raises(InputError, match=message):
        write_fclib(tmp_path / "a.hdf5", make_problem("global"), **changes)
    assert not list(tmp_path.iterdir())


def test_a_missing_folder_and_a_foreign_problem_are_refused(tmp_path):
    with pytest.raises(InputError, match="expected the name of a file to write, this is a folder"):
        write_fclib(tmp_path, make_problem("local"))
    with pytest.raises(InputError, match=r"nowhere.a\.hdf5: expected an existing folder"):
        write_fclib(tmp_path / "nowhere" / "a.hdf5", make_problem("local"))
    with pytest.raises(InputError, match=r"problem: expected a GlobalProblem, .* got dict"):
        write_fclib(tmp_path / "a.hdf5", {})


def test_sizes_beyond_32_bits_are_refused(tmp_path):
    with h5py.File(tmp_path / "matrix.hdf5", "w") as file, pytest.raises(InputError, match="A/m: expected at most 2147483647"):
        _write_matrix(file.create_group("A"), sp.coo_array((2**31, 3)), "csc", Compressor())


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"mu_r": np.full(4, -1.0)}, "mu_r: expected coefficients >= 0"),
        ({"mu": np.zeros(3)}, "mu: expected 4 coefficients for 20 contact unknowns, got 3"),
        ({"dimension": 3}, "dimension: expected 5"),
        ({"b": None}, "G and b: expected both or none"),
        ({"H": sp.csr_array((17, 3))}, "H: expected shape"),
    ],
)
def test_rolling_problems_are_checked(changes, message):
    problem = make_problem("global_rolling", p=2)
    arguments = {name: getattr(problem, name) for name in problem.__dataclass_fields__}
    with pytest.raises(InputError, match=message):
        GlobalRollingProblem(**(arguments | changes))


def test_file_names_are_those_of_the_collection():
    """The example of FCLIB's collection."""
    assert file_name("LMGC_LowWall_FEM", 56, 688, 272) == "LMGC_LowWall_FEM-i00056-688-00272.hdf5"
    with pytest.raises(InputError, match="iterations, contacts and step >= 0, got -1, 3 and 4"):
        file_name("SET", -1, 3, 4)


def test_the_package_needs_neither_dolfinx_nor_gmsh_nor_petsc():
    script = "import sys, fcsim.export_fclib; print(sorted({'dolfinx', 'gmsh', 'petsc4py', 'mpi4py', 'pyvista'} & set(sys.modules)))"
    root = Path(__file__).parents[3]
    run = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, cwd=root, check=True)
    assert run.stdout.strip() == "[]"


def test_spinning_friction_is_written_as_the_two_moments_of_fclibs_rolling_problems(tmp_path):
    """Where mu_s > 0 they are (S, nothing): the file's problem has the same answers; one contact with both resistances is refused."""
    rng, nc, n = np.random.default_rng(3), 3, 12
    A, w = rng.standard_normal((n, n)), rng.standard_normal(6 * nc)
    w[::6] -= 2
    mu_r, mu_s = np.array([0.3, 0.0, 0.0]), np.array([0.0, 0.2, 0.0])
    p = GlobalRollingProblem(
        A @ A.T + np.eye(n), rng.standard_normal((n, 6 * nc)), rng.standard_normal(n), w, np.full(nc, 0.4), mu_r, mu_s=mu_s
    )
    one = solve(p, "auto", tol=1e-11)
    file = write_fclib(tmp_path / "spin.hdf5", p, solution=Solution(one.u, one.r, one.v), guesses=[Solution(one.u, one.r, one.v)])
    content = read_fclib(file)
    assert content.problem.dimension == 5 and content.problem.mu_r.tolist() == [0.3, 0.2, 0.0] and len(content.guesses) == 1
    other = solve(content.problem, "auto", tol=1e-11)
    assert one.solved and other.solved
    np.testing.assert_allclose(other.v, one.v, atol=1e-9)
    np.testing.assert_allclose(content.solution.r, other.r, atol=1e-8)
    r = one.r.reshape(-1, 6)
    np.testing.assert_allclose(other.r.reshape(-1, 5)[1, 3:], [r[1, 5], 0], atol=1e-8)
    both = GlobalRollingProblem(p.M, p.H, p.f, p.w, p.mu, mu_r + 0.1, mu_s=mu_s)
    with pytest.raises(InputError, match="contact 1: has rolling and spinning resistance, as 1 of 3 contacts"):
        write_fclib(tmp_path / "both.hdf5", both)
    with pytest.raises(InputError, match="solution: expected u and r of 18 entries, got shape"):
        write_fclib(tmp_path / "short.hdf5", p, solution=Solution(one.u[:5], one.r[:5], one.v))
    assert not (tmp_path / "both.hdf5").exists()
