"""Where the sharp edges of two bodies cross, compiled: one pair of edges a row."""

from __future__ import annotations

import numpy as np
from numba import njit

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.contact_detection._vector_kernels import Vector, at, cross, dot, length, minus, plus, times, unit
from fcsim.contact_detection.general._foot_kernels import normal_on_side
from fcsim.contact_detection.general._pierce_kernels import pierced

_FLAT = np.cos(np.deg2rad(1.0))  # faces that oppose each other closer than this touch flatly: the contact's normal is the face's
_TILTED = 1e-4  # from this angle between them on, edges that cross at `_SKEW` or more have their own normal, along which neither slides
_SKEW = 0.5  # sine of the angle between edges from which their common normal is within twice the tilt of the faces'
_PARALLEL = 1e-7  # sine of the angle below which edges of flatly touching faces do not cross; vertices hold these
_ALONG = 1e-4  # the same of edges in space, whose direction of contact is round-off
_TWISTED = 1e-12  # of 1: a quadrilateral whose normals differ by less is plane
_ARC = 0.05  # sine of how far the normal may leave the arc between an edge's faces


@njit(cache=True)
def _in_face(edge: int, place: int, direction: Vector, normals: FloatArray, edge_facets: IntArray) -> Vector:
    """Unit vector in the edge's first or second facet, across the edge and away from it."""
    n = at(normals, edge_facets[edge, place])
    return unit(cross(n, direction) if place == 0 else cross(direction, n))


@njit(cache=True)
def _flat_normal(a: int, b: int, normals: FloatArray, sizes: FloatArray, edge_facets: IntArray) -> tuple[int, bool, Vector]:
    """The larger of two faces of the edges that touch flatly, -1 where none do, whether it is one of a, and its normal from b to a."""
    best, fa, fb = -_FLAT, -1, -1
    for i in range(2):
        for j in range(2):
            c = dot(at(normals, edge_facets[a, i]), at(normals, edge_facets[b, j]))
            if c < best:
                best, fa, fb = c, edge_facets[a, i], edge_facets[b, j]
    if fa < 0:
        return -1, False, at(normals, 0)
    if sizes[fa] > sizes[fb]:
        return fa, True, times(-1.0, at(normals, fa))
    return fb, False, at(normals, fb)


@njit(cache=True)
def _on_edge(f: int, edge: int, share: float, point: FloatArray, facets: IntArray, edges: IntArray) -> Vector:
    """The normal of the bilinear facet f at the share of its edge."""
    x0, x1, x2, x3 = at(point, facets[f, 0]), at(point, facets[f, 1]), at(point, facets[f, 2]), at(point, facets[f, 3])
    l = 0
    while facets[f, l] != edges[edge, 0]:
        l += 1
    if facets[f, l + 1 if l < 3 else 0] == edges[edge, 1]:
        return normal_on_side(l, share, x0, x1, x2, x3)
    return normal_on_side(l - 1 if l > 0 else 3, 1.0 - share, x0, x1, x2, x3)


@njit(cache=True)
def _pierces(
    a: int,
    b: int,
    near: float,
    point: FloatArray,
    normals: FloatArray,
    facets: IntArray,
    sides: IntArray,
    edges: IntArray,
    edge_facets: IntArray,
) -> int:
    """How many of the two faces of the edge b the edge a goes through."""
    count = 0
    for k in range(2):
        if pierced(at(point, edges[a, 0]), at(point, edges[a, 1]), edge_facets[b, k], near, point, normals, facets, sides):
            count += 1
    return count


@njit(cache=True)
def _place(s: float, length: float, goes_on: BoolArray, near: float) -> float:
    """The place s [m] on an edge as a share of its length; the end itself where that goes on and is nearer than `near`."""
    if goes_on[0] and s < near:
        return 0.0
    if goes_on[1] and s > length - near:
        return 1.0
    return s / length


@njit(cache=True)
def crossings(
    first: IntArray,
    second: IntArray,
    alert: FloatArray,
    depth: FloatArray,
    near: FloatArray,
    point: FloatArray,
    normals: FloatArray,
    sizes: FloatArray,
    edges: IntArray,
    edge_facets: IntArray,
    facets: IntArray,
    sides: IntArray,
    goes_on: BoolArray,
    sharp: BoolArray,
) -> tuple[IntArray, FloatArray, FloatArray, FloatArray, IntArray]:
    """Rows of edges that touch, their normals from the second to the first (nc, 3), gaps (nc,) [m], places s, t (nc, 2) on both, and of
    those that overlap through how many of the two faces of one edge the other goes (nc,).

    Long because it is one decision. alert, depth, near (rows,) [m]. A crossing lies inside both edges by more than `near`: vertices hold
    the ends, but those at which a face or a rim goes on (ne, 2). Edges that are not sharp (ne,) lie within faces.
    """
    n = len(first)
    rows, normal = np.empty(n, dtype=np.int64), np.empty((n, 3))
    gap, place, through = np.empty(n), np.empty((n, 2)), np.full(n, 2, dtype=np.int64)
    count = 0
    for row in range(n):
        a, b = first[row], second[row]
        pa, pb = at(point, edges[a, 0]), at(point, edges[b, 0])
        da, db = minus(at(point, edges[a, 1]), pa), minus(at(point, edges[b, 1]), pb)
        la, lb = length(da), length(db)
        da, db = unit(da), unit(db)
        across = cross(da, db)
        sine = length(across)
        if sine < _PARALLEL:
            continue
        r = minus(pb, pa)
        face, of_first, N = _flat_normal(a, b, normals, sizes, edge_facets)
        if face >= 0:
            turn = dot(N, across)
            if abs(turn) < _PARALLEL:
                continue
            own = times((1.0 if turn > 0.0 else -1.0) / sine, across)
            if sine > _SKEW and length(minus(own, N)) > _TILTED:
                N, turn = own, dot(own, across)
            elif sides[face] == 4:  # twisted: not its mean normal, but that where the edges cross
                share = dot(N, cross(r, db)) / turn / la if of_first else dot(N, cross(r, da)) / turn / lb
                there = _on_edge(face, a if of_first else b, min(max(share, 0.0), 1.0), point, facets, edges)
                there = times(-1.0 if of_first else 1.0, there)
                if dot(there, N) < 1.0 - _TWISTED and abs(dot(there, across)) >= _PARALLEL:
                    N, turn = there, dot(there, across)
            s, t = dot(N, cross(r, db)) / turn, dot(N, cross(r, da)) / turn
        else:
            if sine < _ALONG:
                continue
            N = times(1.0 / sine, across)
            if dot(N, plus(at(normals, edge_facets[b, 0]), at(normals, edge_facets[b, 1]))) < 0.0:
                N = times(-1.0, N)
            if dot(N, plus(at(normals, edge_facets[a, 0]), at(normals, edge_facets[a, 1]))) >= 0.0:
                continue
            extreme = True
            for k in range(2):  # both bodies fall away from the common tangent plane, but faces that are bent over what is sharp
                extreme = extreme and (not sharp[b] or dot(N, _in_face(b, k, db, normals, edge_facets)) <= _ARC)
                extreme = extreme and (not sharp[a] or dot(N, _in_face(a, k, da, normals, edge_facets)) >= -_ARC)
            if not extreme:
                continue
            s, t = dot(cross(r, db), across) / sine**2, dot(cross(r, da), across) / sine**2
        tol = near[row]
        on_a = (-tol if goes_on[a, 0] else tol) < s < (la + tol if goes_on[a, 1] else la - tol)
        on_b = (-tol if goes_on[b, 0] else tol) < t < (lb + tol if goes_on[b, 1] else lb - tol)
        if not (on_a and on_b):
            continue
        g = dot(minus(minus(times(s, da), times(t, db)), r), N)
        if -depth[row] <= g <= alert[row]:
            if g < -tol:
                theirs = _pierces(a, b, tol, point, normals, facets, sides, edges, edge_facets)
                ours = _pierces(b, a, tol, point, normals, facets, sides, edges, edge_facets)
                through[count] = max(theirs, ours)
            else:
                through[count] = 2
            rows[count], gap[count] = row, g
            normal[count, 0], normal[count, 1], normal[count, 2] = N
            place[count, 0], place[count, 1] = _place(s, la, goes_on[a], tol), _place(t, lb, goes_on[b], tol)
            count += 1
    return rows[:count].copy(), normal[:count].copy(), gap[:count].copy(), place[:count].copy(), through[:count].copy()
