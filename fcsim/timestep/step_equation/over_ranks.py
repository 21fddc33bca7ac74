"""Who has which contacts of a step where ranks share W: what follows from where H has entries, and is kept as long as that stays."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.assembly.compliance import SystemFactor
from fcsim.assembly.shares.shares import Shares
from fcsim.linear.sparse.columns import has_pattern
from fcsim.problem.distributed import bodies_by_ranks, contact_layout
from fcsim.problem.distributed.layout import ContactLayout
from fcsim.ranks import kept_alike

type OfBodies = tuple[IntArray, IntArray, IntArray, IntArray, FloatArray]


@dataclass(frozen=True, eq=False)
class KnownLayout:
    """layout: who has which contacts; bodies (nc, 2) of each, None where one has three; entries of the bodies' shares; elastic: whether
    every contact has a deformable body; own, blocks: this rank's body of each dof, see `SystemFactor.own_bodies`, and its blocks of W, None
    where they are not counted; pattern: indptr and indices of the H that it is of, shares: who shares it."""

    layout: ContactLayout
    bodies: IntArray | None
    entries: int
    elastic: bool
    own: IntArray
    blocks: int | None
    pattern: tuple[IntArray, IntArray]
    shares: Shares


def layout_of(
    factor: SystemFactor, shares: Shares, H: sp.csc_array, given: sp.sparray, dimension: int, make_h: Callable[[None], OfBodies]
) -> KnownLayout:
    """The layout of H (n_dofs, m) on the compliances, of the problem's H, given: the last one again where this has the very arrays that it
    had then. make_h: h of all bodies. All ranks must ask."""
    if kept_alike() and isinstance(given, sp.csc_array):
        for last in factor.kept_layouts:
            if not isinstance(last, KnownLayout) or last.shares is not shares or last.layout.dimension != dimension:
                continue
            if has_pattern(given, *last.pattern):
                return last
    body, rank = factor.places[0], factor.ranks()
    nc, count, (bodies, more) = H.shape[1] // dimension, len(rank), bodies_by_ranks(H, body, dimension)
    if more:
        first, contacts = make_h(None)[:2]
        of_pairs = np.repeat(np.arange(count), np.diff(first))
    else:
        contacts, side = np.nonzero(bodies >= 0)
        of_pairs = bodies[contacts, side]
    layout = contact_layout(shares.world, rank[of_pairs], contacts, nc, dimension)
    elastic = np.zeros(nc, dtype=bool)
    elastic[contacts[of_pairs < len(factor.model.deformable)]] = True
    entries = int(np.sum(np.bincount(of_pairs) ** 2)) * dimension**2
    with shares.world.together("layout of W"):
        mine, own = factor.own_bodies(shares)
        blocks = None if more else _blocks_of(bodies, mine)
    pattern = (given.indptr, given.indices) if isinstance(given, sp.csc_array) else (H.indptr, H.indices)
    found = KnownLayout(layout, None if more else bodies, entries, bool(elastic.all()), own, blocks, pattern, shares)
    if kept_alike():
        factor.kept_layouts[:] = [found]
    return found


def _blocks_of(bodies: IntArray, mine: BoolArray) -> int:
    """The blocks of W by the bodies `mine` (nb,) alone; bodies (nc, 2) of the contacts, -1: none. Contacts of two of these have one block
    from both."""
    own = (bodies >= 0) & mine[bodies]
    both = bodies[own.all(axis=1)]
    shared = np.unique(both[:, 0] * len(mine) + both[:, 1], return_counts=True)[1]
    return int(np.sum(np.bincount(bodies[own]) ** 2) - np.sum(shared**2))
