"""Write an FCLIB file (HDF5) that the reference library (FCLIB 3.1) and `fcsim.export_fclib.read_fclib` accept."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path

import h5py
import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from fcsim.brief import shown
from fcsim.errors import InputError
from fcsim.export_fclib.chunks import Compressor
from fcsim.export_fclib.content import FORMS, Solution, Storage, solution_sizes
from fcsim.export_fclib.rolling import two_moments
from fcsim.files import path_of, replacing_hdf5
from fcsim.linear.over_ranks.implicit_matrix import with_entries
from fcsim.problem import LocalProblem, Matrix
from fcsim.problem.problem import GlobalForm

INT_MAX = np.iinfo(np.int32).max


def write_fclib(
    path: str | PathLike[str],
    problem: GlobalForm | LocalProblem,
    *,
    solution: Solution | None = None,
    guesses: Sequence[Solution] = (),
    title: str | None = None,
    description: str | None = None,
    math_info: str | None = None,
    storage: Storage = "csc",
    compression: bool | Compressor = True,
) -> Path:
    """Write `problem` in its own form (global, local, global rolling) to `path`, whole or not at all, and return the path.

    Compressed columns are the default because FCLIB's merit function multiplies correctly with nothing else. `compression` stores
    chunked, shuffled gzip data sets, about 5 times smaller, which the reference library reads as they are; files of one series, given
    the same Compressor, compress only what differs from the file before. Matrix entries stored twice are summed, explicit zeros are kept.
    Problems with spinning friction are written as FCLIB's rolling problems where no contact has both resistances, see `two_moments`.
    Raises InputError for a storage, a solution, a text or a folder that does not fit, and for sizes beyond FCLIB's 32-bit integers.
    """
    path = path_of("path", "an FCLIB file to write", path)
    if storage not in ("csc", "csr", "triplet"):
        raise InputError(f"storage: expected 'csc', 'csr' or 'triplet', got {storage!r}")
    if not path.parent.is_dir():
        raise InputError(f"{path}: expected an existing folder, {path.parent} is none")
    if path.is_dir():
        raise InputError(f"{path}: expected the name of a file to write, this is a folder")
    name = next((name for name, form in FORMS.items() if isinstance(problem, form.problem)), None)
    if name is None:
        raise InputError(f"problem: expected a GlobalProblem, LocalProblem or GlobalRollingProblem, got {type(problem).__name__}")
    texts = {"title": title, "description": description, "math_info": math_info}
    _refuse_kinds(solution, guesses, texts, compression)
    problem, (solution, *others) = two_moments(problem, (solution, *guesses))
    guesses = [guess for guess in others if guess is not None]
    form = FORMS[name]
    compressor = Compressor() if compression is True else compression or None
    with replacing_hdf5(path) as file:
        group = file.create_group(f"fclib_{name}")
        _write_integer(group, "spacedim", problem.dimension)
        for letter in (*form.matrices, *form.optional_matrices):
            if (matrix := getattr(problem, letter)) is not None:
                _write_matrix(group.create_group(letter), with_entries(matrix), storage, compressor)
        vectors = group.create_group("vectors")
        for letter in (*form.vectors, form.optional_vector):
            if (vector := getattr(problem, letter)) is not None:
                _write_array(vectors, letter, vector, compressor)
        _write_info(group, texts)
        if solution is not None:
            _write_solution(file.create_group("solution"), solution, problem, compressor)
        if guesses:
            group = file.create_group("guesses")
            _write_integer(group, "number_of_guesses", len(guesses))
            for number, guess in enumerate(guesses, start=1):
                _write_solution(group.create_group(str(number)), guess, problem, compressor)
    return path


def _refuse_kinds(solution: object, guesses: object, texts: Mapping[str, object], compression: object) -> None:
    """InputError where an argument is of another kind than `write_fclib` says."""
    if not isinstance(solution, Solution | None):
        raise InputError(f"solution: expected a Solution, got {shown(solution)}")
    if not isinstance(guesses, Sequence) or not all(isinstance(guess, Solution) for guess in guesses):
        raise InputError(f"guesses: expected a list of Solutions, got {shown(guesses)}")
    for name, text in texts.items():
        if not isinstance(text, str | None):
            raise InputError(f"{name}: expected a text, got {shown(text)}")
    if not isinstance(compression, bool | Compressor):
        raise InputError(f"compression: expected True, False or a Compressor, got {shown(compression)}")


def file_name(collection: str, iterations: int, nc: int, step: int) -> str:
    """Return `<collection>-i<iterations>-<nc>-<step>.hdf5`, iterations and step with 5 digits, as FCLIB's collection names its files.

    `iterations` are those of the solver that produced the problem: a measure of its difficulty.
    """
    if min(iterations, nc, step) < 0:
        raise InputError(f"file name: expected iterations, contacts and step >= 0, got {iterations}, {nc} and {step}")
    return f"{collection}-i{iterations:05d}-{nc}-{step:05d}.hdf5"


def _write_array(group: h5py.Group, name: str, values: NDArray[np.generic], compressor: Compressor | None) -> None:
    values = values.astype(np.int32 if values.dtype.kind in "iu" else np.float64, copy=False)
    if compressor is None or not len(values):
        group.create_dataset(name, data=values)
    else:
        compressor.write(group, name, values)


def _write_integer(group: h5py.Group, name: str, value: int) -> None:
    if value > INT_MAX:
        raise InputError(f"{group.name}/{name}: expected at most {INT_MAX}, the largest integer of an FCLIB file, got {value}")
    group.create_dataset(name, data=np.array([value], dtype=np.int32))


def _write_matrix(group: h5py.Group, matrix: Matrix, storage: Storage, compressor: Compressor | None) -> None:
    """Write a sparse or dense matrix; triplets have their columns in `p` and their rows in `i`, as CSparse and real files do."""
    lines = (sp.csr_array if storage == "csr" else sp.csc_array)(matrix)
    if not lines.has_canonical_format:
        lines = lines.copy()
        lines.sum_duplicates()
    for name, value in (("m", lines.shape[0]), ("n", lines.shape[1]), ("nzmax", lines.nnz)):
        _write_integer(group, name, value)
    if storage == "triplet":
        row, column = lines.tocoo().coords
        _write_integer(group, "nz", lines.nnz)
        pointers, indices = column, row
    else:
        _write_integer(group, "nz", -1 if storage == "csc" else -2)
        pointers, indices = lines.indptr, lines.indices
    _write_array(group, "p", pointers, compressor)
    _write_array(group, "i", indices, compressor)
    _write_array(group, "x", lines.data, compressor)


def _write_info(group: h5py.Group, texts: Mapping[str, str | None]) -> None:
    given = {name: text.encode("utf-8", "backslashreplace") for name, text in texts.items() if text is not None}
    if given:
        info = group.create_group("info")
        for name, text in given.items():  # one byte more than the text: the reference library wants the closing NUL
            info.create_dataset(name, data=np.bytes_(text), dtype=f"S{len(text) + 1}")


def _write_solution(group: h5py.Group, solution: Solution, problem: GlobalForm | LocalProblem, compressor: Compressor | None) -> None:
    for name, size in solution_sizes(problem).items():
        vector = getattr(solution, name)
        if vector is None:
            raise InputError(f"solution: expected the vector {name} of {size} entries, got none")
        masked = isinstance(vector, np.ma.MaskedArray)
        if masked or np.asarray(vector).dtype.kind not in "fiu":
            got = "a masked array" if masked else f"values of type {np.asarray(vector).dtype}"
            raise InputError(f"solution, {name}: expected a vector of real numbers, got {got}")
        vector = np.asarray(vector, dtype=np.float64)
        if vector.shape != (size,):
            raise InputError(f"solution, {name}: expected shape ({size},), got {vector.shape}")
        if not np.all(np.isfinite(vector)):
            raise InputError(f"solution, {name}: expected finite numbers, got NaN or infinity")
        _write_array(group, name, vector, compressor)
