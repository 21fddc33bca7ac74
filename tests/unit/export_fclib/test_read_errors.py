"""Whatever is wrong with a file ends in one InputError that names the file and the place; what real files do is accepted."""

import os
import re

import h5py
import numpy as np
import pytest
import scipy.sparse as sp

from fcsim.errors import InputError
from fcsim.export_fclib import Solution, read_fclib, write_fclib
from fcsim.problem import GlobalProblem, LocalProblem


@pytest.fixture
def path(tmp_path):
    """A global problem of one contact: n = 4, m = 3, M and H in compressed columns."""
    H = np.arange(1.0, 13).reshape(4, 3)
    problem = GlobalProblem(sp.eye_array(4), sp.csr_array(H), np.ones(4), np.arange(3.0), np.array([0.5]))
    solution = Solution(np.ones(3), np.ones(3), np.ones(4))
    return write_fclib(tmp_path / "one.hdf5", problem, solution=solution, guesses=[solution], title="one", compression=False)


def put(file, name, values):
    if name in file:
        del file[name]
    file[name] = values


def move(file, old, new):
    file.move(old, new)


def group_with(file, name, **datasets):
    group = file.create_group(name)
    for key, value in datasets.items():
        group[key] = value


MATRIX = "fclib_global/H"
CHANGES = {
    "no group": (lambda f: move(f, "fclib_global", "other"), "expected one of the groups /fclib_global, .* got none"),
    "two groups": (lambda f: f.create_group("fclib_local"), "got /fclib_global and /fclib_local"),
    "a dataset as group": (lambda f: put(f, "fclib_global", [1.0]), "/fclib_global: expected a group, got a dataset"),
    "no M": (lambda f: f.pop("fclib_global/M"), "/fclib_global/M: expected a group, got nothing"),
    "M a dataset": (lambda f: put(f, "fclib_global/M", np.eye(4)), "/fclib_global/M: expected a group, got a dataset"),
    "no vectors": (lambda f: f.pop("fclib_global/vectors"), "/fclib_global/vectors: expected a group, got nothing"),
    "no w": (lambda f: f.pop("fclib_global/vectors/w"), "/fclib_global/vectors/w: expected a vector of numbers, got nothing"),
    "no x": (lambda f: f.pop(f"{MATRIX}/x"), "/fclib_global/H/x: expected a vector of numbers, got nothing"),
    "no spacedim": (lambda f: f.pop("fclib_global/spacedim"), "/fclib_global/spacedim: expected an integer, got nothing"),
    "spacedim 5": (lambda f: put(f, "fclib_global/spacedim", [5]), "/fclib_global/spacedim: expected 2 or 3, got 5"),
    "spacedim 2": (
        lambda f: put(f, "fclib_global/spacedim", [2]),
        r"mu: expected a friction coefficient for every 2 contact unknowns in 2D, got 1 for 3 \(as many as in 3D",
    ),
    "spacedim a vector": (
        lambda f: put(f, "fclib_global/spacedim", [3, 3]),
        r"spacedim: expected an integer, got an array of shape \(2,\)",
    ),
    "spacedim a real": (lambda f: put(f, "fclib_global/spacedim", [3.0]), "spacedim: expected an integer, got values of type float64"),
    "f too short": (
        lambda f: put(f, "fclib_global/vectors/f", np.ones(3)),
        r"M: expected the shape \(3, 3\) of the vectors \(f, f\), got m, n = 4, 4",
    ),
    "w too long": (
        lambda f: put(f, "fclib_global/vectors/w", np.ones(6)),
        r"H: expected the shape \(4, 6\) of the vectors \(f, w\), got m, n = 4, 3",
    ),
    "mu too long": (lambda f: put(f, "fclib_global/vectors/mu", [1, 1]), "mu: expected 1 friction coefficients for 3 .* in 3D, got 2"),
    "w a table": (lambda f: put(f, "fclib_global/vectors/w", np.ones((3, 1))), r"vectors/w: expected shape \(any,\), got \(3, 1\)"),
    "w NaN": (lambda f: put(f, "fclib_global/vectors/w", [0, np.nan, 0]), "vectors/w: expected finite numbers, got NaN"),
    "w texts": (lambda f: put(f, "fclib_global/vectors/w", [b"a", b"b", b"c"]), "vectors/w: expected a vector of numbers, got values of"),
    "mu negative": (lambda f: put(f, "fclib_global/vectors/mu", [-0.5]), "mu: expected friction coefficients >= 0, got -0.5 at contact 0"),
    "M infinite": (lambda f: put(f, "fclib_global/M/x", [1, 1, np.inf, 1]), "/fclib_global/M/x: expected finite numbers, got NaN or inf"),
    "p too short": (lambda f: put(f, f"{MATRIX}/p", np.array([0, 4, 8])), r"H/p: expected at least 4 entries, got shape \(3,\)"),
    "p decreases": (lambda f: put(f, f"{MATRIX}/p", np.array([0, 8, 4, 12])), "H/p: expected pointers that start at 0 and never decrease"),
    "p starts late": (
        lambda f: put(f, f"{MATRIX}/p", np.array([1, 4, 8, 12])),
        "H/p: expected pointers that start at 0 and never decrease",
    ),
    "i too short": (lambda f: put(f, f"{MATRIX}/i", np.zeros(11, int)), r"H/i: expected at least 12 entries, got shape \(11,\)"),
    "x too short": (lambda f: put(f, f"{MATRIX}/x", np.zeros(11)), r"H/x: expected at least 12 entries, got shape \(11,\)"),
    "i too large": (lambda f: put(f, f"{MATRIX}/i", np.full(12, 4)), "H/i: expected indices 0 ... 3, got 4 ... 4"),
    "i negative": (lambda f: put(f, f"{MATRIX}/i", np.full(12, -1)), "H/i: expected indices 0 ... 3, got -1 ... -1"),
    "i reals": (lambda f: put(f, f"{MATRIX}/i", np.zeros(12)), "H/i: expected a vector of integers, got values of type float64"),
    "m negative": (lambda f: put(f, f"{MATRIX}/m", [-4]), r"H: expected the shape \(4, 3\) .*, got m, n = -4, 3"),
    "nz unknown": (lambda f: put(f, f"{MATRIX}/nz", [-3]), "H/nz: expected -1 .*, got -3"),
    "nzmax small": (lambda f: put(f, f"{MATRIX}/nzmax", [11]), "H/nzmax: expected at least the 12 entries of the matrix, got 11"),
    "G without b": (lambda f: f.copy(f["fclib_global/H"], f["fclib_global"], name="G"), "vectors/b: expected a vector .*, got nothing"),
    "b without G": (lambda f: put(f, "fclib_global/vectors/b", np.ones(2)), "/fclib_global/G: expected a group, got nothing"),
    "solution without v": (lambda f: f.pop("solution/v"), "/solution/v: expected a vector of numbers, got nothing"),
    "solution short": (lambda f: put(f, "solution/r", np.ones(2)), r"/solution/r: expected shape \(3,\), got \(2,\)"),
    "guess missing": (lambda f: put(f, "guesses/number_of_guesses", [2]), "/guesses/2: expected a group, got nothing"),
    "guesses negative": (lambda f: put(f, "guesses/number_of_guesses", [-1]), "number_of_guesses: expected a number >= 0, got -1"),
    "guess NaN": (lambda f: put(f, "guesses/1/u", [0, 0, np.nan]), "/guesses/1/u: expected finite numbers"),
    "title a number": (lambda f: put(f, "fclib_global/info/title", 3), "info/title: expected a text, got values of type int64"),
}


@pytest.mark.parametrize("name", CHANGES)
def test_a_spoilt_file_is_refused(path, name):
    change, message = CHANGES[name]
    with h5py.File(path, "r+") as file:
        change(file)
    with pytest.raises(InputError, match=re.escape(f"{path}: ") + ".*" + f"(?:{message})"):
        read_fclib(path)


@pytest.mark.parametrize(
    ("name", "values", "message"),
    [("p", [0, 3], "W/p: expected indices 0 ... 2, got 0 ... 3"), ("i", [0, -1], "W/i: expected indices 0 ... 2")],
)
def test_triplet_indices_out_of_range_are_refused(tmp_path, name, values, message):
    W = sp.coo_array((np.ones(2), ([0, 1], [0, 1])), shape=(3, 3))
    path = write_fclib(tmp_path / "a.hdf5", LocalProblem(W, np.ones(3), np.ones(1)), storage="triplet", compression=False)
    with h5py.File(path, "r+") as file:
        put(file, f"fclib_local/W/{name}", np.array(values))
    with pytest.raises(InputError, match=message):
        read_fclib(path)


def test_a_compressed_matrix_that_says_it_has_triplets_is_refused(path):
    """nz = 1 beside the pointers of columns: it would be read as one of its entries, another problem."""
    with h5py.File(path, "r+") as file:
        put(file, "fclib_global/H/nz", [1])
    with pytest.raises(InputError, match=r"fclib_global/H: expected 1 triplets \(nz\), of which p, i and x are of one length, got lengths"):
        read_fclib(path)


def test_constraints_of_a_local_problem_are_all_there_or_none(tmp_path):
    path = write_fclib(tmp_path / "a.hdf5", LocalProblem(np.eye(3), np.ones(3), np.ones(1), np.ones((3, 1)), np.eye(1), np.ones(1)))
    with h5py.File(path, "r+") as file:
        del file["fclib_local/R"]
    with pytest.raises(InputError, match="/fclib_local/R: expected a group, got nothing"):
        read_fclib(path)


def test_what_is_no_hdf5_file_is_refused(tmp_path):
    (tmp_path / "text.hdf5").write_text("not HDF5")
    (tmp_path / "empty.hdf5").touch()
    for name, message in (("text", "expected an HDF5 file"), ("empty", "expected an HDF5 file"), ("none", "no such file")):
        with pytest.raises(InputError, match=rf"{name}\.hdf5: .*{message}"):
            read_fclib(tmp_path / f"{name}.hdf5")
    with pytest.raises(InputError, match="found a folder"):
        read_fclib(tmp_path)
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(InputError, match="found a pipe or a device"):  # "no such file" was said of it
        read_fclib(tmp_path / "pipe")


def test_a_file_cut_anywhere_is_refused(path, tmp_path):
    whole, cut = path.read_bytes(), tmp_path / "cut.hdf5"
    for size in np.linspace(0, len(whole) - 1, 60, dtype=int):
        cut.write_bytes(whole[:size])
        with pytest.raises(InputError, match=r"cut\.hdf5: (expected an HDF5 file|the HDF5 file is truncated or damaged)"):
            read_fclib(cut)


def test_damaged_bytes_end_in_an_input_error_or_in_a_problem(path, tmp_path):
    """Bits flipped anywhere may leave a valid file (in a number or a text), but never another kind of error."""
    rng, whole, refused = np.random.default_rng(5), path.read_bytes(), 0
    for _ in range(120):
        spoilt = bytearray(whole)
        spoilt[int(rng.integers(len(whole)))] ^= int(rng.integers(1, 256))
        (tmp_path / "spoilt.hdf5").write_bytes(spoilt)
        try:
            read_fclib(tmp_path / "spoilt.hdf5")
        except InputError:
            refused += 1
    assert refused > 0


def test_a_file_with_less_is_read(path):
    with h5py.File(path, "r+") as file:
        for name in ("solution", "guesses", "fclib_global/info"):
            del file[name]
    content = read_fclib(path)
    assert content.solution is None and content.guesses == () and content.info.title == ""


def test_habits_of_real_files_are_accepted(path):
    """Scalars of shape (), 64-bit integers, arrays longer than needed, texts that are not UTF-8, attributes, matrix properties."""
    expected = read_fclib(path).problem
    with h5py.File(path, "r+") as file:
        put(file, "fclib_global/spacedim", 3)
        for name in ("m", "n", "nz"):
            put(file, f"fclib_global/H/{name}", int(file[f"fclib_global/H/{name}"][0]))
        put(file, "fclib_global/H/nzmax", [20])
        put(file, "fclib_global/H/x", np.concatenate([file["fclib_global/H/x"][:], np.full(8, np.nan)]))
        put(file, "fclib_global/H/i", np.concatenate([file["fclib_global/H/i"][:], np.full(8, -7)]).astype(np.int64))
        put(file, "fclib_global/info/title", np.bytes_(b"mod\xe8le"))
        put(file, "fclib_global/info/description", "variable length ∥")
        for name, value in (("comment", "SPD"), ("conditioning", [2.5]), ("determinant", [1e300]), ("rank", [4])):
            put(file, f"fclib_global/M/{name}", value)
        file["fclib_global/H"].attrs["cond"] = 1.0
    content = read_fclib(path)
    assert np.array_equal(content.problem.H.toarray(), expected.H.toarray())
    assert content.matrices["H"].nzmax == 20 and content.matrices["H"].nnz == 12 and content.matrices["H"].conditioning is None
    M = content.matrices["M"]
    assert (M.shape, M.nnz, M.storage, M.comment, M.conditioning, M.determinant, M.rank) == ((4, 4), 4, "csc", "SPD", 2.5, 1e300, 4)
    assert content.info.title == "mod\ufffdle"
    assert content.info.description == "variable length ∥"


def test_triplets_of_the_same_place_are_summed(tmp_path):
    path = write_fclib(
        tmp_path / "a.hdf5", LocalProblem(np.eye(2), np.ones(2), np.ones(1), dimension=2), storage="triplet", compression=False
    )
    with h5py.File(path, "r+") as file:
        for name, values in (("p", [1, 0, 1]), ("i", [0, 1, 0]), ("x", [2.0, 3.0, 5.0]), ("nz", [3]), ("nzmax", [9])):
            put(file, f"fclib_local/W/{name}", np.array(values))
    assert read_fclib(path).problem.W.toarray().tolist() == [[0, 7], [3, 0]]
