"""Broad phase: which bodies, and which vertices, facets and edges of theirs, are near enough to be looked at."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.contact_detection.general import _near_kernels as kernels
from fcsim.contact_detection.skin.skin import Shape, Skin


class NearBodies(NamedTuple):
    """Pairs of bodies (np, 2) with, for each, the distances [m] (np,) that decide: `alert`, up to which gap contacts are kept; `depth`, up
    to which penetration; `near`, below which two places are one."""

    bodies: IntArray
    alert: FloatArray
    depth: FloatArray
    near: FloatArray

    def take(self, rows: IntArray | BoolArray) -> NearBodies:
        return NearBodies._make(array[rows] for array in self)

    @property
    def itself(self) -> BoolArray:
        """Which pairs (np,) are a body and itself, see `folding`."""
        return self.bodies[:, 0] == self.bodies[:, 1]

    @property
    def both_ways(self) -> NearBodies:
        """The pairs, and the other way round those of two bodies."""
        back = ~self.itself
        return NearBodies(
            np.concatenate([self.bodies, self.bodies[back, ::-1]]), *(np.concatenate([part, part[back]]) for part in self[1:])
        )


class Lengths(NamedTuple):
    """Lengths [m] of each body (nb,): `alert`; `depth`, half its largest facet; `near`, below which its places are one; `finest`, the
    largest that another body may make of that; `extent`, its box's diagonal / sqrt(d); `bulge`, how far its surface is over facets."""

    alert: FloatArray
    depth: FloatArray
    near: FloatArray
    finest: FloatArray
    extent: FloatArray
    bulge: FloatArray


def near_bodies(low: FloatArray, high: FloatArray, lengths: Lengths) -> NearBodies:
    """Pairs of bodies, sorted, whose boxes low, high (nb, 3) [m] come within the alert distance of each other."""
    reach = 0.5 * lengths.alert + lengths.bulge
    axis = int(np.argmax(np.ptp(0.5 * (low + high), axis=0)))
    order = np.argsort(low[:, axis] - reach, kind="stable")
    pairs = kernels.body_pairs(low, high, reach, order, axis)
    pairs = pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]
    first, second = (Lengths._make(length[k] for length in lengths) for k in pairs.T)
    near = np.minimum(np.maximum(first.near, second.near), np.minimum(first.finest, second.finest))
    alert = np.minimum(first.alert, second.alert) + (first.bulge + second.bulge)
    return NearBodies(pairs, alert, np.minimum(first.depth, second.depth), near)


def near_facets(skin: Skin, shape: Shape, near: NearBodies) -> IntArray:
    """Rows (vertex of the first body, facet of the second, pair), vertices one after the other."""
    reach = np.maximum(near.alert, near.depth)
    boxes = (shape.body_low, shape.body_high)
    points = (skin.first_vertex, shape.point, shape.point)
    return kernels.item_pairs(near.bodies, *boxes, *points, skin.first_facet, shape.low, shape.high, near.alert, reach)


def near_vertices(skin: Skin, shape: Shape, near: NearBodies) -> IntArray:
    """Rows (vertex of the first body, vertex of the second, pair) that are nearer than `depth`."""
    points = (skin.first_vertex, shape.point, shape.point)
    return kernels.item_pairs(near.bodies, shape.body_low, shape.body_high, *points, *points, near.depth, near.depth)


def near_edges_and_facets(skin: Skin, shape: Shape, near: NearBodies) -> IntArray:
    """Rows (edge of the first body, facet of the second, pair) whose boxes overlap."""
    items = (skin.first_edge, shape.edge_low, shape.edge_high)
    none = np.zeros(len(near.bodies))
    facets = (skin.first_facet, shape.low, shape.high)
    return kernels.item_pairs(near.bodies, shape.body_low, shape.body_high, *items, *facets, none, none)


def near_facets_of_both(skin: Skin, shape: Shape, near: NearBodies) -> IntArray:
    """Rows (facet of the first body, facet of the second, pair) whose boxes overlap."""
    none, facets = np.zeros(len(near.bodies)), (skin.first_facet, shape.low, shape.high)
    return kernels.item_pairs(near.bodies, shape.body_low, shape.body_high, *facets, *facets, none, none)


def near_edges(skin: Skin, shape: Shape, near: NearBodies) -> IntArray:
    """Rows (sharp edge of the first body, sharp edge of the second, pair); of a body with itself each two once that share no end."""
    rows = edges_of_both(skin, shape, near, skin.sharp_edges, skin.sharp_edges)
    if not near.itself.any():
        return rows
    one, other = skin.edges[rows[:, 0]], skin.edges[rows[:, 1]]
    joined = (one == other).any(axis=1) | (one == other[:, ::-1]).any(axis=1)
    return rows[~near.itself[rows[:, 2]] | ((rows[:, 0] < rows[:, 1]) & ~joined)]


def edges_of_both(skin: Skin, shape: Shape, near: NearBodies, ours: IntArray, theirs: IntArray) -> IntArray:
    """Rows (edge of the first body among ours, edge of the second among theirs, pair) near each other; both sorted by number."""
    first = (np.searchsorted(own, skin.first_edge) for own in (ours, theirs))
    items = [(begin, shape.edge_low[own], shape.edge_high[own]) for begin, own in zip(first, (ours, theirs), strict=True)]
    reach = np.maximum(near.alert, 0.2 * near.depth)
    rows = kernels.item_pairs(near.bodies, shape.body_low, shape.body_high, *items[0], *items[1], reach, reach)
    rows[:, 0], rows[:, 1] = ours[rows[:, 0]], theirs[rows[:, 1]]
    return rows
