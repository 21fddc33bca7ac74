"""A part whose stiffness, mass and factor are spread over ranks: each assembles the rows of its own nodes from the cells around them.

Every rank knows the part's points and cells, which are small beside its matrices. No exchange takes place here, so that a rank that
computes alone may come here too.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from weakref import WeakKeyDictionary

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import FloatArray, IntArray
from fcsim.assembly import elasticity
from fcsim.assembly.layout import BodyLayout
from fcsim.linear.over_ranks.rows import RowLayout, RowsOverRanks
from fcsim.mesh.material.by_region import ByRegion, is_linear
from fcsim.mesh.part import Part
from fcsim.ranks import World, partners
from fcsim.ranks.partition import partition

SPREAD_FROM = 10_000
"""Nodes of a part from which it may be spread over ranks: the factor of a smaller one takes a second or two."""
SPREAD_SHARE = 1.5
"""Of the work on all bodies, over the number of ranks: one that is more leaves the ranks without it idle."""


@dataclass(frozen=True, eq=False)
class SpreadOperators:
    """stiffness, and consistent_mass where it was asked for (else None), over ranks (d nn, d nn); lumped_mass (d nn,) [kg] and
    nodal_volume (nn,) [m^3] whole."""

    stiffness: RowsOverRanks
    consistent_mass: RowsOverRanks | None
    lumped_mass: FloatArray
    nodal_volume: FloatArray


def spread_over(layout: BodyLayout) -> dict[int, World]:
    """The parts, by their `id`, that the ranks which share this process's work have together, with these ranks; empty where there are none.

    The work on a body is taken as the square of its nodes', that of the sparse factor of a solid.
    """
    ranks = partners()
    if ranks is None:
        return {}
    enough = SPREAD_SHARE / ranks.size * sum(float(len(body.part.points)) ** 2 for body in layout.deformable)
    return {
        id(part): ranks
        for part in (body.part for body in layout.deformable)
        if len(part.points) >= SPREAD_FROM and is_linear(part.material) and float(len(part.points)) ** 2 > enough
    }


def spread_operators(part: Part, ranks: World, *, lumped: bool) -> SpreadOperators:
    """The operators of a part over these ranks; of its bodies they are the same."""
    known = _known.get(part)
    if known is None or known[0] is not ranks or (known[1].consistent_mass is None and not lumped):
        known = _known[part] = ranks, _spread(part, ranks, lumped)
    return known[1]


_known: WeakKeyDictionary[Part, tuple[World, SpreadOperators]] = WeakKeyDictionary()


def _spread(part: Part, ranks: World, lumped: bool) -> SpreadOperators:
    d = part.dimension
    owner = partition(part.points, np.ones(len(part.points)), ranks.size)
    layout = RowLayout(ranks, np.repeat(owner, d))
    mass, volume = np.empty(part.points.size), np.empty(len(part.points))
    for own, nodes, piece in _pieces(part, owner, range(ranks.size)):  # all on every rank: vectors, one piece's mesh at a time
        place = np.searchsorted(nodes, own)
        volume[own] = elasticity.nodal_volume(piece)[place]
        mass.reshape(-1, d)[own] = elasticity.lumped_mass(piece).reshape(-1, d)[place]
    return SpreadOperators(
        _rows(part, owner, layout, elasticity.stiffness),
        None if lumped else _rows(part, owner, layout, elasticity.consistent_mass),
        mass,
        volume,
    )


def _pieces(part: Part, owner: IntArray, ranks: range) -> Iterator[tuple[IntArray, IntArray, Part]]:
    """For each of the ranks its nodes, and the cells around them as a part with its nodes' numbers in the whole; none without nodes."""
    for rank in ranks:
        own = np.flatnonzero(owner == rank)
        if not len(own):
            continue
        cells = np.flatnonzero((owner == rank)[part.cells].any(axis=1))
        nodes, numbered = np.unique(part.cells[cells], return_inverse=True)
        material, regions = part.material, {}
        if isinstance(material, ByRegion):
            place = np.full(len(part.cells), -1)
            place[cells] = np.arange(len(cells))
            numbers = {name: place[part.regions[name]] for name in material.materials}
            regions = {name: kept[kept >= 0] for name, kept in numbers.items() if np.any(kept >= 0)}
            material = ByRegion({name: law for name, law in material.materials.items() if name in regions})
        yield (
            own,
            nodes,
            replace(
                part, points=part.points[nodes], cells=numbered.reshape(len(cells), -1), surfaces={}, regions=regions, material=material
            ),
        )


def _rows(part: Part, owner: IntArray, layout: RowLayout, of: Callable[[Part], sp.csr_array]) -> RowsOverRanks:
    """This rank's rows of an operator of the part: all cells around its nodes are in its piece."""
    d, number = part.dimension, layout.world.number
    rows = sp.csr_array((0, part.points.size))
    for own, nodes, piece in _pieces(part, owner, range(number, number + 1)):
        at = (d * np.searchsorted(nodes, own)[:, None] + np.arange(d)).ravel()
        A = of(piece)[at]
        columns = (d * nodes[:, None] + np.arange(d)).ravel().astype(np.int32)
        rows = sp.csr_array((A.data, columns[A.indices], A.indptr), shape=(len(at), part.points.size))
    return RowsOverRanks(layout, rows, lambda: of(part))
