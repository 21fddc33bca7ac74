"""Vectors that each rank has on its own contacts and on those of others around them, so that their sums over ranks take one exchange."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from fcsim.arrays import FloatArray, IntArray
from fcsim.problem.distributed import _halo_kernels as kernels
from fcsim.problem.distributed.delassus import DistributedDelassus
from fcsim.problem.distributed.layout import ContactLayout
from fcsim.problem.distributed.parts import ContactParts, Needed


class Halo:
    """contacts (k,): this rank's own, then others' that its bodies have a share of, then others that it needs; own, shared: so many numbers
    of a vector (k d,) are on the first, and on the first and second, of these."""

    def __init__(self, parts: ContactParts, shared: IntArray, needed: IntArray, d: int) -> None:
        """shared: others' contacts that this rank has a share of, each of which no third one has; needed: others' contacts, those among
        them or not."""
        world, nc = parts.world, len(parts.order)
        self._world, self._d = world, d
        own, around = parts.own, np.concatenate([shared, np.setdiff1d(needed, shared)])
        self.contacts = np.concatenate([own, around])
        self.own, self.shared = d * len(own), d * (len(own) + len(shared))
        sizes = world.gathered(np.array([len(shared), len(around)]), [2] * world.size).reshape(-1, 2)
        everyones, wanted = world.gathered(around, sizes[:, 1]), np.zeros(nc, dtype=bool)
        wanted[everyones] = True
        shares = [some[:count] for some, count in zip(np.split(everyones, np.cumsum(sizes[:-1, 1])), sizes[:, 0], strict=True)]
        owned = [some[wanted[some]] for some in np.split(parts.order, parts.begins[1:-1])]
        sent = [np.concatenate(both) for both in zip(owned, shares, strict=True)]  # by each rank
        self._sent = np.concatenate([np.flatnonzero(wanted[own]), len(own) + np.arange(len(shared))])
        begins = np.concatenate([[0], np.cumsum([len(some) for some in sent])])
        self._sizes = np.diff(begins)
        self._lengths = [d * int(size) for size in self._sizes]
        here, of_owner = np.full(nc, -1), np.empty((nc, 2), dtype=np.int64)
        here[self.contacts] = np.arange(len(self.contacts))
        every, rank = np.concatenate(sent), np.repeat(np.arange(world.size), self._sizes)
        places = np.stack([np.arange(len(every)), rank], axis=1)
        received = (here[every] >= 0) & (rank != world.number)
        self._places, self._to = places[received], here[every[received]]
        owner = parts.owner[every] == rank
        of_owner[every[owner]] = places[owner]
        self._first, self._second = of_owner[every[~owner]], places[~owner]  # where both shares of a contact stand

    def joined(self, share: FloatArray, numbers: FloatArray) -> tuple[FloatArray, float, FloatArray]:
        """The sum w (k d,) of what the ranks have, share (shared,); ||w||^2 of the whole vector; and the sum of numbers (j,): one exchange.

        An entry is the sum of at most two numbers, so that it has the same bits on all ranks that have it."""
        d, count = self._d, len(numbers) + 1
        own = np.empty(count + d * len(self._sent))
        kernels.put_together(numbers, share @ share, share, self._sent, d, own)
        every = self._world.gathered(own, [count + size for size in self._lengths])
        sums, w = np.empty(count), np.empty(d * len(self.contacts))
        both = self._places, self._to, self._first, self._second
        products = kernels.taken_apart(every, self._sizes, count, d, share, both, sums, w)
        return w, float(sums[-1]) + 2 * products, sums[:-1]

    def summed(self, numbers: FloatArray) -> FloatArray:
        """The sum over the ranks of numbers (j,), of as many on each."""
        size = self._world.size
        total: FloatArray = self._world.gathered(numbers, [len(numbers)] * size).reshape(size, -1).sum(axis=0)
        return total


class SharesByParts:
    """Products W x, x and they the parts of the ranks: each multiplies with the shares of its own bodies.

    Ranks do not ask one another about errors before they exchange what they have, as elsewhere: nothing but a lack of memory ends a
    product, or an application of a preconditioner, on one rank, and then that rank, and the others with it (`World.unasked`).
    """

    def __init__(self, parts: ContactParts, layout: ContactLayout) -> None:
        """foreign: the contacts of others that this rank's bodies are at."""
        contacts = layout.own
        self.foreign = contacts[parts.owner[contacts] != parts.world.number]
        here, place = np.concatenate([parts.own, self.foreign]), np.empty(layout.nc, dtype=np.int64)
        place[here] = np.arange(len(here))
        self._place = place[contacts]  # of the contacts of this rank's bodies, in its part and after it those of others
        place[contacts] = np.arange(len(contacts))
        self._here, self._own = place[here], len(parts.own)
        self._needed = Needed(parts, self.foreign)

    def of(self, W: DistributedDelassus, x: NDArray[np.floating]) -> FloatArray:
        """What this rank's own bodies make of x (k, d), on their contacts in the order of the layout; x: on this rank's part and, after it,
        on the `foreign` contacts."""
        wide = np.empty((len(self._place), x.shape[1]))
        kernels.rows_of(x, self._place, wide)
        return W.own_product(wide.ravel()).reshape(wide.shape)

    def applied(self, A: FloatArray, B: FloatArray) -> Callable[[FloatArray, NDArray[np.floating]], FloatArray]:
        """What makes this rank's share (k, d) of A W x + B x on its part and the `foreign` contacts from the `image` of `of` and x there;
        A, B (k or more, d, d). B x is its owner's alone."""
        given = A, B, kernels.diagonals(A), kernels.alone(A, B, self._own)

        def share(image: FloatArray, x: NDArray[np.floating]) -> FloatArray:
            out = np.empty((len(self._here), x.shape[1]))
            kernels.apply_blocks(*given, image, self._here, x, self._own, out)
            return out

        return share

    def joined(self, image: FloatArray) -> FloatArray:
        """The sum of what the ranks have, as `of` gives it, on this rank's part."""
        own = image[self._here[: self._own]]
        self._needed.to_owners(own, image[self._here[self._own :]])
        return own

    def product(self, W: DistributedDelassus, x: FloatArray) -> FloatArray:
        """W x (k, d) for x on this rank's part."""
        return self.joined(self.of(W, np.concatenate([x, self._needed.of(x)])))
