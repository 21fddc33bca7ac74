"""Read an FCLIB file (HDF5): one frictional contact problem with its solution and guesses.

The layout is that of FCLIB 3.1 (Acary, Brémond, Koziara, Pérignon, INRIA report RT-0444). Real files differ in how they store it:
compressed columns, compressed rows and triplets are read, scalars of shape (1,) or (), arrays longer than needed, texts that are not
UTF-8, and missing info, solution or guesses; attributes are ignored.
"""

from __future__ import annotations

from collections.abc import Callable
from os import PathLike
from pathlib import Path
from typing import cast

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from fcsim.apart import Array, Group, Link, opened_apart
from fcsim.errors import InputError
from fcsim.export_fclib.content import FORMS, FclibFile, Info, MatrixInfo, Problem, Solution, Storage, solution_sizes
from fcsim.files import path_of

COMPRESSED: dict[int, tuple[Storage, type[sp.csc_array] | type[sp.csr_array]]] = {-1: ("csc", sp.csc_array), -2: ("csr", sp.csr_array)}


def read_fclib(path: str | PathLike[str]) -> FclibFile:
    """Read the problem of `path` in whichever form and storage it has.

    Matrices come as csc_array or csr_array, triplets as csc_array; entries stored twice are summed. A stored solution is returned as
    it stands: real files hold zeros there, so verify it. The file is read by another process, with limits (`fcsim.apart`).
    Raises InputError, with the file and the place in it, where the file cannot be read or contradicts itself.
    """
    path = path_of("path", "an FCLIB file", path)
    if not path.is_file():
        found = "a folder" if path.is_dir() else "a pipe or a device" if path.exists() else "no such file"
        raise InputError(f"{path}: expected an FCLIB file, found {found}")
    try:
        return _read(path, opened_apart(path))
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    except (OSError, KeyError, TypeError, ValueError, OverflowError, MemoryError) as error:
        raise InputError(f"{path}: the HDF5 file is truncated or damaged: {error}") from error


def _read(path: Path, file: Group) -> FclibFile:
    found = [name for name in FORMS if f"fclib_{name}" in file]
    if len(found) != 1:
        expected = ", ".join(f"/fclib_{name}" for name in FORMS)
        raise InputError(f"expected one of the groups {expected}, got {' and '.join(f'/fclib_{name}' for name in found) or 'none'}")
    (name,) = found
    form, group = FORMS[name], _group(file, f"fclib_{name}")
    spacedim = _integer(group, "spacedim")
    if spacedim not in form.spacedim:
        raise InputError(f"{group.name}/spacedim: expected {' or '.join(map(str, form.spacedim))}, got {spacedim}")

    vectors = _group(group, "vectors")
    constrained = any(letter in group for letter in form.optional_matrices) or form.optional_vector in vectors
    arrays = {letter: _vector(vectors, letter) for letter in form.vectors + ((form.optional_vector,) if constrained else ())}
    matrices = {
        letter: _matrix(_group(group, letter), (len(arrays[row]), len(arrays[column])), f"({row}, {column})")
        for letter, (row, column) in {**form.matrices, **(form.optional_matrices if constrained else {})}.items()
    }
    made: Callable[..., Problem] = form.problem
    problem = made(**{letter: matrix for letter, (matrix, _) in matrices.items()}, **arrays, dimension=spacedim)

    return FclibFile(
        path=path,
        form=name,
        problem=problem,
        info=_info(_group(group, "info")) if "info" in group else Info(),
        matrices={letter: about for letter, (_, about) in matrices.items()},
        solution=_solution(_group(file, "solution"), problem) if "solution" in file else None,
        guesses=_guesses(_group(file, "guesses"), problem) if "guesses" in file else (),
    )


def _entry(parent: Group, name: str) -> Group | Array | None:
    """What a group holds under a name; nothing that lies elsewhere, or unpacks to far more than the file holds."""
    entry = parent.get(name)
    if isinstance(entry, Link):
        other = "a link to another" if entry.kind == "ExternalLink" else "a soft link, which is not followed: store the data or a hard link"
        raise InputError(f"{_place(parent, name)}: expected the problem within this file, got {other}")
    if isinstance(entry, Array) and entry.elsewhere:
        raise InputError(f"{_place(parent, name)}: expected the problem within this file, got data stored in others")
    return entry


UNPACKED, UNPACKED_PER_BYTE = 64 * 2**20, 200
"""[bytes] What is read of a dataset may take so much memory, and so much for each byte that it has in the file: zeros shrink most."""


def _refuse_bomb(dataset: Array, count: int | None) -> None:
    entries = dataset.size if count is None else min(dataset.size, count)
    if entries * dataset.dtype.itemsize > UNPACKED + UNPACKED_PER_BYTE * dataset.stored:
        raise InputError(f"{dataset.name}: expected data, got {dataset.stored} bytes that unpack to {dataset.size} entries")


def _group(parent: Group, name: str) -> Group:
    group = _entry(parent, name)
    if not isinstance(group, Group):
        raise InputError(f"{_place(parent, name)}: expected a group, got {'nothing' if group is None else 'a dataset'}")
    return group


def _array(group: Group, name: str, kinds: str, what: str, count: int | None = None) -> NDArray[np.generic]:
    """The array of this name, of a vector the first `count` entries."""
    dataset = _entry(group, name)
    if not isinstance(dataset, Array):
        raise InputError(f"{_place(group, name)}: expected {what}, got {'nothing' if dataset is None else 'a group'}")
    if dataset.dtype.kind not in kinds:
        raise InputError(f"{dataset.name}: expected {what}, got values of type {dataset.dtype}")
    _refuse_bomb(dataset, count)
    return np.asarray(dataset[()] if count is None or dataset.ndim != 1 else dataset[: max(count, 0)])


def _place(group: Group, name: str) -> str:
    return f"{str(group.name).rstrip('/')}/{name}"


def _scalar(group: Group, name: str, kinds: str, what: str) -> NDArray[np.generic]:
    """A data set of one value (), whose `item` gives that as one of Python's own."""
    array = _array(group, name, kinds, what)
    if array.size != 1:
        raise InputError(f"{_place(group, name)}: expected {what}, got an array of shape {array.shape}")
    return array.reshape(())


def _integer(group: Group, name: str) -> int:
    return int(_scalar(group, name, "iu", "an integer").item())


def _text(group: Group, name: str) -> str:
    text = _scalar(group, name, "SO", "a text").item()
    return text.decode(errors="replace") if isinstance(text, bytes) else str(text)


def _vector(group: Group, name: str, size: int | None = None) -> NDArray[np.float64]:
    vector = np.asarray(_array(group, name, "fiu", "a vector of numbers"), dtype=np.float64)
    if vector.ndim != 1 or size not in (None, len(vector)):
        raise InputError(f"{_place(group, name)}: expected shape ({'any' if size is None else size},), got {vector.shape}")
    if not np.all(np.isfinite(vector)):
        raise InputError(f"{_place(group, name)}: expected finite numbers, got NaN or infinity")
    return vector


def _indices(group: Group, name: str, count: int) -> NDArray[np.integer]:
    return cast(NDArray[np.integer], _head(group, name, count, "iu", "a vector of integers"))


def _head(group: Group, name: str, count: int, kinds: str, what: str) -> NDArray[np.generic]:
    """Return the first `count` entries of a dataset that may be longer."""
    array = _array(group, name, kinds, what, count)
    if array.ndim != 1 or len(array) < count:
        raise InputError(f"{_place(group, name)}: expected at least {count} entries, got shape {array.shape}")
    return array


def _in_range(indices: NDArray[np.integer], size: int, group: Group, name: str) -> None:
    if indices.size and (indices.min() < 0 or indices.max() >= size):
        raise InputError(f"{_place(group, name)}: expected indices 0 ... {size - 1}, got {indices.min()} ... {indices.max()}")


def _matrix(group: Group, shape: tuple[int, int], vectors: str) -> tuple[sp.csc_array | sp.csr_array, MatrixInfo]:
    """Return the matrix of a group and what is said of it; `shape` is that which the lengths of `vectors` ask for."""
    rows, columns, nz, nzmax = (_integer(group, name) for name in ("m", "n", "nz", "nzmax"))
    if (rows, columns) != shape:
        raise InputError(f"{group.name}: expected the shape {shape} of the vectors {vectors}, got m, n = {rows}, {columns}")
    if nz < -2:
        raise InputError(f"{group.name}/nz: expected -1 (columns), -2 (rows) or a number of triplets, got {nz}")
    storage: Storage
    if nz >= 0:
        count, storage = nz, "triplet"
        # CSparse's convention, which real files follow: p holds the columns (the comment in fclib.h says rows)
        pointers, indices = _indices(group, "p", count), _indices(group, "i", count)
        _in_range(pointers, columns, group, "p")
        _in_range(indices, rows, group, "i")
    else:
        storage, compressed = COMPRESSED[nz]
        lines, length = (columns, rows) if storage == "csc" else (rows, columns)
        pointers = _indices(group, "p", lines + 1)
        if pointers[0] != 0 or np.any(np.diff(pointers.astype(np.int64)) < 0):
            raise InputError(f"{group.name}/p: expected pointers that start at 0 and never decrease")
        count = int(pointers[-1])
        indices = _indices(group, "i", count)
        _in_range(indices, length, group, "i")
    if count > nzmax:
        raise InputError(f"{group.name}/nzmax: expected at least the {count} entries of the matrix, got {nzmax}")
    values = _head(group, "x", count, "fiu", "a vector of numbers").astype(np.float64, copy=False)
    if not np.all(np.isfinite(values)):
        raise InputError(f"{group.name}/x: expected finite numbers, got NaN or infinity")

    if nz >= 0:
        lengths = [len(_array(group, name, "fiu", "a vector of numbers")) for name in ("p", "i", "x")]
        if len(set(lengths)) > 1:  # a compressed matrix whose nz is damaged would be read as a few of its entries
            raise InputError(f"{group.name}: expected {nz} triplets (nz), of which p, i and x are of one length, got lengths {lengths}")
        matrix = sp.coo_array((values, (indices, pointers)), shape=(rows, columns)).tocsc()
    else:
        matrix = compressed((values, indices, pointers), shape=(rows, columns))
        matrix.sum_duplicates()
    known = "conditioning" in group  # FCLIB takes the four as there when this one is
    return matrix, MatrixInfo(
        shape=(rows, columns),
        nnz=count,
        storage=storage,
        nzmax=nzmax,
        comment=_text(group, "comment") if "comment" in group else None,
        conditioning=float(_scalar(group, "conditioning", "fiu", "a number").item()) if known else None,
        determinant=float(_scalar(group, "determinant", "fiu", "a number").item()) if known and "determinant" in group else None,
        rank=_integer(group, "rank") if known and "rank" in group else None,
    )


def _info(group: Group) -> Info:
    return Info(**{name: _text(group, name) for name in ("title", "description", "math_info") if name in group})


def _solution(group: Group, problem: Problem) -> Solution:
    return Solution(**{name: _vector(group, name, size) for name, size in solution_sizes(problem).items()})


def _guesses(group: Group, problem: Problem) -> tuple[Solution, ...]:
    count = _integer(group, "number_of_guesses")
    if count < 0:
        raise InputError(f"{_place(group, 'number_of_guesses')}: expected a number >= 0, got {count}")
    return tuple(_solution(_group(group, str(number)), problem) for number in range(1, count + 1))
