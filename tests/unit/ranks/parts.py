"""Work on rows and columns that ranks share. Writes what each rank has, as digests."""

import hashlib
import json
import sys
from pathlib import Path

import numpy as np
import scipy.sparse as sp

from fcsim.linear.sparse.by_ranks import CONTACTS_FROM, times_by_ranks, transposed_times_by_ranks
from fcsim.ranks import World, alone, in_parts, largest, sharing


def digest(array: np.ndarray) -> str:
    return hashlib.sha256(np.ascontiguousarray(array).tobytes()).hexdigest()


def made(rows: int, least: int) -> tuple[list[str], int]:
    """Digests of rows made in parts, and how many this rank has made."""
    numbers, flags, own = np.empty((rows, 3)), np.empty(rows, dtype=bool), [0]

    def work(begin: int, end: int) -> None:
        k = np.arange(begin, end)
        numbers[begin:end], flags[begin:end] = np.sin(k[:, None] + np.arange(3)), k % 3 == 0
        own[0] += end - begin

    in_parts("rows", rows, least, work, numbers, flags)
    return [digest(numbers), digest(flags)], own[0]


def products() -> list[str]:
    """Of A^T x for columns by threes and others, more and fewer than ranks share, beside SciPy's."""
    rng = np.random.default_rng(0)
    found = []
    for columns in (3 * CONTACTS_FROM + 3, CONTACTS_FROM + 1, 30):
        A = sp.random_array((500, columns), density=0.02, rng=rng, format="csc")
        x = rng.standard_normal(500)
        product = transposed_times_by_ranks(A, x)
        assert np.array_equal(product, A.T @ x)
        found.append(digest(product))
        r = rng.standard_normal(columns)
        for rows in (A, alike(A)):
            product = times_by_ranks(rows, r)
            assert np.array_equal(product, rows @ r)
            found.append(digest(product))
    return found


def alike(A: sp.csc_array) -> sp.csc_array:
    """A with the rows of each third column in the two that follow it, as a contact's columns have them."""
    indptr, blocks = [0], []
    for j in range(0, A.shape[1] - 2, 3):
        blocks += 3 * [A.indices[A.indptr[j] : A.indptr[j + 1]]]
        indptr += [indptr[-1] + len(blocks[-1]) * k for k in (1, 2, 3)]
    rows = np.concatenate(blocks)
    B = sp.csc_array((np.cos(np.arange(len(rows))), rows, indptr), shape=(A.shape[0], len(indptr) - 1))
    B = sp.csc_array(sp.hstack([B, A[:, B.shape[1] :]]))
    B.sum_duplicates()
    return B


def looked_at() -> list[float]:
    """The largest of what ranks see of many numbers, and of few."""
    x = np.sin(np.arange(1000.0) ** 2)
    return [float(a) for least in (1, 1001) for a in largest("rows", 1000, least, lambda i, j: np.array([x[i:j].max(), -x[i:j].min()]))]


def sent(world: World | None) -> bool:
    """Whether each rank gets what the others send to it alone: of number i to j i + 2 j numbers 10 i + j."""
    if world is None:
        return True
    k = np.arange(world.size)
    lengths = k[:, None] + 2 * k
    own = np.repeat(10 * world.number + k, lengths[world.number])
    return np.array_equal(world.exchanged(own, lengths), np.repeat(10 * k + world.number, lengths[:, world.number]))


def main(folder: Path) -> None:
    with sharing() as world:
        number = 0 if world is None else world.number
        rows, few, several = made(1001, 1), made(1001, 1002), made(2, 1)
        with alone():
            by_itself = made(1001, 1)
        found = {
            "rows": rows,
            "few": few,
            "several": several,
            "alone": by_itself,
            "products": products(),
            "largest": looked_at(),
            "sent": sent(world),
        }
        (folder / f"{number}.json").write_text(json.dumps(found), encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
