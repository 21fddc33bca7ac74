"""No contact of two convex bodies is deeper than they overlap.

The least way along a facet's normal that parts two convex bodies is at least as long as the least way out of any of their corners and
crossings. A contact that is much deeper is none: where corners of several bodies meet and files' digits leave them inside each other by
micrometres, a corner may face none of the faces that it is at, but a far one.
"""

from __future__ import annotations

import numpy as np

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.contact_detection.general.edges import EdgeContacts
from fcsim.contact_detection.general.near import NearBodies
from fcsim.contact_detection.general.overlap._convex_kernels import shallowest_overlaps
from fcsim.contact_detection.general.vertices import VertexContacts
from fcsim.contact_detection.skin.skin import Shape, Skin

_DEEP = 1e-3  # of half a facet: what is looked at
_DEEPER = 2.0  # times the overlap: round-off, and facets that are not quite plane
_NEAR = 10.0  # times `near`
_MOST = 1_000_000  # facets times vertices of two bodies: a millisecond


def shallow_vertices(skin: Skin, shape: Shape, near: NearBodies, found: VertexContacts) -> VertexContacts:
    """Those contacts that are no deeper than their bodies overlap; near: pairs a < b, sorted, and after them bodies with themselves."""
    bodies = np.column_stack([skin.vertex_body[found.vertex], skin.facet_body[found.facet]])
    keep = _within_overlap(skin, shape, near, bodies, found.gap)
    return found if keep.all() else found.take(keep)


def shallow_edges(skin: Skin, shape: Shape, near: NearBodies, found: EdgeContacts) -> EdgeContacts:
    """The same of edges."""
    keep = _within_overlap(skin, shape, near, skin.vertex_body[skin.edges[found.edges, 0]], found.gap)
    return found if keep.all() else found.take(keep)


def _within_overlap(skin: Skin, shape: Shape, near: NearBodies, bodies: IntArray, gap: FloatArray) -> BoolArray:
    """Which contacts (nc,) of bodies (nc, 2) with gaps (nc,) [m] are no deeper than their bodies overlap; those of bodies that are not
    convex all are, and so are contacts of a body with itself."""
    keep = np.ones(len(gap), dtype=bool)
    near = near.take(~near.itself)
    deep = np.flatnonzero((gap < 0.0) & (bodies[:, 0] != bodies[:, 1]))
    ordered = np.sort(bodies[deep], axis=1) @ [skin.n_bodies, 1]
    pair = np.searchsorted(near.bodies @ [skin.n_bodies, 1], ordered)
    deeper = gap[deep] < -_DEEP * near.depth[pair]
    deep, pair = deep[deeper], pair[deeper]
    if not len(deep):
        return keep
    pairs, row = np.unique(pair, return_inverse=True)
    of = near.take(pairs)
    surface = (skin.first_facet, skin.first_vertex, shape.normal, shape.centre, shape.point)
    overlap = shallowest_overlaps(of.bodies, of.near, *surface, _MOST)
    keep[deep] = -gap[deep] <= _DEEPER * overlap[row] + _NEAR * of.near[row]
    return keep
