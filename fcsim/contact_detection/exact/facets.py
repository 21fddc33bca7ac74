"""Contacts of balls and capsules with meshed bodies: where the distance to the skin has a minimum, on a face, an edge or a vertex."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.contact_detection.exact.mesh_skin import MeshSkin, normals
from fcsim.contact_detection.exact.solids import Placed, Touch, leaves_by_its_side, no_touch
from fcsim.contact_detection.surfaces.broad_phase import near_pairs
from fcsim.mesh.curves.ragged import each_of, of_same_key

_TIE = 1e-9  # distances equal up to this share of the radius are one
_FLAT = 1 - 1e-9  # cosine between facets of one face: the edge between them is none
_FAN = 0.05  # sine by which the normal may leave the fan of an edge: what lies flat over a face's border stays on it
_DEEP = 0.5  # of the radius: what lies deeper below a face is another part of the body, unless it is the nearest

LEVEL = 1e-6
"""Of the radius: edges and vertices no higher above a face of another body are level with it."""


class Feet(NamedTuple):
    """n feet of points on facets: point, facet numbers; weights (n, d) of the facet's corners; feature (n,); distance (n,) [m]."""

    point: IntArray
    facet: IntArray
    weights: FloatArray
    feature: IntArray
    distance: FloatArray

    def take(self, chosen: BoolArray | IntArray) -> Feet:
        return Feet._make(array[chosen] for array in self)


def feet_of(skin: MeshSkin, x: FloatArray, points: FloatArray, point: IntArray, facet: IntArray) -> Feet:
    """The nearest points of facets to points, one a pair of the two."""
    corners, p = x[skin.facets[facet]], points[point]
    d, n = corners.shape[1], len(point)
    rows = np.arange(n)
    sides = 1 if d == 2 else 3
    tangent = np.roll(corners, -1, axis=1)[:, :sides] - corners[:, :sides]
    arm = p[:, None] - corners[:, :sides]
    share = np.clip(np.einsum("nkd,nkd->nk", arm, tangent) / np.einsum("nkd,nkd->nk", tangent, tangent), 0.0, 1.0)
    off = arm - share[..., None] * tangent
    best = np.argmin(np.einsum("nkd,nkd->nk", off, off), axis=1)
    t = share[rows, best]
    weights = np.zeros((n, d))
    weights[rows, best], weights[rows, (best + 1) % d] = 1 - t, t
    corner = np.where(t > 0.5, (best + 1) % d, best)
    at_vertex = (t == 0) | (t == 1)
    nf, ne = len(skin.facets), len(skin.edges)
    on_side = nf + skin.edge[facet, best] if d == 3 else facet  # the only side of a segment is itself
    feature = np.where(at_vertex, nf + ne + skin.vertex[facet, corner], on_side)
    if d == 3:
        b, c, a = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0], p - corners[:, 0]
        bb, cc, bc, ab, ac = (np.einsum("nd,nd->n", *pair) for pair in ((b, b), (c, c), (b, c), (a, b), (a, c)))
        det = np.maximum(bb * cc - bc**2, 1e-300)
        s, t = (cc * ab - bc * ac) / det, (bb * ac - bc * ab) / det
        inner = (s > 0) & (t > 0) & (s + t < 1)
        weights[inner] = np.stack([1 - s - t, s, t], axis=1)[inner]
        feature = np.where(inner, facet, feature)
    foot = np.einsum("nk,nkd->nd", weights, corners)
    return Feet(point, facet, weights, feature, np.linalg.norm(p - foot, axis=1))


def minima(skin: MeshSkin, feet: Feet, tolerance: FloatArray) -> Feet:
    """The feet at which the distance from their point has a minimum over the skin, each feature once a point.

    A foot on a face is one; on an edge or a vertex no facet around it may be nearer by more than tolerance (of the points, [m]), nor have a
    foot of its own as near: that is the same place, beside which springs would act twice.
    """
    nf, ne = len(skin.facets), len(skin.edges)
    around = np.concatenate([nf + skin.edge, nf + ne + skin.vertex], axis=1)[feet.facet]
    key = (feet.point[:, None] * skin.n_features + around).ravel()
    own = feet.point * skin.n_features + feet.feature
    different, place = np.unique(key, return_inverse=True)
    on_face = feet.feature < nf
    least, of_faces = np.full((2, len(different)), np.inf)
    np.minimum.at(least, place.ravel(), np.repeat(feet.distance, around.shape[1]))
    np.minimum.at(of_faces, place.ravel(), np.repeat(np.where(on_face, feet.distance, np.inf), around.shape[1]))
    where = np.minimum(np.searchsorted(different, own), max(len(different) - 1, 0))
    keep = on_face.copy()
    rest = np.flatnonzero(~on_face)
    far, as_near = feet.distance[rest], tolerance[feet.point[rest]]
    keep[rest] = (far <= least[where[rest]] + as_near) & (of_faces[where[rest]] > far + as_near)
    chosen = np.flatnonzero(keep)
    return feet.take(chosen[np.unique(own[chosen], return_index=True)[1]])


def balls_on_meshes(now: Placed, skin: MeshSkin, x: FloatArray, alert: float) -> Touch:
    """Balls, and the half balls at the ends of capsules, on the skins of meshed bodies at node positions x (n_nodes, d) [m]."""
    balls, capsules = now.solids.of("sphere"), now.solids.of("capsule")
    solid = np.concatenate([balls, capsules, capsules])
    if not len(solid):
        return no_touch(now, now.solids.node.shape[1], x.shape[1])
    points = np.concatenate([now.core(balls, 0.0), now.core(capsules, -1.0), now.core(capsules, 1.0)])
    radius = now.solids.radius[solid]
    corners, normal = x[skin.facets], normals(skin, x)
    centre = corners.mean(axis=1)
    size = np.linalg.norm(corners - centre[:, None], axis=2).max(axis=1)
    feet = feet_of(skin, x, points, *near_pairs(points, centre, size + radius.max(initial=0.0) + alert))
    feet = feet.take(feet.distance <= radius[feet.point] + alert)
    nearest = np.full((len(points), skin.body.max(initial=-1) + 1), np.inf)
    np.minimum.at(nearest, (feet.point, skin.body[feet.facet]), feet.distance)
    feet = minima(skin, feet, _TIE * radius)
    foot = np.einsum("nk,nkd->nd", feet.weights, corners[feet.facet])
    away = points[feet.point] - foot
    height = np.einsum("nd,nd->n", away, normal[feet.facet])
    on_face = feet.feature < len(skin.facets)
    is_nearest = feet.distance <= nearest[feet.point, skin.body[feet.facet]] + _TIE * radius[feet.point]
    inside = (height < 0) & on_face
    shallow = feet.distance > _DEEP * radius[feet.point]
    keep = np.where(inside, is_nearest, shallow | is_nearest) & (on_face | (height > -_TIE * radius[feet.point]))
    touching = feet.distance > _TIE * radius[feet.point]
    direction = np.where((on_face | ~touching)[:, None], normal[feet.facet], away / np.maximum(feet.distance, 1e-300)[:, None])
    borne = np.flatnonzero(keep & on_face & (height > 0))
    keep[_level(feet, foot, normal, skin.body, borne, np.flatnonzero(keep & ~on_face), LEVEL * radius)] = False
    return _touch(now, skin, solid, points, feet, foot, direction).take(keep)


def _level(
    feet: Feet, foot: FloatArray, normal: FloatArray, body: IntArray, borne: IntArray, rest: IntArray, tolerance: FloatArray
) -> IntArray:
    """Which of the feet `rest`, on edges and vertices, are level with a face of another body that bears the same ball, or below it.

    Its contact on that face keeps a ball above the face's plane, where no such feature is in its way. Their own contacts, whose normals
    lean against a ball that comes along the face, would hold it up at every joint of a ground that is made of several bodies: linear in
    the way of a step, they are closed sooner than the round ball touches.
    """
    row, place = of_same_key(feet.point[borne], feet.point[rest])
    face = borne[place]
    above = np.einsum("nd,nd->n", foot[rest][row] - foot[face], normal[feet.facet[face]])
    other = body[feet.facet[face]] != body[feet.facet[rest]][row]
    return np.unique(rest[row[other & (above <= tolerance[feet.point[face]])]])


def _touch(now: Placed, skin: MeshSkin, solid: IntArray, points: FloatArray, feet: Feet, foot: FloatArray, direction: FloatArray) -> Touch:
    slave = solid[feet.point]
    point = points[feet.point] - now.solids.radius[slave][:, None] * direction
    return Touch(
        direction,
        point,
        foot,
        now.solids.node[slave],
        now.weights(slave, point),
        skin.facets[feet.facet],
        feet.weights,
        np.stack([now.solids.body[slave], skin.body[feet.facet]], axis=1),
        feet.point * skin.n_features + feet.feature,
    )


def sides_on_meshes(now: Placed, skin: MeshSkin, x: FloatArray, alert: float) -> Touch:
    """The sides of capsules and cylinders on vertices and, in 3D, across edges of meshed bodies: where inner points of the core are above
    convex features."""
    capsules = now.solids.of("capsule", "cylinder")
    if not len(capsules):
        return no_touch(now, now.solids.node.shape[1], x.shape[1])
    normal = normals(skin, x)
    vertex = _sides_on_vertices(now, skin, x, normal, capsules, alert)
    if x.shape[1] == 2:
        return vertex
    p, q = x[skin.edges[:, 0]], x[skin.edges[:, 1]]
    centre, radius = (p + q) / 2, np.linalg.norm(q - p, axis=1) / 2
    reach = now.solids.radius[capsules] + now.solids.half[capsules]
    i, e = near_pairs(now.centre[capsules], centre, radius + reach.max(initial=0.0) + alert)
    k = capsules[i]
    u, w, apart = now.along[k], (q - p)[e] / (2 * radius[e])[:, None], now.centre[k] - centre[e]
    cosine, a, b = (np.einsum("nd,nd->n", *pair) for pair in ((u, w), (apart, u), (apart, w)))
    square = np.maximum(1 - cosine**2, 1e-12)
    s, t = (cosine * b - a) / square, (b - cosine * a) / square
    away = apart + s[:, None] * u - t[:, None] * w
    distance = np.linalg.norm(away, axis=1)
    real = np.einsum("nd,nd->n", *(normal[skin.edge_facets[e, side]] for side in range(2))) < _FLAT
    keep = real & (square > 1e-4) & (np.abs(s) < now.solids.half[k]) & (np.abs(t) < radius[e])
    keep &= (distance <= now.solids.radius[k] + alert) & (distance > 0)
    keep &= leaves_by_its_side(now, k, s, distance - now.solids.radius[k])
    direction = away / np.maximum(distance, 1e-300)[:, None]
    for side in range(2):  # above both faces' borders: in the fan of normals of a convex edge
        third = x[skin.facets[skin.edge_facets[e, side]]].sum(axis=1) - p[e] - q[e] - p[e]
        inwards = third - np.einsum("nd,nd->n", third, w)[:, None] * w
        keep &= np.einsum("nd,nd->n", direction, inwards) <= _FAN * np.linalg.norm(inwards, axis=1)
    keep &= np.einsum("nd,nd->n", direction, normal[skin.edge_facets[e, 0]] + normal[skin.edge_facets[e, 1]]) > 0
    i, e, k, s, t, direction = i[keep], e[keep], k[keep], s[keep], t[keep], direction[keep]
    point = now.centre[k] + s[:, None] * now.along[k] - now.solids.radius[k][:, None] * direction
    share = t / radius[e]
    edges = Touch(
        direction,
        point,
        centre[e] + t[:, None] * w[keep],
        now.solids.node[k],
        now.weights(k, point),
        np.column_stack([skin.edges[e], np.full(len(e), -1)]),
        np.column_stack([(1 - share) / 2, (1 + share) / 2, np.zeros(len(e))]),
        np.stack([now.solids.body[k], skin.body[skin.edge_facets[e, 0]]], axis=1),
        i * skin.n_features + len(skin.facets) + e,
    )
    return Touch._make(np.concatenate(both) for both in zip(vertex, edges, strict=True))


def _sides_on_vertices(now: Placed, skin: MeshSkin, x: FloatArray, normal: FloatArray, capsules: IntArray, alert: float) -> Touch:
    d = x.shape[1]
    reach = now.solids.radius[capsules] + now.solids.half[capsules] + alert
    at = x[skin.vertices]
    i, v = near_pairs(now.centre[capsules], at, np.full(len(at), reach.max(initial=0.0)))
    k = capsules[i]
    s = np.einsum("nd,nd->n", at[v] - now.centre[k], now.along[k])
    away = now.centre[k] + s[:, None] * now.along[k] - at[v]
    distance = np.linalg.norm(away, axis=1)
    keep = (np.abs(s) < now.solids.half[k]) & (distance <= now.solids.radius[k] + alert) & (distance > 0)
    keep &= leaves_by_its_side(now, k, s, distance - now.solids.radius[k])
    i, v, k, s, away, distance = i[keep], v[keep], k[keep], s[keep], away[keep], distance[keep]
    direction = away / np.maximum(distance, 1e-300)[:, None]
    # the vertex is the nearest point of every facet around it: no side that begins there leads nearer
    facet, corner = np.divmod(np.argsort(skin.vertex, axis=None, kind="stable"), d)
    first = np.searchsorted(skin.vertex[facet, corner], np.arange(len(at) + 1))
    row, place = each_of(first[v], first[v + 1] - first[v])
    corners = x[skin.facets[facet[place]]] - at[v][row][:, None]
    nearer = (np.einsum("nkd,nd->nk", corners, direction[row]) > _FAN * np.linalg.norm(corners, axis=2)).any(axis=1)
    clear = np.bincount(row[nearer], minlength=len(v)) == 0
    # within a flat face it is none: ends of the core, or the face's border, bear what lies there
    bent = np.einsum("nd,nd->n", normal[facet[place]], normal[facet[first[v]]][row]) < _FLAT
    clear &= np.bincount(row[bent], minlength=len(v)) > 0
    body = skin.body[facet[first[:-1]]]
    i, v, k, s, direction = i[clear], v[clear], k[clear], s[clear], direction[clear]
    point = now.centre[k] + s[:, None] * now.along[k] - now.solids.radius[k][:, None] * direction
    nodes = np.full((len(v), d), -1)
    weights = np.zeros((len(v), d))
    nodes[:, 0], weights[:, 0] = skin.vertices[v], 1.0
    bodies = np.stack([now.solids.body[k], body[v]], axis=1)
    identity = i * skin.n_features + len(skin.facets) + len(skin.edges) + v
    return Touch(direction, point, at[v], now.solids.node[k], now.weights(k, point), nodes, weights, bodies, identity)
