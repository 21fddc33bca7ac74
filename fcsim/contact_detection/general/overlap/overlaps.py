"""Bodies that overlap although no vertex and no pair of sharp edges tells how: one contact each, so that none passes unseen.

Corners that meet head-on may go past each other, see `wedges`. What else there is happens deep inside: a vertex that has gone through a
thin tip is outside again, on the other side. Where an edge of one body goes through a facet of the other, the end that is behind the facet
is its contact; of all such ends of two bodies the least deep one counts. An end far beside the facet is none where the two bodies touch
elsewhere by less: facets that bend are no planes, and an edge that touches their rim goes through these. Nor is one, however near, that
the edge reaches only after it has crossed that rim, in a contact that is less deep: what is behind the facet's plane there is beside it.
"""

from __future__ import annotations

import numpy as np

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.contact_detection.general._foot_kernels import feet
from fcsim.contact_detection.general._pierce_kernels import piercing
from fcsim.contact_detection.general.edges import EdgeContacts
from fcsim.contact_detection.general.near import NearBodies, near_edges_and_facets, near_facets_of_both
from fcsim.contact_detection.general.overlap.wedges import wedge_contacts
from fcsim.contact_detection.general.vertices import VertexContacts
from fcsim.contact_detection.skin.skin import Shape, Skin
from fcsim.mesh.curves.ragged import of_same_key

_BY = 10.0  # times `near`: what overlaps by less touches
_RESTS = 1e-5  # of half a facet: what solvers leave of a contact at rest
_FAR = 10.0  # times the depth: an end farther than this from the facet is beside it
_MORE = 1.1  # of the deepest contact of two bodies: corners overlap by more, or that contact tells of them, too


def overlap_contacts(skin: Skin, shape: Shape, near: NearBodies, vertices: VertexContacts, edges: EdgeContacts) -> VertexContacts | None:
    """Contacts for each two bodies that overlap without one that is so deep; None where there are none, as it should be."""
    near = near.take(~near.itself)
    a, b = near.bodies.T
    d = skin.dimension
    shared = (np.minimum(shape.body_high[a], shape.body_high[b]) - np.maximum(shape.body_low[a], shape.body_low[b]))[:, :d]
    seen = _deepest(skin, near, vertices, edges)
    rows = np.flatnonzero(np.all(shared > _BY * near.near[:, None], axis=1) & (seen <= _RESTS * near.depth))
    if not len(rows):
        return None
    suspect, seen = near.take(rows), seen[rows]
    corners, known = wedge_contacts(skin, shape, suspect, np.maximum(_BY * suspect.near, _MORE * seen))
    others = np.delete(np.arange(len(rows)), known)
    rest = suspect.take(others[seen[others] <= 0.0])  # an edge that is a hair inside goes through facets, too
    deeper = _pierced(skin, shape, rest, vertices, edges) if len(rest.bodies) else None
    if deeper is None:
        return corners if len(known) else None
    return VertexContacts._make(np.concatenate(both) for both in zip(corners, deeper, strict=True))


def _pierced(skin: Skin, shape: Shape, suspect: NearBodies, vertices: VertexContacts, edges_met: EdgeContacts) -> VertexContacts | None:
    """One contact for each two bodies of which an edge of one goes through a facet of the other; those that they have already."""
    both = NearBodies(np.concatenate([suspect.bodies, suspect.bodies[:, ::-1]]), *(np.tile(part, 2) for part in suspect[1:]))
    if skin.dimension == 2:
        edges, rows = np.ascontiguousarray(skin.facets[:, :2]), near_facets_of_both(skin, shape, both)
    else:
        edges, rows = skin.edges, near_edges_and_facets(skin, shape, both)
    edge, facet, pair = np.ascontiguousarray(rows.T)
    through, end = piercing(edge, facet, _BY * both.near[pair], shape.point, shape.normal, edges, skin.facets, skin.sides)
    if not through.any():
        return None
    vertex, facet, pair = edges[edge, end][through], facet[through], pair[through] % len(suspect.bodies)
    height = np.einsum("cd,cd->c", shape.point[vertex] - shape.centre[facet], shape.normal[facet])
    weights, _, _, distance, _ = feet(vertex, facet, shape.point, skin.facets, skin.sides, shape.normal)
    beside = distance > _FAR * np.abs(height)
    if beside.any():
        touching = edges_met.take(edges_met.gap < -height.min()), vertices.take(vertices.gap < -height.min())
        beside &= -height > _least_gaps(skin, suspect, touching[1], touching[0])[pair]
    if len(edges_met.gap):
        beside |= _leaves_over_a_rim(skin, shape, edge[through], facet, end[through], height, edges_met)
    order = np.lexsort((facet, vertex, -height, pair))
    order = order[~beside[order]]
    rows = order[np.append(True, np.diff(pair[order]) != 0)] if len(order) else order
    found = VertexContacts(vertex, facet, weights, shape.normal[facet], height).take(rows)
    return found if len(rows) else None


def _leaves_over_a_rim(
    skin: Skin, shape: Shape, edge: IntArray, facet: IntArray, end: IntArray, height: FloatArray, met: EdgeContacts
) -> BoolArray:
    """Whether edges (n,) that go through facets (n,), by height (n,) < 0 [m] at their ends (n,), 0 or 1, have known contacts that are less
    deep with an edge of that facet, between the facet and that end."""
    count, nf = len(met.gap), len(skin.facets)
    sides = [(met.edges[:, own], met.edges[:, 1 - own]) for own in range(2)]
    crossing = np.concatenate([np.repeat(own * nf, 2) + skin.edge_facets[other].ravel() for own, other in sides])
    row, contact = of_same_key(crossing, edge * nf + facet)
    own, contact = contact // (2 * count), contact % (2 * count) // 2
    origin = shape.point[skin.facets[facet[row], 0]]  # as `pierced` has it
    heights = np.einsum("red,rd->re", shape.point[skin.edges[edge[row]]] - origin[:, None], shape.normal[facet[row]])
    through = heights[:, 0] / (heights[:, 0] - heights[:, 1])  # of its length; the two have different signs
    after = np.where(end[row] == 1, 1.0, -1.0) * (met.place[contact, own] - through) >= 0.0
    return np.bincount(row[after & (met.gap[contact] > height[row])], minlength=len(edge)) > 0


def _deepest(skin: Skin, near: NearBodies, vertices: VertexContacts, edges: EdgeContacts) -> FloatArray:
    """How deep the deepest contact of each pair of bodies is (np,) [m]; 0 without one."""
    least = _least_gaps(skin, near, vertices.take(vertices.gap < 0), edges.take(edges.gap < 0))
    return np.where(np.isfinite(least), -least, 0.0)


def _least_gaps(skin: Skin, near: NearBodies, vertices: VertexContacts, edges: EdgeContacts) -> FloatArray:
    """The least gap of these contacts between each pair of bodies (np,) [m]; infinite without one."""
    pairs = np.concatenate(
        [
            np.column_stack([skin.vertex_body[vertices.vertex], skin.facet_body[vertices.facet]]),
            skin.vertex_body[skin.edges[edges.edges, 0]].reshape(-1, 2),
        ]
    )
    keys, wanted = (rows.min(axis=1) * skin.n_bodies + rows.max(axis=1) for rows in (pairs, near.bodies))
    if not len(keys):
        return np.full(len(wanted), np.inf)
    order = np.argsort(keys)
    sorted_keys, gap = keys[order], np.concatenate([vertices.gap, edges.gap])[order]
    least = np.minimum.reduceat(gap, np.flatnonzero(np.append(True, np.diff(sorted_keys) != 0)))
    found = np.unique(sorted_keys)
    place = np.minimum(np.searchsorted(found, wanted), len(found) - 1)
    return np.where(found[place] == wanted, least[place], np.inf)
