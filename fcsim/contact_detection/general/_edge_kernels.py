"""Where the sharp edges of two bodies cross, compiled: one pair of edges a row."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.contact_detection._vector_kernels import Vector, at, cross, dot, length, minus, plus, times, unit
from fcsim.contact_detection.general._foot_kernels import normal_on_side
from fcsim.contact_detection.general._pierce_kernels import pierced
from fcsim.contact_detection.skin._rim_kernels import RIGID, SQUARER, angle, is_rim_of

_FLAT = np.cos(np.deg2rad(1.0))  # faces that oppose each other closer than this touch flatly: the contact's normal is the face's
_TILTED = 1e-4  # from this angle between them on, edges that cross at `_SKEW` or more have their own normal, along which neither slides
_SKEW = 0.5  # sine of the angle between edges from which their common normal is within twice the tilt of the faces'
_PARALLEL = 1e-7  # sine of the angle below which edges of flatly touching faces do not cross; vertices hold these
_ALONG = 1e-4  # the same of edges in space, whose direction of contact is round-off
_TWISTED = 1e-12  # of 1: a quadrilateral whose normals differ by less is plane
_ARC = 0.05  # sine of how far the normal may leave the arc between an edge's faces


class EdgesOfAll(NamedTuple):
    """Edges and what lies around them: arrays of a `Shape` (point to mean) and of its `Skin`; goes_on (ne, 2) of `FaceEdges`; the first
    `bending` vertices are of deformable bodies."""

    point: FloatArray
    normals: FloatArray
    sizes: FloatArray
    mean: FloatArray
    edges: IntArray
    edge_facets: IntArray
    facets: IntArray
    sides: IntArray
    sharp: BoolArray
    goes_on: BoolArray
    bending: int


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
def _pierces(a: int, b: int, near: float, e: EdgesOfAll) -> int:
    """How many of the two faces of the edge b the edge a goes through."""
    count = 0
    p, q = at(e.point, e.edges[a, 0]), at(e.point, e.edges[a, 1])
    for k in range(2):
        if pierced(p, q, e.edge_facets[b, k], near, e.point, e.normals, e.facets, e.sides):
            count += 1
    return count


@njit(cache=True)
def _on_rim(a: int, end: int, b: int, out: Vector, e: EdgesOfAll) -> bool:
    """Whether the face at an end of the edge a, at which it ends, lies on the sharp edge b there, rather than what is around that end on a
    side of b: `bears_by_its_rim` the other way round. `out` is the face's normal inwards, from b to a."""
    u, w = e.edges[a, end], e.edges[a, 1 - end]
    p, q = at(e.point, e.edges[b, 0]), at(e.point, e.edges[b, 1])
    along = unit(minus(q, p))
    inward = minus(at(e.point, w), at(e.point, u))
    first = dot(_in_face(b, 0, along, e.normals, e.edge_facets), inward) > dot(_in_face(b, 1, along, e.normals, e.edge_facets), inward)
    side, beyond = at(e.normals, e.edge_facets[b, 0 if first else 1]), at(e.normals, e.edge_facets[b, 1 if first else 0])
    if not is_rim_of(out, side, beyond):
        return False
    mean = times(-1.0, at(e.mean, u))
    mean = unit(minus(mean, times(dot(mean, along), along)))
    bends, bent = u < e.bending, e.edges[b, 0] < e.bending
    margin = SQUARER if bends == bent else (RIGID if bends else -RIGID)
    return angle(out, unit(plus(side, beyond))) <= angle(mean, side) + margin


@njit(cache=True)
def _within(s: float, length: float, goes_on: BoolArray, near: float) -> bool:
    """Whether the place s [m] lies inside an edge by more than `near`, or no farther beyond an end at which that goes on."""
    return (-near if goes_on[0] else near) < s < (length + near if goes_on[1] else length - near)


@njit(cache=True)
def _place(s: float, length: float, near: float) -> float:
    """The place s [m] on an edge as a share of its length; the end itself where that is nearer than `near`."""
    if s < near:
        return 0.0
    if s > length - near:
        return 1.0
    return s / length


@njit(cache=True)
def crossings(
    first: IntArray, second: IntArray, alert: FloatArray, depth: FloatArray, near: FloatArray, e: EdgesOfAll
) -> tuple[IntArray, FloatArray, FloatArray, FloatArray, IntArray]:
    """Rows of edges that touch, their normals from the second to the first (nc, 3), gaps (nc,) [m], places s, t (nc, 2) on both, and of
    those that overlap through how many of the two faces of one edge the other goes (nc,).

    Long because it is one decision. alert, depth, near (rows,) [m]. A crossing lies inside both edges by more than `near`: vertices hold
    the ends, but those at which a face or a rim goes on, or at which a face lies on what is sharp (`_on_rim`). Edges that are not sharp
    lie within faces.
    """
    point, normals, edges, edge_facets, facets, sides, goes_on, sharp = (
        e.point, e.normals, e.edges, e.edge_facets, e.facets, e.sides, e.goes_on, e.sharp,
    )  # fmt: skip
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
        face, of_first, N = _flat_normal(a, b, normals, e.sizes, edge_facets)
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
        on_a, on_b = _within(s, la, goes_on[a], tol), _within(t, lb, goes_on[b], tol)
        if not on_a and on_b and -tol < s < la + tol:
            on_a = _on_rim(a, 0 if s < tol else 1, b, N, e)
        elif on_a and not on_b and -tol < t < lb + tol:
            on_b = _on_rim(b, 0 if t < tol else 1, a, times(-1.0, N), e)
        if not (on_a and on_b):
            continue
        g = dot(minus(minus(times(s, da), times(t, db)), r), N)
        if -depth[row] <= g <= alert[row]:
            if g < -tol:
                theirs = _pierces(a, b, tol, e)
                ours = _pierces(b, a, tol, e)
                through[count] = max(theirs, ours)
            else:
                through[count] = 2
            rows[count], gap[count] = row, g
            normal[count, 0], normal[count, 1], normal[count, 2] = N
            place[count, 0], place[count, 1] = _place(s, la, tol), _place(t, lb, tol)
            count += 1
    return rows[:count].copy(), normal[:count].copy(), gap[:count].copy(), place[:count].copy(), through[:count].copy()
