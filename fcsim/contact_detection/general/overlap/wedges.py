"""Corners that have gone past each other: sharp edges along each other in space, vertices in the plane, of which neither is inside the
other body although both bodies overlap.

Across its edge a body is a wedge between two faces. Two wedges overlap where no direction N parts them: every N between the outward
normals of the one and against those of the other has a gap N . r < 0, r from the one edge to the other. These N lie between two of the four
faces' normals, and of those two the one with the larger gap is the way out: a contact with that face, beside its rim.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.contact_detection.general._foot_kernels import feet
from fcsim.contact_detection.general._pierce_kernels import inside, inside_polygon
from fcsim.contact_detection.general.near import NearBodies, near_edges, near_vertices
from fcsim.contact_detection.general.overlap._wedge_kernels import may_pass
from fcsim.contact_detection.general.vertices import VertexContacts
from fcsim.contact_detection.skin.skin import Shape, Skin

_ALONG = 0.5  # sine of the angle up to which edges run along each other
_ALIKE = 0.9  # cosine between normals that are the same way out
_FLAT = 1.0 - 1e-9  # cosine of a direction of contact that is the face's own
_FLUSH = 1e-3  # of two faces, the angle below which they lie on each other and do not cross
_WELL = 0.01  # of the depth behind both faces: a point nearer to any face may lie in a joint that overlaps by noise
_FAR = 10.0  # times the depth: a foot that lies farther beside its vertex is that of another place
_ROUND = 1e-9
_THIN = 1e-6  # determinant of two unit vectors that are parallel


class _Corners(NamedTuple):
    """Rows of two corners: ends (n, 2, 2) of each as vertices (in the plane one, twice); facet (n, 2, 2) of each, first and second;
    origin (n, 2, 3) [m]: a point of each; across (n, 2, 2, 3): unit vectors from there into its two faces, across the edge; pair (n,)."""

    ends: IntArray
    facet: IntArray
    origin: FloatArray
    across: FloatArray
    pair: IntArray

    def take(self, rows: IntArray | BoolArray) -> _Corners:
        return _Corners._make(array[rows] for array in self)


def wedge_contacts(skin: Skin, shape: Shape, near: NearBodies, touch: FloatArray) -> tuple[VertexContacts, IntArray]:
    """Contacts of corners that overlap by more than `touch` (np,) [m] of pairs of bodies without any, and which pairs these are."""
    none = np.empty(0, dtype=np.int64)
    nothing = VertexContacts(none, none, np.empty((0, 4)), np.empty((0, 3)), np.empty(0)), none
    corners = _vertices(skin, shape, near) if skin.dimension == 2 else _edges(skin, shape, near, touch)
    if corners is None:
        return nothing
    normals = shape.normal[corners.facet]
    way = corners.origin[:, 0] - corners.origin[:, 1]
    # directions from the second corner to the first: the second's normals, and against the first's
    N = np.concatenate([normals[:, 1], -normals[:, 0]], axis=1)
    gap = np.einsum("rkd,rd->rk", N, way)
    parts = _between(N, normals[:, 1]) & _between(-N, normals[:, 0])
    most = np.where(parts, gap, -np.inf).max(axis=1, initial=-np.inf)
    rows = np.flatnonzero((most < -touch[corners.pair]) & np.isfinite(most))
    rows = rows[_overlap(skin, shape, corners.take(rows), -most[rows], near)]
    if not len(rows):
        return nothing
    rows = rows[np.lexsort((-most[rows], corners.pair[rows]))]
    new = np.append(True, np.diff(corners.pair[rows]) != 0)
    best = rows[new][np.cumsum(new) - 1]  # of each row's two bodies the least deep
    face = np.where(parts, gap, -np.inf).argmax(axis=1)
    same = np.einsum("rd,rd->r", N[rows, face[rows]], N[best, face[best]]) > _ALIKE
    return _at_ends(skin, shape, corners.take(rows[same]), face[rows[same]], near), np.unique(corners.pair[rows])


def _between(N: FloatArray, normals: FloatArray) -> BoolArray:
    """Which directions N (n, k, 3) lie between two normals (n, 2, 3) of faces that meet in a convex edge, ends included."""
    a, b = normals[:, None, 0], normals[:, None, 1]
    cosine = np.einsum("rkd,rkd->rk", a, b)
    toward_a, toward_b = np.einsum("rkd,rkd->rk", N, a), np.einsum("rkd,rkd->rk", N, b)
    # N = x a + y b in the plane of both, up to a positive factor
    between: BoolArray = (toward_a - cosine * toward_b >= -_ROUND) & (toward_b - cosine * toward_a >= -_ROUND)
    return between


def _vertices(skin: Skin, shape: Shape, near: NearBodies) -> _Corners:
    """Convex corners of polygons near each other."""
    rows = near_vertices(skin, shape, near)
    v = rows[:, :2]
    facet = np.stack([skin.star[skin.first_star[v]], skin.star[skin.first_star[v] + 1]], axis=2)
    point = shape.point[v]
    along = 2 * (shape.centre[facet] - point[:, :, None])
    across = along / np.linalg.norm(along, axis=3)[..., None]
    corners = _Corners(np.stack([v, v], axis=2), facet, point, across, rows[:, 2])
    convex = np.einsum("rcd,rcd->rc", across[:, :, 0], shape.normal[facet[:, :, 1]]) < -_THIN
    return corners.take(convex.all(axis=1))


def _edges(skin: Skin, shape: Shape, near: NearBodies, touch: FloatArray) -> _Corners | None:
    """Sharp edges near each other that run along each other over some length and may overlap by more than `touch` (np,) [m]; None where
    there are none."""
    rows = near_edges(skin, shape, near._replace(alert=near.depth))
    rows = rows[may_pass(rows, near.near, touch, _ALONG, _ROUND, shape.point, shape.normal, skin.edges, skin.edge_facets)]
    if not len(rows):
        return None
    e = rows[:, :2]
    ends = shape.point[skin.edges[e]]
    axis = ends[:, :, 1] - ends[:, :, 0]
    length = np.linalg.norm(axis, axis=2)
    axis = axis / length[:, :, None]
    first, second = axis[:, 0], axis[:, 1]
    # the part of the first edge beside the second
    places = np.einsum("red,rd->re", ends[:, 1] - ends[:, 0, :1], first)
    low, high = np.maximum(places.min(axis=1), 0.0), np.minimum(places.max(axis=1), length[:, 0])
    sine = np.linalg.norm(np.cross(first, second), axis=1)
    beside = (sine < _ALONG) & (high - low > near.near[rows[:, 2]])
    place = 0.5 * (low + high)
    on_first = ends[:, 0, 0] + place[:, None] * first
    on_second = ends[:, 1, 0] + np.einsum("rd,rd->r", on_first - ends[:, 1, 0], second)[:, None] * second
    origin = np.stack([on_first, on_second], axis=1)
    facet = skin.edge_facets[e]
    n = shape.normal[facet]
    across = np.stack([np.cross(n[:, :, 0], axis), np.cross(axis, n[:, :, 1])], axis=2)
    return _Corners(skin.edges[e], facet, origin, across, rows[:, 2]).take(beside)


def _overlap(skin: Skin, shape: Shape, corners: _Corners, depth: FloatArray, near: NearBodies) -> BoolArray:
    """Whether the bodies overlap beside their corners, by depth (n,) [m]: where a face of one crosses a face of the other, a point behind
    both is well inside both bodies."""
    n = len(corners.pair)
    ours, theirs = np.repeat(corners.across[:, 0], 2, axis=1), np.tile(corners.across[:, 1], (1, 2, 1))
    normals = shape.normal[corners.facet]
    behind = np.repeat(normals[:, 0], 2, axis=1) + np.tile(normals[:, 1], (1, 2, 1))
    between = np.linalg.norm(behind, axis=2)
    behind /= np.maximum(between, _THIN)[..., None]
    way = corners.origin[:, 1] - corners.origin[:, 0]
    # origin_0 + s ours = origin_1 + t theirs across the edges, by least squares of the three components
    aa, ab, bb = (np.einsum("rkd,rkd->rk", p, q) for p, q in ((ours, ours), (ours, theirs), (theirs, theirs)))
    a, b = np.einsum("rkd,rd->rk", ours, way), np.einsum("rkd,rd->rk", theirs, way)
    det = aa * bb - ab * ab
    safe = np.where(det > _THIN, det, 1.0)
    s, t = (bb * a - ab * b) / safe, (ab * a - aa * b) / safe
    row, k = np.nonzero((det > _THIN) & (between > _FLUSH) & (s > 0) & (t > 0))
    at = corners.origin[row, 0] + s[row, k, None] * ours[row, k] - 0.25 * depth[row, None] * behind[row, k]
    bodies = np.ascontiguousarray(near.bodies[corners.pair[row]].T)
    if skin.dimension == 2:
        within = [inside_polygon(at, bodies[k], skin.first_facet, shape.point, skin.facets) for k in range(2)]
    else:
        once, surface = np.ones(len(row), dtype=np.int64), (skin.first_facet, shape.point, skin.facets, skin.sides)
        off = _WELL * between[row, k] * depth[row]
        within = [inside(at, bodies[k], once, off, *surface) for k in range(2)]
    return np.bincount(row[within[0] & within[1]], minlength=n) > 0


def _at_ends(skin: Skin, shape: Shape, corners: _Corners, face: IntArray, near: NearBodies) -> VertexContacts:
    """The contacts of corners with the face (n,) that is the way out, 0, 1 of the second, 2, 3 of the first: of the other corner's ends
    that lie beside this one's edge, with their feet on that face or, beside it, on that edge; else of its own ends on the other's."""
    rows = np.arange(len(face))
    owner = np.where(face < 2, 1, 0)
    facet, other = corners.facet[rows, owner, face % 2], corners.facet[rows, 1 - owner]
    normal = shape.normal[facet]
    against = other[rows, np.einsum("rkd,rd->rk", shape.normal[other], -normal).argmax(axis=1)]
    theirs, own = corners.ends[rows, 1 - owner], corners.ends[rows, owner]
    limit = near.near[corners.pair]
    place, beside = _places(shape, theirs, own, limit)
    back, mine = _places(shape, own, theirs, limit)
    mine &= ~beside.any(axis=1)[:, None]
    vertex = np.concatenate([theirs[beside], own[mine]])
    edge = np.concatenate([own[np.nonzero(beside)[0]], theirs[np.nonzero(mine)[0]]])
    on = np.concatenate([facet[np.nonzero(beside)[0]], against[np.nonzero(mine)[0]]])
    N = np.concatenate([normal[np.nonzero(beside)[0]], -normal[np.nonzero(mine)[0]]])
    share = np.concatenate([place[beside], back[mine]])
    keep = np.unique(np.column_stack([vertex, on]), axis=0, return_index=True)[1]
    vertex, edge, on, N, share = vertex[keep], edge[keep], on[keep], N[keep], share[keep]
    is_first = (skin.facets[on] == edge[:, :1]) & skin.real[on]
    is_second = (skin.facets[on] == edge[:, 1:]) & skin.real[on] & ~is_first
    weights = is_first * (1 - share)[:, None] + is_second * share[:, None]
    near_of = np.concatenate([limit[np.nonzero(beside)[0]], limit[np.nonzero(mine)[0]]])[keep]
    on, weights = _on_face(skin, shape, vertex, on, weights, N, near_of)
    arm = shape.point[vertex] - np.einsum("rk,rkd->rd", weights, shape.point[skin.facets[on]])
    gap = np.einsum("rd,rd->r", arm, N)
    keep = _beside(skin, vertex, on, np.linalg.norm(arm - gap[:, None] * N, axis=1), _FAR * np.abs(gap) + near_of)
    return VertexContacts(vertex, on, weights, N, gap).take(keep)


def _beside(skin: Skin, vertex: IntArray, on: IntArray, off: FloatArray, most: FloatArray) -> IntArray:
    """Contacts (n,) whose foot lies beside its vertex by `off` (n,) [m] no farther than `most` (n,) [m], and of bodies without such the
    nearest: the couple of its two forces is the least."""
    pair = skin.vertex_body[vertex] * skin.n_bodies + skin.facet_body[on]
    order = np.lexsort((off / most, pair))
    nearest = np.append(True, np.diff(pair[order]) != 0)
    return np.sort(order[nearest | (off <= most)[order]])


def _on_face(
    skin: Skin, shape: Shape, vertex: IntArray, on: IntArray, weights: FloatArray, N: FloatArray, near: FloatArray
) -> tuple[IntArray, FloatArray]:
    """The nearest facet in the plane of each facet `on` (n,) that faces along N, and the weights of the foot there; others as they are.

    The corner's edge may be the farther one of a joint: forces act where the bodies meet. All facets of a body are looked at, since
    contacts that only corners tell of are few."""
    body = skin.facet_body[on]
    first, count = skin.first_facet[body], skin.first_facet[body + 1] - skin.first_facet[body]
    row = np.repeat(np.arange(len(on)), count)
    facet = np.arange(len(row)) - np.repeat(np.cumsum(count) - count - first, count)
    alike = np.einsum("rd,rd->r", N[row], shape.normal[facet]) > _FLAT
    alike &= np.einsum("rd,rd->r", N[row], shape.normal[on[row]]) > _FLAT
    row, facet = row[alike], facet[alike]
    off = np.einsum("rd,rd->r", shape.centre[facet] - shape.centre[on[row]], N[row])
    row, facet = row[np.abs(off) <= near[row]], facet[np.abs(off) <= near[row]]
    place, _, _, distance, _ = feet(vertex[row], facet, shape.point, skin.facets, skin.sides, shape.normal)
    order = np.lexsort((facet, distance, row))
    nearest = order[np.append(True, np.diff(row[order]) != 0)] if len(order) else order
    on, weights = on.copy(), weights.copy()
    on[row[nearest]], weights[row[nearest]] = facet[nearest], place[nearest]
    return on, weights


def _places(shape: Shape, ends: IntArray, edge: IntArray, near: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Where ends (n, 2) lie along an edge, given by its own two (n, 2), 0 to 1, and which lie beside it; where the edge is a vertex, the
    first."""
    start, along = shape.point[edge[:, 0]], shape.point[edge[:, 1]] - shape.point[edge[:, 0]]
    length = np.linalg.norm(along, axis=1)
    margin = (near / np.where(length > 0, length, 1.0))[:, None]
    place = np.einsum("red,rd->re", shape.point[ends] - start[:, None], along) / np.where(length > 0, length, 1.0)[:, None] ** 2
    beside = (place >= -margin) & (place <= 1 + margin)
    beside[length == 0] = [True, False]
    return np.clip(place, 0.0, 1.0), beside
