"""Small pieces of a step's work, each done by one rank for all of them.

A processor reads some gigabytes a second from another one's memory: what takes a rank longer than reading half of the outcome is worth
sharing. Every rank has the bits that one process would have.
"""

from __future__ import annotations

import itertools
import threading
from collections.abc import Callable, Sequence
from copy import copy
from typing import cast

import numpy as np
import scipy.sparse as sp
from numpy.typing import DTypeLike, NDArray

from fcsim.arrays import FloatArray
from fcsim.ranks.mapped_memory import in_common
from fcsim.ranks.sharing import alone, world
from fcsim.ranks.world import World

KEPT_FROM = 1 << 16
"""[bytes] Smaller arrays that all ranks have are each rank's own: they are many, and take little."""
NUMBERS_FROM = 200_000
"""Numbers of a vector from which ranks make it together and a machine has it once. A step has a dozen of them: of 126 000 numbers they
took as much work as before, and 12 exchanges more."""


def shared_out(what: str, tasks: Sequence[tuple[int, Callable[[], FloatArray]]]) -> list[FloatArray]:
    """What tasks return, in their order: an array of so many numbers each. Rank k of n does those numbered k, k + n, ..., so that every
    rank has the bits that one process would have; an error of one is every rank's. Tasks exchange nothing themselves; all ranks must ask.

    An exchange takes a tenth of a millisecond: tasks should take more.
    """
    ranks = world()
    if ranks is None:
        return [task() for _, task in tasks]
    own, everyones = np.empty(0), list(range(len(tasks)))
    by_rank = [everyones[k :: ranks.size] for k in range(ranks.size)]
    with ranks.together(what), alone():
        own = np.concatenate([own, *(tasks[k][1]() for k in by_rank[ranks.number])])
    sizes = [size for size, _ in tasks]
    every = ranks.gathered(own, np.array([sum(sizes[k] for k in some) for some in by_rank]))
    order = [k for some in by_rank for k in some]
    parts = np.split(every, np.cumsum([sizes[k] for k in order])[:-1])
    return [part for _, part in sorted(zip(order, parts, strict=True), key=lambda both: both[0])]


def in_parts(what: str, rows: int, least: int, work: Callable[[int, int], None], *arrays: NDArray) -> None:
    """Have work(begin, end) write rows begin, ..., end - 1 of arrays (rows, ...), contiguous ones: each rank some of them, all of them
    where there are fewer than `least`.

    All ranks must ask; who asks on another thread than the program's first does all of it. Work exchanges nothing itself, and an error in
    it is this rank's alone, see `World.unasked`.
    """
    ranks = world()
    if ranks is None or rows < least:
        work(0, rows)
        return
    in_pieces(what, [rows * k // ranks.size for k in range(ranks.size + 1)], work, *arrays)


def in_parts_of_common(what: str, rows: int, work: Callable[[int, int], None], *arrays: NDArray) -> None:
    """As `in_parts` for arrays of `for_parts` where these are in memory in common, else every rank does all of it: to exchange them would
    take longer than to make them."""
    in_parts(what, rows, 0 if any(in_common(array) for array in arrays) else rows + 1, work, *arrays)


def in_pieces(what: str, ends: Sequence[int], work: Callable[[int, int], None], *arrays: NDArray) -> None:
    """As `in_parts`, rank k the rows ends[k] to ends[k + 1] - 1; ends (size + 1,), from 0 on."""
    ranks = world()
    if ranks is None or threading.current_thread() is not threading.main_thread():  # files are written beside the steps
        work(ends[0], ends[-1])
        return
    with ranks.unasked(what):
        with alone():
            work(ends[ranks.number], ends[ranks.number + 1])
        complete_rows(ranks, ends, *arrays)


def complete_rows(ranks: World, ends: Sequence[int], *arrays: NDArray) -> None:
    """Have arrays, of which this rank k has written the rows ends[k] to ends[k + 1] - 1, the others' rows too."""
    apart = [array for array in arrays if not in_common(array)]
    counts = [end - begin for begin, end in itertools.pairwise(ends)]
    for array in apart:
        ranks.complete(array, counts)
    if len(apart) < len(arrays) and ranks.common is not None:
        ranks.common.meet()


def for_parts(shape: tuple[int, ...], least: int, dtype: DTypeLike = np.float64) -> NDArray:
    """An array of any numbers whose rows are to be written by `in_parts`: where ranks of one machine share that, in memory that they have
    in common, so that nothing is copied. All ranks must ask.

    Work must write all of its rows, zeros too, and nothing else: the others write theirs at the same time. After that the array is read
    only: it is every rank's.
    """
    ranks = world()
    if ranks is None or ranks.common is None or shape[0] < least or threading.current_thread() is not threading.main_thread():
        return np.empty(shape, dtype=dtype)
    found = ranks.common.array(shape, dtype)
    return np.empty(shape, dtype=dtype) if found is None else found


def elementwise(what: str, size: int, make: Callable[[slice], FloatArray]) -> FloatArray:
    """The vector (size,) whose numbers `some` are make(some), each of which follows from these of other vectors alone: where ranks have
    memory in common each makes some, and a machine has the vector once; else every rank makes all. All ranks must ask, as in `in_parts`.

    Numbers that are put in later every rank puts in itself, before it reads them, and all of them the same.
    """
    if world() is None or size < NUMBERS_FROM:
        return make(slice(0, size))
    found: FloatArray = for_parts((size,), 0)

    def write(begin: int, end: int) -> None:
        found[begin:end] = make(slice(begin, end))

    in_parts_of_common(what, size, write, found)
    return found


def held_in_common[T](given: T) -> T:
    """What all ranks have alike, and keep, in memory that they have in common, so that a machine has it once: an array, a sparse one by
    rows or columns, or a named tuple of these, in which all else stays as it is; itself where there is no such memory. All ranks must ask.
    From then on nobody writes to it."""
    found: object = given
    if isinstance(given, np.ndarray):
        found = _held(given)
    elif isinstance(given, sp.csr_array | sp.csc_array):
        found = copy(given)
        for name in ("data", "indices", "indptr"):
            setattr(found, name, _held(getattr(given, name)))
    elif isinstance(given, tuple) and hasattr(given, "_make"):
        found = given._make(held_in_common(part) for part in given)
    return cast(T, found)


def _held(array: NDArray) -> NDArray:
    if in_common(array) or array.nbytes < KEPT_FROM or threading.current_thread() is not threading.main_thread():
        return array
    held = for_parts(array.shape, 0, array.dtype)
    if not in_common(held):
        return array

    def write(begin: int, end: int) -> None:
        held[begin:end] = array[begin:end]

    in_parts("arrays that all keep", len(held), 0, write, held)
    return held


def common_arrays(rows: int, least: int, *wanted: tuple[tuple[int, ...], DTypeLike]) -> list[NDArray] | None:
    """Arrays of shapes and types in memory that all ranks have in common, for `written`; None where there is none, or work on fewer rows
    than `least`: each rank then does all of it, since copying would take as long. All ranks must ask."""
    ranks = world()
    if ranks is None or ranks.common is None or rows < least or threading.current_thread() is not threading.main_thread():
        return None
    arrays = [found for shape, dtype in wanted if (found := ranks.common.array(shape, dtype)) is not None]
    return arrays if len(arrays) == len(wanted) else None


def written(what: str, rows: int, work: Callable[[int, int], None]) -> None:
    """Have work(begin, end) write to `common_arrays` what belongs to the rows begin, ..., end - 1: each rank some of them, and as in
    `for_parts` nothing else."""
    ranks = world()
    assert ranks is not None and ranks.common is not None  # who has such arrays
    with ranks.unasked(what):
        with alone():
            work(rows * ranks.number // ranks.size, rows * (ranks.number + 1) // ranks.size)
        ranks.common.meet()


def largest(what: str, rows: int, least: int, work: Callable[[int, int], FloatArray]) -> FloatArray:
    """The largest of what work(begin, end) finds in the rows begin, ..., end - 1, number by number: each rank looks at some of them, all of
    them where there are fewer than `least`. As `in_parts` else."""
    ranks = world()
    if ranks is None or rows < least or threading.current_thread() is not threading.main_thread():
        return work(0, rows)
    with ranks.unasked(what):
        with alone():
            own = work(rows * ranks.number // ranks.size, rows * (ranks.number + 1) // ranks.size)
        every: FloatArray = ranks.gathered(own, [len(own)] * ranks.size).reshape(ranks.size, -1).max(axis=0)
        return every
