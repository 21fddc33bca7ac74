"""Cylinders with meshed bodies, beside what their sides share with capsules: rims on faces and edges, and ends on vertices and edges."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.contact_detection.exact.facets import feet_of
from fcsim.contact_detection.exact.mesh_skin import MeshSkin, normals
from fcsim.contact_detection.exact.rims_on_edges import crossings_of_rims
from fcsim.contact_detection.exact.solids import Placed, Touch, joined, no_touch, rim_points
from fcsim.contact_detection.surfaces.broad_phase import near_pairs
from fcsim.mesh.curves.ragged import each_of

_DEEP = 0.5  # of the radius: what lies deeper is another part
_ROUND = 1e-9  # of a facet or a radius: points on a border are on either side of it
_FACING = 0.1  # cosine: facets and sides of a vertex that look less against an end lie along it
_HAIR = 1e-2  # of the radius: what is no deeper leaves by the face or end that it was found at, also where it lies on a border of it
_OTHER = 0.5  # of the depth below a face: what is nearer to another one leaves by that
_LEVEL = 0.02  # sine between an end and an edge that lies in it
_FLAT = 1 - 1e-9  # cosine between facets of one face: the edge between them is none


def cylinders_on_meshes(now: Placed, skin: MeshSkin, x: FloatArray, alert: float) -> Touch:
    """Contacts of the rims and ends of cylinders with meshed bodies at node positions x (n_nodes, 3) [m]."""
    cylinders = now.solids.of("cylinder")
    if not len(cylinders):
        return no_touch(now, now.solids.node.shape[1], x.shape[1])
    normal = normals(skin, x)
    kinds = (_rims_on_faces, _ends_on_vertices, _ends_on_edges, _rims_on_edges)
    return joined([found(now, skin, x, normal, cylinders, alert) for found in kinds])


def _reach(now: Placed, cylinders: IntArray) -> float:
    return float(np.hypot(now.solids.radius[cylinders], now.solids.half[cylinders]).max(initial=0.0))


def _rims_on_faces(now: Placed, skin: MeshSkin, x: FloatArray, normal: FloatArray, cylinders: IntArray, alert: float) -> Touch:
    """Three points of each rim, the lowest first, over or a little below a face that the cylinder's centre is in front of."""
    corners = x[skin.facets]
    middle = corners.mean(axis=1)
    size = np.linalg.norm(corners - middle[:, None], axis=2).max(axis=1)
    i, f = near_pairs(now.centre[cylinders], middle, size + _reach(now, cylinders) + alert)
    k, n, at = cylinders[i], normal[f], corners[f]
    b, c = at[:, 1] - at[:, 0], at[:, 2] - at[:, 0]
    bb, cc, bc = (np.einsum("nd,nd->n", *pair) for pair in ((b, b), (c, c), (b, c)))
    det = np.maximum(bb * cc - bc**2, 1e-300)
    in_front = np.einsum("nd,nd->n", now.centre[k] - at[:, 0], n) > 0
    found = []
    for end in (-1.0, 1.0):
        points = rim_points(now, k, end, n)
        for third in range(3):
            arm = points[:, third] - at[:, 0]
            height, ab, ac = (np.einsum("nd,nd->n", arm, y) for y in (n, b, c))
            s, t = (cc * ab - bc * ac) / det, (bb * ac - bc * ab) / det
            keep = in_front & (s >= -_ROUND) & (t >= -_ROUND) & (s + t <= 1 + _ROUND)
            keep &= (height <= alert) & (height > -_DEEP * now.solids.radius[k])
            deep = np.flatnonzero(keep & (height < -_HAIR * now.solids.radius[k]))
            keep[deep] = ~_nearer_to_another(skin, x, points[deep, third], skin.body[f[deep]], -height[deep], middle, size)
            code = (3 * (end > 0) + third) + 6 * i[keep]
            weights = np.stack([1 - s - t, s, t], axis=1)[keep]
            foot = points[keep, third] - height[keep, None] * n[keep]
            once = _once(code, skin.body[f[keep]], n[keep])
            touch = _touch(now, skin, k[keep], n[keep], points[keep, third], foot, _on_facets(skin, f[keep], weights), code)
            found.append(touch.take(once))
    return joined(found)


def _nearer_to_another(
    skin: MeshSkin, x: FloatArray, points: FloatArray, body: IntArray, depth: FloatArray, middle: FloatArray, size: FloatArray
) -> BoolArray:
    """Which points (n, 3), `depth` (n,) [m] below a face of the bodies (n,), leave them by another one of less than half that depth: a rim
    beside the face of a body that lies on the side. middle, size: of the facets."""
    if not len(points):
        return np.zeros(0, dtype=bool)
    point, facet = near_pairs(points, middle, size + _OTHER * float(depth.max()))
    same = skin.body[facet] == body[point]
    feet = feet_of(skin, x, points, point[same], facet[same])
    least = np.full(len(points), np.inf)
    np.minimum.at(least, feet.point, feet.distance)
    return least < _OTHER * depth


def _once(code: IntArray, body: IntArray, normal: FloatArray) -> IntArray:
    """One of the rows of a point that lies on the border of two facets of one face."""
    key = np.column_stack([code, body, np.round(1e6 * normal).astype(np.int64)])
    return np.unique(key, axis=0, return_index=True)[1]


def _ends_on_vertices(now: Placed, skin: MeshSkin, x: FloatArray, normal: FloatArray, cylinders: IntArray, alert: float) -> Touch:
    """Vertices within an end whose surroundings look at it and do not go on into the cylinder; on its rim those that nothing around looks
    at the axis of."""
    at = x[skin.vertices]
    i, v = near_pairs(now.centre[cylinders], at, np.full(len(at), _reach(now, cylinders) + alert))
    k = cylinders[i]
    arm = at[v] - now.centre[k]
    s = np.einsum("nd,nd->n", arm, now.along[k])
    end = np.where(s < 0, -1.0, 1.0)
    out = end[:, None] * now.along[k]
    gap = np.abs(s) - now.solids.half[k]
    across = arm - s[:, None] * now.along[k]
    aside, radius = np.linalg.norm(across, axis=1), now.solids.radius[k]
    keep = (aside < radius * (1 + _ROUND)) & (gap <= alert) & _out_by_the_end(now, k, gap, aside)
    i, v, k, out, gap, across = i[keep], v[keep], k[keep], out[keep], gap[keep], across[keep]
    looks, clear = _surroundings(skin, x, normal, v, out)
    on_rim = np.flatnonzero(aside[keep] >= radius[keep] * (1 - _ROUND))  # corners of what is inscribed, or of what lies on the side
    clear[on_rim] &= ~_surroundings(skin, x, normal, v[on_rim], across[on_rim] / radius[keep][on_rim, None])[0]
    good = looks & clear
    i, v, k, out, gap = i[good], v[good], k[good], out[good], gap[good]
    return _touch(now, skin, k, -out, at[v] - gap[:, None] * out, at[v], _on_vertices(skin, v), 6 * i)


def _out_by_the_end(now: Placed, k: IntArray, gap: FloatArray, aside: FloatArray) -> BoolArray:
    """Which vertices and edges, `aside` (n,) [m] from the axes of the cylinders k, leave them by an end, -gap below it, not by the side:
    what lies on a lying cylinder is a hair within it, and far from its ends."""
    radius = now.solids.radius[k]
    shallow = gap > -_DEEP * np.minimum(radius, now.solids.half[k])
    return shallow & (-gap <= np.maximum(radius - aside, _HAIR * radius))


def _surroundings(skin: MeshSkin, x: FloatArray, normal: FloatArray, v: IntArray, out: FloatArray) -> tuple[BoolArray, BoolArray]:
    """Whether a facet around the vertices v (n,) faces against out (n, 3), and whether no side that begins there goes on against it."""
    facet, corner = np.divmod(np.argsort(skin.vertex, axis=None, kind="stable"), 3)
    first = np.searchsorted(skin.vertex[facet, corner], np.arange(len(skin.vertices) + 1))
    row, place = each_of(first[v], first[v + 1] - first[v])
    against = np.einsum("nd,nd->n", normal[facet[place]], out[row]) < -_FACING
    arms = x[skin.facets[facet[place]]] - x[skin.vertices[v]][row][:, None]
    length = np.linalg.norm(arms, axis=2)
    into = (np.einsum("nkd,nd->nk", arms, -out[row]) > _FACING * length).any(axis=1)
    return np.bincount(row[against], minlength=len(v)) > 0, np.bincount(row[into], minlength=len(v)) == 0


def _ends_on_edges(now: Placed, skin: MeshSkin, x: FloatArray, normal: FloatArray, cylinders: IntArray, alert: float) -> Touch:
    """Where the rims cross the edges of faces that lie flat on the ends: the corners of what end and face share."""
    one, other = normal[skin.edge_facets[:, 0]], normal[skin.edge_facets[:, 1]]
    edges = np.flatnonzero(np.einsum("nd,nd->n", one, other) < _FLAT)
    p, q = x[skin.edges[edges, 0]], x[skin.edges[edges, 1]]
    middle, half = (p + q) / 2, np.linalg.norm(q - p, axis=1) / 2
    i, e = near_pairs(now.centre[cylinders], middle, half + _reach(now, cylinders) + alert)
    k, axis = cylinders[i], now.along[cylinders[i]]
    arm, along = p[e] - now.centre[k], (q - p)[e]
    level = np.abs(np.einsum("nd,nd->n", along, axis)) < _LEVEL * 2 * half[e]
    u, w = (y - np.einsum("nd,nd->n", y, axis)[:, None] * axis for y in (arm, along))
    a, b, c = (np.einsum("nd,nd->n", *pair) for pair in ((w, w), (u, w), (u, u)))
    root = b**2 - a * (c - now.solids.radius[k] ** 2)
    aside = np.sqrt(np.maximum(c - b**2 / np.maximum(a, 1e-300), 0.0))
    found = []
    for turn, sign in enumerate((-1.0, 1.0)):
        t = (-b + sign * np.sqrt(np.maximum(root, 0))) / np.maximum(a, 1e-300)
        place = arm + t[:, None] * along
        s = np.einsum("nd,nd->n", place, axis)
        out = np.where(s < 0, -1.0, 1.0)[:, None] * axis
        gap = np.abs(s) - now.solids.half[k]
        either = np.einsum("nsd,nd->sn", normal[skin.edge_facets[edges[e]]], out)
        facing = either.min(axis=0) < -1 + _LEVEL
        keep = level & facing & (root > 0) & (t > 0) & (t < 1) & (gap <= alert) & _out_by_the_end(now, k, gap, aside)
        n, at, share, edge = -out[keep], (now.centre[k] + place)[keep], t[keep], edges[e[keep]]
        on = _on_edges(skin, edge, share)
        found.append(_touch(now, skin, k[keep], n, at + gap[keep, None] * n, at, on, 6 * i[keep] + 1 + turn))
    return joined(found)


def _rims_on_edges(now: Placed, skin: MeshSkin, x: FloatArray, normal: FloatArray, cylinders: IntArray, alert: float) -> Touch:
    """Where the rims cross edges in space."""
    i, edge, N, point, foot, share, code = crossings_of_rims(now, skin, x, normal, cylinders, alert)
    return _touch(now, skin, cylinders[i], N, point, foot, _on_edges(skin, edge, share), 6 * i + code)


class _Places(NamedTuple):
    """Places of a skin: its nodes (n, 3), -1 = none, and their weights; a facet there (n,); the number of facet, edge or vertex (n,) that
    it is, in this order."""

    nodes: IntArray
    weights: FloatArray
    facet: IntArray
    feature: IntArray


def _on_facets(skin: MeshSkin, facet: IntArray, weights: FloatArray) -> _Places:
    return _Places(skin.facets[facet], weights, facet, facet)


def _on_edges(skin: MeshSkin, edge: IntArray, share: FloatArray) -> _Places:
    """share (n,): of the way from an edge's first node to its second."""
    nodes = np.column_stack([skin.edges[edge], np.full(len(edge), -1)])
    weights = np.column_stack([1 - share, share, np.zeros(len(edge))])
    return _Places(nodes, weights, skin.edge_facets[edge, 0], len(skin.facets) + edge)


def _on_vertices(skin: MeshSkin, v: IntArray) -> _Places:
    nodes = np.column_stack([skin.vertices[v], np.full((len(v), 2), -1)])
    weights = np.column_stack([np.ones(len(v)), np.zeros((len(v), 2))])
    facet = np.full(len(skin.vertices), 0)
    facet[skin.vertex] = np.arange(len(skin.facets))[:, None]
    return _Places(nodes, weights, facet[v], len(skin.facets) + len(skin.edges) + v)


def _touch(
    now: Placed, skin: MeshSkin, solid: IntArray, normal: FloatArray, point: FloatArray, foot: FloatArray, on: _Places, code: IntArray
) -> Touch:
    """Contacts of cylinders, slaves, with places of the skin, masters; code and the places' features identify them."""
    bodies = np.stack([now.solids.body[solid], skin.body[on.facet]], axis=1)
    weights = now.weights(solid, point)
    return Touch(normal, point, foot, now.solids.node[solid], weights, on.nodes, on.weights, bodies, code * skin.n_features + on.feature)
