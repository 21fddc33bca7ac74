"""Products with W body by body, h C (h^T x), in the place of W's block rows: bodies that share C are rows of one product of matrices.

C of one part serves all its bodies from the cache; W's block rows, hundreds of megabytes for a wall of many hundred bricks, come from
memory.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial

import numpy as np
from numpy.typing import NDArray

from fcsim.arrays import FloatArray, IntArray
from fcsim.problem.bodies._nodal_kernels import (
    gather_nodal_forces,
    nodes_by_contacts,
    nodes_of_pairs,
    spread_nodal_velocities,
    spread_nodal_velocities_of,
)
from fcsim.problem.bodies._shares_kernels import contacts_moved, gather_forces, pairs_of_contacts, spread_velocities, spread_velocities_of
from fcsim.problem.bodies.shares import BodyShares
from fcsim.threads import pieces, pieces_by_work, side_by_side

OPERATIONS_A_PIECE = 4_000_000
"""Of products with compliances that one thread takes, as of other products of matrices."""
SHARED_A_PIECE = 8_000_000
"""The same of products with one C that several bodies share: BLAS copies C into its own order once for each piece, which takes as long as
multiplying it by ten bodies' forces does."""
CACHED = 250_000
"""Entries of C up to which a core's own cache holds it, so that each piece may read all of it for some bodies; of larger ones each piece
reads some columns, for all bodies."""
WEIGHTS_A_PIECE, CONTACTS_A_PIECE = 100_000, 4000
"""Entries of h, and contacts with some thirty of them, that one thread goes through in as much time."""
NODAL = 0.5
"""Share of h's entries that are shape values times frames from which products read these."""

type _Nodal = tuple[FloatArray, NDArray[np.int32], NDArray[np.uint32], FloatArray]
"""Frames, which of them is each pair's, nodes and shape values."""


class ShareProduct:
    """x, q -> W x + q, body by body: h C (h^T x), bodies of one compliance together. Its cuts follow from the sizes alone."""

    def __init__(self, shares: BodyShares) -> None:
        self._shares = shares
        row, end = np.zeros(shares.count, dtype=np.int64), 0
        self._alike: list[tuple[int, int, FloatArray]] = []  # bodies' rows of numbers of one C, one after the other, and C
        for bodies, C in _alike(shares):
            n, begin = C.shape[-1], end
            end += len(bodies) * n
            row[bodies] = begin + n * np.arange(len(bodies))
            self._alike.append((begin, end, C))
        self._row, self._size = row, end
        self._starts, self._pairs, bodies = pairs_of_contacts(shares.first, shares.contacts, shares.nc)
        self._rows, self._bodies = row[bodies], bodies
        self._of_bodies = pieces_by_work(shares.begins[shares.first], WEIGHTS_A_PIECE)
        self._of_contacts = pieces(shares.nc, CONTACTS_A_PIECE)
        self._nodal = self._nodes()
        self._nodal_by_contacts = None if self._nodal is None else self._by_contacts(self._nodal)

    def _nodes(self) -> _Nodal | None:
        """Frames, which frame is each pair's, and nodes and shape values in the place of h, see `_nodal_kernels`; None where few are
        these."""
        s, entries = self._shares, int(self._shares.begins[-1])
        frames, frame_of = np.empty((2, s.nc, 3, 3)), np.empty(len(s.contacts), dtype=np.int32)
        nodes, shapes = np.empty(entries // 3, dtype=np.uint32), np.empty(entries // 3)
        given, out = (s.begins, s.unknowns, s.weights, self._starts, self._pairs, self._rows), (frames, frame_of, nodes, shapes)
        side_by_side([partial(nodes_of_pairs, *given, i, j, *out) for i, j in self._of_contacts])
        if np.sum(np.diff(s.begins)[frame_of >= 0]) < NODAL * entries or not entries:
            return None
        return frames.reshape(-1, 9), frame_of, nodes, shapes

    def _by_contacts(self, nodal: _Nodal) -> tuple[FloatArray, IntArray, NDArray[np.int32], NDArray[np.uint32], FloatArray]:
        """What `spread_nodal_velocities` takes."""
        s = self._shares
        begins = np.concatenate([np.zeros(1, dtype=np.int64), np.cumsum(np.diff(s.begins)[self._pairs] // 3)])
        frame_of, nodes, shapes = np.empty_like(nodal[1]), np.empty(begins[-1], dtype=np.uint32), np.empty(begins[-1])
        given = s.begins, self._starts, self._pairs, nodal
        side_by_side([partial(nodes_by_contacts, *given, i, j, begins, frame_of, nodes, shapes) for i, j in self._of_contacts])
        return nodal[0], begins, frame_of, nodes, shapes

    def bodies_of(self, contacts: IntArray) -> IntArray:
        """The bodies that these contacts are on, ascending."""
        begin = self._starts[contacts]
        counts = self._starts[contacts + 1] - begin
        place = np.repeat(begin - np.cumsum(counts) + counts, counts) + np.arange(int(counts.sum()))
        found: IntArray = np.unique(self._bodies[place])
        return found

    @property
    def operations(self) -> int:
        """Multiplications with entries of compliances in a product."""
        return sum((end - begin) * C.shape[-1] for begin, end, C in self._alike)

    def affine(self, x: FloatArray, q: FloatArray) -> FloatArray:
        """W x + q (m,) for x and q (m,)."""
        u = self._shares.by_three(q)
        return self._added(x, u.copy() if u is q else u)

    def times(self, x: FloatArray) -> FloatArray:
        """W x (m,) for x (m,)."""
        return self._added(x, np.zeros(3 * self._shares.nc))

    def _added(self, x: FloatArray, u: FloatArray) -> FloatArray:
        """W x + u for u (3 nc,), which is written to."""
        s = self._shares
        x = s.by_three(x)
        forces, velocities = np.zeros(self._size), np.empty(self._size)
        h = (s.begins, s.unknowns, s.weights)
        gather, spread, by_bodies, by_contacts = self._ways
        side_by_side([partial(gather, s.first, s.contacts, *h, self._row, *by_bodies, i, j, x, forces) for i, j in self._of_bodies])
        products = list(self._products(forces, velocities))
        if self.operations < 2 * OPERATIONS_A_PIECE:
            for product in products:
                product()
        else:
            side_by_side(products)
        places = (self._starts, self._pairs, self._rows)
        side_by_side([partial(spread, *h, *places, *by_contacts, i, j, velocities, u) for i, j in self._of_contacts])
        return s.by_dimension(u)

    @property
    def _ways(self) -> tuple[Callable[..., None], Callable[..., None], tuple[object, ...], tuple[object, ...]]:
        """What takes h^T x and h v, and what each takes of nodes and frames."""
        if self._nodal is None:
            return gather_forces, spread_velocities, (), ()
        return gather_nodal_forces, spread_nodal_velocities, (self._nodal,), (self._nodal_by_contacts,)

    def of_few(self, x: FloatArray) -> FloatArray:
        """W x (m,) for x (m,) that is zero but at few contacts: by their bodies alone, and at the contacts of these."""
        s = self._shares
        x, u = s.by_three(x), np.zeros(3 * s.nc)
        forces, velocities = np.zeros(self._size), np.zeros(self._size)
        h = (s.begins, s.unknowns, s.weights)
        gather, _, by_bodies, by_contacts = self._ways
        gather(s.first, s.contacts, *h, self._row, *by_bodies, 0, s.count, x, forces)  # which passes contacts by that are not pushed
        for begin, end, C in self._alike:
            n = C.shape[-1]
            Y, Z = forces[begin:end].reshape(-1, n), velocities[begin:end].reshape(-1, n)
            own = np.flatnonzero(Y.any(axis=1))
            Z[own] = Y[own] @ C if C.ndim == 2 else np.matmul(Y[own, None], C[own])[:, 0]
        spread = spread_velocities_of if self._nodal is None else spread_nodal_velocities_of
        moved = contacts_moved(s.first, s.contacts, x)
        spread(moved, *h, self._starts, self._pairs, self._rows, *by_contacts, velocities, u)
        return s.by_dimension(u)

    def _products(self, forces: FloatArray, velocities: FloatArray) -> Iterator[Callable[[], object]]:
        """What writes C h^T x of all bodies to velocities, cut for threads."""
        for begin, end, C in self._alike:
            n = C.shape[-1]
            Y, Z = forces[begin:end].reshape(-1, n), velocities[begin:end].reshape(-1, n)
            if C.ndim == 2 and C.size > CACHED:
                for i, j in pieces(n, max(1, OPERATIONS_A_PIECE // Y.size)):
                    yield partial(np.matmul, Y, C[:, i:j], out=Z[:, i:j])
                continue
            a_piece = SHARED_A_PIECE if C.ndim == 2 else OPERATIONS_A_PIECE
            for i, j in pieces(len(Y), max(1, a_piece // (n * n))):
                if C.ndim == 2:
                    yield partial(np.matmul, Y[i:j], C, out=Z[i:j])
                else:
                    yield partial(np.matmul, Y[i:j, None], C[i:j], out=Z[i:j, None])


def _alike(shares: BodyShares) -> Iterator[tuple[IntArray, FloatArray]]:
    """Bodies and the C (n, n) that they share, or C (nb, n, n), one for each; runs of one array, of which others' bodies stand between
    where ranks share W, are taken together."""
    runs: dict[int, tuple[FloatArray, list[IntArray], list[IntArray]]] = {}
    for begin, C, kind in shares.runs:
        _, some_bodies, some_kinds = runs.setdefault(id(C), (C, [], []))
        some_bodies.append(begin + np.arange(len(kind)))
        some_kinds.append(kind)
    for C, some_bodies, some_kinds in runs.values():
        bodies, kind = np.concatenate(some_bodies), np.concatenate(some_kinds)
        if not C.shape[-1] or not len(kind):
            continue
        if len(C) == 1:
            yield bodies, C[0]
        elif len(C) == len(kind) and np.array_equal(np.sort(kind), np.arange(len(kind))):
            yield bodies[np.argsort(kind)], C
        else:
            for k in np.unique(kind):  # the parts of a model, few of many bodies
                yield bodies[kind == k], C[k]
