"""Vertices on facets, both ways: of each pair of bodies, those of either on the faces of the other.

For a vertex v near a body, the nearest feature of its closed surface (facet, edge or vertex, with angle-weighted normals) tells whether v
is inside. Outside, v is in contact with the facet right under it while the gap is at most the alert distance; inside, with the facet that
is its least way out among those that the surface around v faces. So a corner that lies 2 cm inside the side plane of the block it stands
on, and 1e-9 m below its top, touches the top. A face is touched up to its rim, and there only by what reaches over it: bodies whose corners
merely meet do not hold each other, and of two that end in the same place one touches the other's face (`covers`, `bears_by_its_rim` in
`fcsim/contact_detection/skin/_rim_kernels.py`). Over a smooth convex edge or vertex the normal is along the line from it, and continuous.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.contact_detection.general._foot_kernels import feet
from fcsim.contact_detection.general._vertex_kernels import touched_facets
from fcsim.contact_detection.general.folding import open_rows
from fcsim.contact_detection.general.near import NearBodies, near_facets
from fcsim.contact_detection.skin._rim_kernels import Surroundings
from fcsim.contact_detection.skin.skin import Shape, Skin

_SIDES = 3
SAME_PLACE = 1e-6  # a foot with all its weight but this on one vertex is that vertex


class VertexContacts(NamedTuple):
    """nc contacts: vertex, facet (nc,); the facet's weights (nc, 4) at the foot; normal (nc, 3) from its body to the vertex; gap [m]."""

    vertex: IntArray
    facet: IntArray
    weights: FloatArray
    normal: FloatArray
    gap: FloatArray

    def take(self, rows: IntArray | BoolArray) -> VertexContacts:
        return VertexContacts._make(array[rows] for array in self)


def vertex_contacts(
    skin: Skin, shape: Shape, near: NearBodies, reference: Shape, bending: int, face: IntArray
) -> tuple[VertexContacts, IntArray, IntArray]:
    """Contacts of vertices with facets, sorted by (vertex, body of the facet, gap); each physical point once. A pair of a body with itself
    needs its shape in the reference configuration, see `folding`; the first so many bodies are `bending`, deformable;
    face (nf,): number of what is one face, however bent: in the inner corner of two a vertex touches either.

    And the numbers a nb + b of bodies a <= b, sorted, of which a vertex at a rim is not held since it does not reach over it: it may
    soon. And the vertices whose contacts are of a vertex with a vertex, on the surfaces of both, of which one is kept."""
    both = near.both_ways
    vertex, facet, pair = np.ascontiguousarray(near_facets(skin, shape, both).T)
    own = np.flatnonzero(both.itself[pair])
    if len(own):
        around = (skin.facets[facet[own]] == vertex[own, None]).any(axis=1)
        vertex, facet, pair = (np.delete(row, own[around]) for row in (vertex, facet, pair))
        own = np.flatnonzero(both.itself[pair])
    if not len(vertex):
        none = np.empty(0, dtype=np.int64)
        return VertexContacts(none, none, np.empty((0, 4)), np.empty((0, 3)), np.empty(0)), none, none
    foot = feet(vertex, facet, shape.point, skin.facets, skin.sides, shape.normal)
    if len(own):
        of = pair[own]
        reach = np.maximum(both.alert, both.depth)[of]
        closed = own[~open_rows(vertex[own], facet[own], foot[0][own], reach, both.near[of], skin, shape, reference)]
        vertex, facet, pair, *foot = (np.delete(row, closed, axis=0) for row in (vertex, facet, pair, *foot))
    weights, normal, height, distance, feature = foot
    new = np.flatnonzero(np.append(len(vertex) > 0, (vertex[1:] != vertex[:-1]) | (pair[1:] != pair[:-1])))
    first, group = np.append(new, len(vertex)), pair[new]
    rows, N, gap, beyond = touched_facets(
        first, vertex, facet, weights, normal, height, distance, feature,
        both.alert[group], both.depth[group], both.near[group],
        surroundings(skin, shape, bending, face),
    )  # fmt: skip
    pairs = both.bodies[group[beyond]]
    found = VertexContacts(vertex[rows], facet[rows], weights[rows], N, gap)
    found = found.take(np.lexsort((found.gap, skin.facet_body[found.facet], found.vertex)))
    twice, met = _seen_from_the_other_side(skin, found)
    return found.take(~twice), np.unique(pairs.min(axis=1) * skin.n_bodies + pairs.max(axis=1)), met


def surroundings(skin: Skin, shape: Shape, bending: int, face: IntArray) -> Surroundings:
    """Of a skin whose first so many bodies are deformable, with faces as in `vertex_contacts`."""
    return Surroundings(
        shape.point, shape.normal, shape.centre, shape.mean, skin.facets, skin.sides, skin.facet_edges, skin.edge_facets,
        skin.rim, skin.smooth, skin.smooth_vertex, skin.star, skin.first_star, face, int(skin.first_facet[bending]),
    )  # fmt: skip


def _seen_from_the_other_side(skin: Skin, found: VertexContacts) -> tuple[BoolArray, IntArray]:
    """Contacts whose foot is a vertex that is in contact too, with its foot on theirs: the same place, kept for the lower vertex number;
    and those vertices."""
    corner = np.argmax(found.weights, axis=1)
    rows = np.arange(len(corner))
    at_vertex = found.weights[rows, corner] > 1.0 - SAME_PLACE
    under = np.where(at_vertex, skin.facets[found.facet, corner], -1)
    count = len(skin.node) + 1
    ours, theirs = found.vertex * count + under, under * count + found.vertex
    twice = at_vertex & (found.vertex > under)
    known = np.flatnonzero(at_vertex & (found.vertex < under))
    order = known[np.argsort(ours[known], kind="stable")]
    first = np.searchsorted(ours[order], theirs)
    drop = np.zeros(len(twice), dtype=bool)
    for more in range(_SIDES):  # in a corner a vertex touches several sides
        row = np.flatnonzero(twice & (first + more < len(order)))
        partner = order[first[row] + more]
        opposed = np.einsum("cd,cd->c", found.normal[row], found.normal[partner]) < -0.7
        drop[row] |= (ours[partner] == theirs[row]) & opposed
    return drop, under[drop]
