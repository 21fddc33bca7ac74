"""The shares h C h^T of W behind a `DistributedDelassus`: h is known to all ranks, a body's C to its owner and to who asks for it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.brief import brief
from fcsim.linear.sparse.by_ranks import CONTACTS_FROM
from fcsim.problem._delassus_kernels import bodies_of_contacts
from fcsim.problem.bodies._shares_kernels import sides_of_pairs
from fcsim.problem.bodies.shares import Run, by_matrices
from fcsim.ranks import World, for_parts, in_parts


@dataclass(frozen=True, eq=False)
class Compliances:
    """Some bodies' compliances: those of body b are matrices[kind[b]], -1: not among them."""

    matrices: tuple[FloatArray, ...]
    kind: IntArray


@dataclass(frozen=True, eq=False)
class BodiesOverRanks:
    """make_h: what makes h of all bodies and of some contacts (k,), numbered by their places, None: all of them, anew, which few steps ask
    for, by pairs of both as in `BodyShares` (first, contacts, begins, unknowns, weights); made_of: from which very objects it follows where
    h has entries, none: not known; bodies (nc, 2): of each contact, ascending, -1 where it has
    one alone, None where a contact has three; runs: the compliances of this rank's bodies; rank (bodies,): whose each body is; nc: the
    number of contacts."""

    make_h: Callable[[IntArray | None], tuple[IntArray, IntArray, IntArray, IntArray, FloatArray]]
    bodies: IntArray | None
    runs: tuple[Run, ...]
    rank: IntArray
    nc: int
    made_of: tuple[object, ...] = ()

    __repr__ = brief

    @property
    def count(self) -> int:
        """The number of bodies."""
        return len(self.rank)

    def has_entries_as(self, made_of: object) -> bool:
        """Whether h has entries where that one had them whose `made_of` this is, without a look at them."""
        if not isinstance(made_of, tuple) or not len(made_of) == len(self.made_of) > 0:
            return False
        return all(mine is other for mine, other in zip(self.made_of, made_of, strict=True))

    @staticmethod
    def pairs(first: IntArray, contacts: IntArray, nc: int) -> IntArray:
        """The pairs (nc, 2) of h that belong to the bodies of each of nc contacts, -1 where there is none; first, contacts: of h."""
        bodies, side = np.full((nc, 2), -1), np.empty(len(contacts), dtype=np.int64)
        sides_of_pairs(first, contacts, bodies, side)
        pairs = np.full((nc, 2), -1)
        pairs[contacts, side] = np.arange(len(side))
        return pairs

    def sizes(self, world: World) -> IntArray:
        """The unknowns (bodies,) of each body's compliance."""
        own, counts = np.flatnonzero(self.rank == world.number), np.bincount(self.rank, minlength=world.size)
        known = np.zeros(self.count, dtype=np.int64)
        for begin, C, kind in self.runs:
            known[begin : begin + len(kind)] = C.shape[1]
        sizes = np.empty(self.count, dtype=np.int64)
        sizes[np.argsort(self.rank, kind="stable")] = world.gathered(known[own], counts)
        return sizes

    def compliances(self, world: World, wanted: BoolArray) -> Compliances:
        """Those of the bodies (bodies,) that each rank wants, its own and others'."""
        ones = np.ones(world.size, dtype=np.int64)
        foreign = np.flatnonzero(wanted & (self.rank != world.number))
        counts = world.gathered(np.array([len(foreign)]), ones)
        asked = np.zeros(self.count, dtype=bool)
        asked[world.gathered(foreign, counts)] = True
        matrices, kind = [], np.full(self.count, -1)
        for k, (bodies, own) in enumerate(by_matrices(self.runs, wanted)):
            kind[bodies] = k
            matrices.append(own)
        # what others ask for: (body, number of its matrix among those sent), sizes of matrices, entries
        sent = list(by_matrices(self.runs, asked))
        numbers = [np.stack([bodies, np.full(len(bodies), k)], axis=1).ravel() for k, (bodies, _) in enumerate(sent)]
        told = np.concatenate([np.empty(0, dtype=np.int64), *numbers])
        sizes = np.array([len(C) for _, C in sent], dtype=np.int64)
        entries = np.concatenate([np.empty(0), *(C.ravel() for _, C in sent)])
        lengths = world.gathered(np.array([len(told), len(sizes), len(entries)]), 3 * ones).reshape(-1, 3)
        told, sizes = world.gathered(told, lengths[:, 0]), world.gathered(sizes, lengths[:, 1])
        entries = world.gathered(entries, lengths[:, 2])
        first = np.repeat(np.cumsum(lengths[:, 1]) - lengths[:, 1], lengths[:, 0] // 2)  # the sender's first matrix
        body, number = told.reshape(-1, 2)[:, 0], told.reshape(-1, 2)[:, 1] + first
        mine = np.isin(body, foreign)
        ends = np.cumsum(sizes**2)
        for k in np.unique(number[mine]):
            kind[body[mine & (number == k)]] = len(matrices)
            matrices.append(entries[ends[k] - sizes[k] ** 2 : ends[k]].reshape(sizes[k], sizes[k]).copy())
        return Compliances(tuple(matrices), kind)


def bodies_by_ranks(H: sp.csc_array, body: IntArray, d: int) -> tuple[IntArray, bool]:
    """As `bodies_of_contacts` of H (n, d nc), of some contacts by each rank; all ranks must ask."""
    nc = H.shape[1] // d
    bodies, more = for_parts((nc, 2), CONTACTS_FROM, np.int64), for_parts((nc,), CONTACTS_FROM, np.bool_)

    def find(begin: int, end: int) -> None:
        bodies[begin:end], more[begin:end] = bodies_of_contacts(H.indptr[d * begin : d * end + 1], H.indices, body, d)

    in_parts("bodies of contacts", len(bodies), CONTACTS_FROM, find, bodies, more)
    return bodies, bool(more.any())
