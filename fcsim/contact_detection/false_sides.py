"""Sides that a point within their reach does not touch: of explicit pairs, each of which knows two surfaces and not the bodies.

A corner that stands 2 cm inside the edge of a pier's top lies 2 cm behind the pier's side, and a pair that holds that side takes this for a
penetration. What all pairs together know of the two bodies says better:

* A node that touches two faces of a body which meet in a convex edge leaves by the nearer one. (In an inner corner it touches both.)
* A point far behind a face that is outside the body's known facets, or at one of them which looks the other way, has not come through
  the face.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.contact_detection.general._foot_kernels import feet
from fcsim.contact_detection.surfaces import facets as contact_facets
from fcsim.contact_detection.surfaces.facets import Facets

_NEARER = 0.5  # a way out of less than this part of another one
DEEP = 1e-2  # of a facet: less deep is a penetration whatever else is near
_BEYOND = 1e-2  # of the depth: a point higher above its nearest facet is outside
_AT, _AWAY = 0.25, -0.5  # of the depth: nearer to a facet; cosine between faces that look away from each other


class KnownFacets(NamedTuple):
    """All facets that pairs name, of slaves and masters, sorted by body, each once; corners (nf, 4) node numbers, a triangle's first and a
    segment's both again; sides (nf,): 2, 3 or 4."""

    facets: Facets
    corners: IntArray
    sides: IntArray


def known_facets(slaves: Facets, masters: Facets) -> KnownFacets:
    """Return the facets of both."""
    width = max(slaves.width, masters.width)
    nodes = [np.pad(part.nodes, ((0, 0), (0, width - part.width)), constant_values=-1) for part in (slaves, masters)]
    body = np.concatenate([slaves.bodies, masters.bodies])
    every = np.concatenate(nodes)
    _, first = np.unique(np.column_stack([body, np.sort(every, axis=1)]), axis=0, return_index=True)
    every, body = every[first], body[first]
    closed = np.where(every < 0, every[:, :1], every)
    last = closed[:, [1, 0]] if width == 2 else closed[:, :1] if width == 3 else closed[:, :0]
    return KnownFacets(Facets(every, closed, body, np.array([0, len(every)])), np.hstack([closed, last]), (every >= 0).sum(axis=1))


def leaves_by_another_face(
    node: IntArray, body: IntArray, gap: FloatArray, normal: FloatArray, centre: FloatArray, least: FloatArray
) -> BoolArray:
    """Rows (n,) of one node and one body that have a nearer way out by a face that meets theirs in a convex edge.

    node (n,), -1 = not a node; body (n,) of the facet; gap (n,) [m], normal and centre (n, d) of the facet; least (n,) [m]: a depth that
    counts as none.
    """
    drop = np.zeros(len(gap), dtype=bool)
    order = np.lexsort((gap, body, node))
    node, body = node[order], body[order]
    for shift in range(1, len(order)):
        same = np.flatnonzero((node[shift:] == node[:-shift]) & (body[shift:] == body[:-shift]) & (node[shift:] >= 0))
        if not len(same):
            break
        deep, high = order[same], order[same + shift]
        arm = centre[high] - centre[deep]
        convex = (np.einsum("nd,nd->n", arm, normal[deep]) < 0) & (np.einsum("nd,nd->n", arm, normal[high]) > 0)
        drop[deep] |= convex & (-gap[deep] > least[deep]) & (np.abs(gap[high]) < -_NEARER * gap[deep])
    return drop


def came_another_way(
    point: FloatArray, body: IntArray, gap: FloatArray, normal: FloatArray, size: FloatArray, known: KnownFacets, positions: FloatArray
) -> BoolArray:
    """Rows (n,) of points (n, d) [m] far behind a facet (its body, normal (n, d), size and gap [m]) which they have not come through, by
    what is known of that body, with its nodes at `positions` (n_nodes, d) [m]."""
    drop = np.zeros(len(gap), dtype=bool)
    deep = np.flatnonzero(-gap > DEEP * size)
    if not len(deep):
        return drop
    d, n = positions.shape[1], len(positions)
    first, last = (np.searchsorted(known.facets.bodies, body[deep], side) for side in ("left", "right"))
    count = last - first
    begin = np.cumsum(count) - count
    row = np.repeat(np.arange(len(deep)), count)
    facet = np.arange(len(row)) + np.repeat(first - begin, count)
    places = np.pad(np.concatenate([positions, point[deep]]), ((0, 0), (0, 3 - d)))
    normals = np.pad(contact_facets.geometry(known.facets, positions).normal, ((0, 0), (0, 3 - d)))
    _, outward, height, distance, _ = feet(row + n, facet, places, known.corners, known.sides, normals)
    depth = -gap[deep][row]
    at_nearest = distance <= np.minimum.reduceat(distance, begin)[row] + 1e-9 * depth
    away = np.einsum("nd,nd->n", outward[:, :d], normal[deep][row]) < _AWAY
    false = at_nearest & ((height > _BEYOND * depth) | (away & (distance < _AT * depth)))
    drop[deep] = np.bincount(row[false], minlength=len(deep)) > 0
    return drop
