"""Sharp edges across sharp edges: the corners of a contact patch that no vertex holds, and the crossing of two edges in space.

Where a face of one body lies flat on a face of the other, the patch they share is the intersection of two polygons. Its corners are
vertices of either face (see `vertices`) and crossings of their edges; these carry the patch's moments, and their normal is the face's.
Of faces that are tilted, by up to a degree, edges that cross at more than 30 degrees have their own: on a body that tips over an edge the
other face's would take energy from what slides.
Faces of deformable bodies bend over what is sharp, and bear along it: their inner edges count as well, see `face_edges`.
Elsewhere two edges touch where their directions a x b lie in the arcs between their faces' normals (the Gauss map: the pair is then a
face of the Minkowski difference); the gap is the distance along a x b.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.contact_detection.general._edge_kernels import EdgesOfAll, crossings
from fcsim.contact_detection.general._pierce_kernels import inside
from fcsim.contact_detection.general.face_edges import FaceEdges, near_edges_across_faces
from fcsim.contact_detection.general.folding import open_edges
from fcsim.contact_detection.general.near import NearBodies, near_edges
from fcsim.contact_detection.general.vertices import VertexContacts
from fcsim.contact_detection.skin.skin import Shape, Skin

_DEEPER = 2.0  # times the way out by a vertex: an edge that lies deeper leaves that way
_OFF = 0.1  # of `near`: what is less inside is on the surface
_ANOTHER_WAY = 0.9  # cosine between directions that are different
_SLOPE = 0.9994  # cosine of 2 degrees: what lies on a sharp edge and leans to its sides by more does not lie on them
_BESIDE = 0.1  # of an edge within a face: how far its vertices are from a sharp edge that they lie on, or slide over


class EdgeContacts(NamedTuple):
    """nc contacts: edges (nc, 2) of two bodies; places (nc, 2) on them, 0 ... 1; normal (nc, 3) from the second to the first; gap (nc,)."""

    edges: IntArray
    place: FloatArray
    normal: FloatArray
    gap: FloatArray

    def take(self, rows: IntArray | BoolArray) -> EdgeContacts:
        return EdgeContacts._make(array[rows] for array in self)


def edge_contacts(skin: Skin, shape: Shape, near: NearBodies, vertices: VertexContacts, reference: Shape, faces: FaceEdges) -> EdgeContacts:
    """Contacts of sharp edges with each other and with those of `faces`, sorted by their numbers.

    Edges that overlap do so truly if one goes through both faces of the other, or if what lies between them is inside both bodies. Where
    an end is inside the other body, a much shorter way out by that end in another direction shows that the edges only cross in passing:
    no contact. So does one by a crossing of the same edge with another one beside it: an edge that cuts off the tip of a corner by a hair
    crosses all three edges that meet there, and leaves by the shortest way.
    """
    if skin.dimension == 2:  # the edges of a polygon are its vertices
        near = near.take(np.zeros(len(near.bodies), dtype=bool))
    rows = near_edges(skin, shape, near)
    if len(faces.within):
        rows = np.concatenate([rows, near_edges_across_faces(skin, shape, near, faces)])
    first, second, pair = np.ascontiguousarray(rows.T)
    around = EdgesOfAll(
        shape.point, shape.normal, shape.size, shape.mean, skin.edges, skin.edge_facets, skin.facets, skin.sides, skin.sharp,
        faces.goes_on, faces.bending,
    )  # fmt: skip
    row, normal, gap, place, pierced = crossings(first, second, near.alert[pair], near.depth[pair], near.near[pair], around)
    found = EdgeContacts(np.column_stack([first[row], second[row]]), place, normal, gap)
    own = np.flatnonzero(near.itself[pair[row]])
    if len(own):
        of = pair[row[own]]
        reach = np.maximum(near.alert, near.depth)[of]
        closed = own[~open_edges(found.edges[own], place[own], reach, near.near[of], skin, reference)]
        row, pierced, found = np.delete(row, closed), np.delete(pierced, closed), found.take(np.delete(np.arange(len(row)), closed))
    keep = pierced > 0
    keep[~keep] = _overlap(skin, shape, found.take(~keep), near.near[pair[row[~keep]]])
    deep = np.flatnonzero(keep & (pierced < 2))
    keep[deep] = ~_leaves_by_a_vertex(skin, found.take(deep), vertices, near.near[pair[row[deep]]])
    found, near_of = found.take(keep), near.near[pair[row[keep]]]
    found = found.take(~_leaves_by_another_edge(skin, shape, found, near_of))
    return found.take(np.lexsort((found.edges[:, 1], found.edges[:, 0])))


def _overlap(skin: Skin, shape: Shape, found: EdgeContacts, near: FloatArray) -> BoolArray:
    """Whether the middle between the nearest points of both edges is inside both bodies; of a body with itself, inside it twice. (Where it
    lies on a surface, it is not: in a stack of equal plates the middle between the outer edges of two is on the faces that touch.)"""
    ends = shape.point[skin.edges[found.edges]]
    nearest = ends[:, :, 0] + found.place[:, :, None] * (ends[:, :, 1] - ends[:, :, 0])
    bodies = skin.vertex_body[skin.edges[found.edges, 0]]
    middle = nearest.mean(axis=1)
    surface = (skin.first_facet, shape.point, skin.facets, skin.sides)
    times = np.where(bodies[:, 0] == bodies[:, 1], 2, 1)
    ours, theirs = (inside(middle, body, times, _OFF * near, *surface) for body in np.ascontiguousarray(bodies.T))
    return ours & theirs


def _leaves_by_a_vertex(skin: Skin, found: EdgeContacts, vertices: VertexContacts, near: FloatArray) -> BoolArray:
    """Whether an end of either edge has a much shorter way out of the other body in another direction."""
    leaves = np.zeros(len(found.gap), dtype=bool)
    if not len(vertices.gap) or not len(leaves):
        return leaves
    nb = skin.n_bodies
    key = vertices.vertex * nb + skin.facet_body[vertices.facet]
    for own, other in ((0, 1), (1, 0)):
        body = skin.vertex_body[skin.edges[found.edges[:, other], 0]]
        for end in range(2):
            wanted = skin.edges[found.edges[:, own], end] * nb + body
            place = np.minimum(np.searchsorted(key, wanted), len(key) - 1)
            inside = (key[place] == wanted) & (vertices.gap[place] <= near)
            shorter = -found.gap > _DEEPER * np.maximum(-vertices.gap[place], near)
            aligned = np.abs(np.einsum("cd,cd->c", found.normal, vertices.normal[place])) > _ANOTHER_WAY
            leaves |= inside & shorter & ~aligned
    return leaves


def _leaves_by_another_edge(skin: Skin, shape: Shape, found: EdgeContacts, near: FloatArray) -> BoolArray:
    """Whether either edge crosses another one of the same body, no farther away than this crossing is deep, with a much shorter way out in
    another direction."""
    leaves = np.zeros(len(found.gap), dtype=bool)
    if not np.any(found.gap < -near):
        return leaves
    ends = shape.point[skin.edges[found.edges]]
    length = np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2)
    for own, other in ((0, 1), (1, 0)):
        body = skin.vertex_body[skin.edges[found.edges[:, other], 0]]
        key = found.edges[:, own] * skin.n_bodies + body
        order = np.lexsort((-found.gap, key))
        order = order[found.gap[order] <= near[order]]
        shallow, first = np.unique(key[order], return_index=True)
        least = order[first]
        place = np.minimum(np.searchsorted(shallow, key), len(shallow) - 1)
        least, known = least[place], shallow[place] == key
        shorter = -found.gap > _DEEPER * np.maximum(-found.gap[least], near)
        aligned = np.abs(np.einsum("cd,cd->c", found.normal, found.normal[least])) > _ANOTHER_WAY
        beside = np.abs(found.place[:, own] - found.place[least, own]) * length[:, own] <= -found.gap
        leaves |= known & shorter & ~aligned & beside
    return leaves


def each_place_once(
    skin: Skin, shape: Shape, vertices: VertexContacts, edges: EdgeContacts, faces: FaceEdges
) -> tuple[VertexContacts, EdgeContacts]:
    """The contacts without those of vertices on the slopes beside a sharp edge on which the face around them lies, and of edges that meet
    in a vertex one, with their mean normal, or none where the vertex is held by itself."""
    if not len(edges.gap):
        return vertices, edges
    end = (edges.place > 0.5).astype(np.int64)
    row, side = np.nonzero(edges.place == end)
    vertex, other = skin.edges[edges.edges[row, side], end[row, side]], edges.edges[row, 1 - side]
    _, once, place = np.unique(vertex * len(skin.edges) + other, return_index=True, return_inverse=True)
    edges = _with_mean_normals(edges, row, np.where(side == 1, -1.0, 1.0), place)
    inner, which = np.nonzero(np.isin(edges.edges, faces.within))
    around = skin.facets[skin.edge_facets[edges.edges[inner, which]]].reshape(-1, 8)
    vertices = vertices.take(~_on_slopes(skin, shape, vertices, edges, inner, which, around))
    vertices = vertices.take(~_on_slopes(skin, shape, vertices, edges, row, side, vertex[:, None]))
    body = skin.vertex_body[skin.edges[other, 0]]
    held = np.isin(vertex * skin.n_bodies + body, vertices.vertex * skin.n_bodies + skin.facet_body[vertices.facet])
    again = np.ones(len(row), dtype=bool)
    again[once] = False
    drop = np.zeros(len(edges.gap), dtype=bool)
    drop[row[held | again]] = True
    return vertices, edges.take(~drop)


def _with_mean_normals(edges: EdgeContacts, row: IntArray, sign: FloatArray, place: IntArray) -> EdgeContacts:
    """With the mean normal of those contacts `row` (n,), turned by `sign` (n,), that are at one `place` (n,): what is bent over an edge is
    held by neither of its sides alone."""
    towards = sign[:, None] * edges.normal[row]
    mean = np.zeros((len(row), 3))
    np.add.at(mean, place, towards)
    mean = mean[place] / np.linalg.norm(mean[place], axis=1)[:, None]
    normal, gap = edges.normal.copy(), edges.gap.copy()
    normal[row] = sign[:, None] * mean
    gap[row] *= np.einsum("cd,cd->c", mean, towards)
    return edges._replace(normal=normal, gap=gap)


def _on_slopes(
    skin: Skin, shape: Shape, found: VertexContacts, edges: EdgeContacts, row: IntArray, side: IntArray, around: IntArray
) -> BoolArray:
    """Which vertices' contacts (nc,) lean on a face beside a sharp edge that they lie on: of the vertices `around` (n, k) a crossing, of
    the `row` (n,) of `edges` and the edge `side` (n,) of it, those beside the other edge. What is farther away may lie on its sides."""
    drop = np.zeros(len(found.gap), dtype=bool)
    towards = np.where(side == 1, -1.0, 1.0)[:, None] * edges.normal[row]
    ours, theirs = edges.edges[row, side], edges.edges[row, 1 - side]
    along, crossed = (np.subtract(*shape.point[skin.edges[which]].swapaxes(0, 1)) for which in (theirs, ours))
    off = np.cross(shape.point[around] - shape.point[skin.edges[theirs, 0]][:, None], along[:, None])
    limit = _BESIDE**2 * np.einsum("nd,nd->n", along, along) * np.einsum("nd,nd->n", crossed, crossed)
    across, place = np.nonzero(np.einsum("nkd,nkd->nk", off, off) <= limit[:, None])
    vertex, key = around[across, place], found.vertex * skin.n_sides + skin.side[found.facet]
    for slope in skin.edge_facets[theirs].T:
        leans = np.einsum("cd,cd->c", shape.normal[slope], towards)[across] < _SLOPE
        known, first = np.unique(vertex[leans] * skin.n_sides + skin.side[slope[across[leans]]], return_index=True)
        rows = np.flatnonzero(np.isin(key, known))
        normal = towards[across[leans][first[np.searchsorted(known, key[rows])]]]
        drop[rows] |= np.einsum("cd,cd->c", found.normal[rows], normal) < _SLOPE
    return drop
