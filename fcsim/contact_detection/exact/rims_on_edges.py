"""Rims of cylinders that cross edges of meshed bodies in space: neither does the edge lie in the end, nor the rim on a face.

Where the distance of the circle p(alpha) from the edge's line is stationary, both have a common normal N along the cross product of their
tangents. It is a contact where N lies in the normal cones of both, as of two rims, see `rims`.
"""

from __future__ import annotations

import numpy as np

from fcsim.arrays import FloatArray, IntArray
from fcsim.contact_detection.exact.mesh_skin import MeshSkin
from fcsim.contact_detection.exact.rims import on_rim, within
from fcsim.contact_detection.exact.solids import Placed
from fcsim.contact_detection.surfaces.broad_phase import near_pairs

_PARALLEL = 0.02  # sine between the edge and the end, or the rim, below which other rules hold
_FLAT = 1 - 1e-6  # cosine between the faces of an edge that is none
_SAMPLES, _NEWTON = 48, 8
_ROUND = 1e-9
_DEEP = 0.5  # of the radius: what lies deeper is another part
_HAIR = 1e-3  # of the radius: what is no deeper on a sharp edge is held by it
_CODES = np.array([0, 3, 4, 5])  # of the six of a cylinder and an edge: two are of edges that lie in an end


def crossings_of_rims(
    now: Placed, skin: MeshSkin, x: FloatArray, normal: FloatArray, cylinders: IntArray, alert: float
) -> tuple[IntArray, IntArray, FloatArray, FloatArray, FloatArray, FloatArray, IntArray]:
    """Rows of crossings: the cylinder's place among `cylinders`, the edge, N (n, 3) from the edge to the rim, the points (n, 3) of rim and
    edge, the share (n,) of the way along the edge, and a code that tells the crossings of a cylinder with an edge apart."""
    one, other = (skin.edge_facets[:, side] for side in range(2))
    middle_of = x[skin.facets].mean(axis=1)
    convex = np.einsum("ed,ed->e", middle_of[other] - middle_of[one], normal[one]) < 0
    edges = np.flatnonzero(convex & (np.einsum("ed,ed->e", normal[one], normal[other]) < _FLAT))
    start, along = x[skin.edges[edges, 0]], x[skin.edges[edges, 1]] - x[skin.edges[edges, 0]]
    size, r = np.linalg.norm(along, axis=1), now.solids.radius
    reach = float(np.hypot(r[cylinders], now.solids.half[cylinders]).max(initial=0.0))
    i, e = near_pairs(now.centre[cylinders], start + 0.5 * along, 0.5 * size + reach + alert)
    i, e, end = np.repeat(i, 2), np.repeat(e, 2), np.tile([-1.0, 1.0], len(i))
    k = cylinders[i]
    direction = along[e] / size[e][:, None]
    i, e, k, end, direction = (
        values[np.abs(np.einsum("nd,nd->n", direction, now.along[k])) > _PARALLEL] for values in (i, e, k, end, direction)
    )
    row, angle = _least(now, k, end, start[e], direction)
    i, e, k, end, direction = i[row], e[row], k[row], end[row], direction[row]
    p, out, tangent = on_rim(now, k, end, angle)
    share = np.einsum("nd,nd->n", p - start[e], direction) / size[e]
    q = start[e] + share[:, None] * along[e]
    N = np.cross(tangent, direction)
    sine = np.linalg.norm(N, axis=1)
    N = N / np.maximum(sine, 1e-300)[:, None]
    faces = skin.edge_facets[edges[e]]
    N = np.where(np.einsum("nd,nd->n", N, normal[faces].sum(axis=1)) < 0, -1.0, 1.0)[:, None] * N
    gap = np.einsum("nd,nd->n", p - q, N)
    keep = (sine > _PARALLEL) & (share > 0) & (share < 1) & (gap <= alert) & (gap > -_DEEP * r[k])
    keep &= np.abs(np.linalg.norm(p - q, axis=1) - np.abs(gap)) <= 1e-6 * (r[k] + size[e])  # Newton's method has arrived
    for direction_ in (out, end[:, None] * now.along[k]):
        keep &= np.einsum("nd,nd->n", N, direction_) <= _ROUND
    inner = 0.5 * (p + q)
    overlaps = within(now, k, inner)
    for side in range(2):
        keep &= np.einsum("nd,nd->n", N, middle_of[faces[:, side]] - q) <= _ROUND * size[e]
        acute = (np.einsum("nd,nd->n", N, normal[faces[:, side]]) < 0) & (gap > -_HAIR * r[k])  # against N it leaves the body
        overlaps &= acute | (np.einsum("nd,nd->n", inner - q, normal[faces[:, side]]) <= 0)
    keep &= (gap >= -_ROUND * r[k]) | overlaps
    first = np.einsum("nd,nd->n", out, np.cross(now.along[k], direction)) > 0  # the two are mirrored about the plane of axis and edge
    code = _CODES[2 * (end > 0) + first]
    nearest = np.flatnonzero(keep)[np.argsort(np.abs(gap[keep]), kind="stable")]
    chosen = nearest[np.unique(np.column_stack([i, e, code])[nearest], axis=0, return_index=True)[1]]
    return i[chosen], edges[e[chosen]], N[chosen], p[chosen], q[chosen], share[chosen], code[chosen]


def _least(now: Placed, k: IntArray, end: FloatArray, start: FloatArray, direction: FloatArray) -> tuple[IntArray, FloatArray]:
    """Rows and angles at which the rims of k are least far from lines, nearby: the least samples, then Newton's method."""
    n, r = len(k), now.solids.radius
    if not n:
        return np.empty(0, dtype=np.int64), np.empty(0)
    angle = 2 * np.pi * np.arange(_SAMPLES) / _SAMPLES
    rows = np.repeat(np.arange(n), _SAMPLES)
    p = on_rim(now, k[rows], end[rows], np.tile(angle, n))[0]
    distance = np.linalg.norm(_off(p - start[rows], direction[rows]), axis=1).reshape(n, _SAMPLES)
    row, sample = np.nonzero((distance <= np.roll(distance, 1, axis=1)) & (distance < np.roll(distance, -1, axis=1)))
    best, radius = angle[sample], r[k[row]]
    for _ in range(_NEWTON):  # on half the squared distance's derivative
        p, out, tangent = on_rim(now, k[row], end[row], best)
        away, ahead = _off(p - start[row], direction[row]), _off(tangent, direction[row])
        slope = np.einsum("nd,nd->n", away, tangent)
        bend = radius * np.einsum("nd,nd->n", ahead, ahead) - np.einsum("nd,nd->n", away, out)
        best = best - np.clip(slope / np.where(np.abs(bend) > 1e-12 * radius, bend, np.inf), -0.2, 0.2)
    return row, best


def _off(arm: FloatArray, direction: FloatArray) -> FloatArray:
    """What of arms (n, 3) stands across directions (n, 3)."""
    across: FloatArray = arm - np.einsum("nd,nd->n", arm, direction)[:, None] * direction
    return across
