"""Rims of faces, compiled: what lies over a face at its rim, and which of two faces that end in the same place is touched."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.contact_detection._vector_kernels import Vector, at, cross, dot, minus, plus, times, unit

FACING = 0.1  # a facet around a vertex faces the direction N where n . N < -FACING
_RISES = 1.2  # tangent of the slope up to which a facet lies over another one, rather than beside it
_SAME_PLANE = 1.0 - 1e-10  # cosine
RIMS = 16
_STRAIGHT = 0.99  # cosine between rims that are one
_STEEP = 1.0 / np.sqrt(1.0 + _RISES**2)  # the same as a cosine
_LEVEL = np.cos(np.deg2rad(10.0))  # faces that oppose each other closer than this touch alike at either's rim
_ACUTE = -0.1  # cosine between the faces at a rim: less where it is sharper than a right angle, but for what strain may turn them
_AT_AN_ANGLE = 0.1  # sine: a face that is inclined along a rim by more touches it at one end
SQUARER, RIGID = np.deg2rad(15.0), np.deg2rad(5.0)  # one end is blunter than the other; what of equal ones bends lies on what does not


class Surroundings(NamedTuple):
    """What lies around vertices and facets: arrays of a `Shape` (point to mean) and of its `Skin`; face (nf,) as in `vertex_contacts`."""

    point: FloatArray
    normals: FloatArray
    centres: FloatArray
    mean: FloatArray
    facets: IntArray
    sides: IntArray
    facet_edges: IntArray
    edge_facets: IntArray
    rim: BoolArray
    smooth: BoolArray
    smooth_vertex: BoolArray
    star: IntArray
    first_star: IntArray
    face: IntArray
    bending: int  # the first so many facets are of deformable bodies


class Rims(NamedTuple):
    """Rims that a foot lies on: edge (RIMS,), their directions inwards (RIMS, 3), points on them, start (RIMS, 3): `_rims` writes in it."""

    edge: IntArray
    inwards: FloatArray
    start: FloatArray


@njit(cache=True)
def _rims(f: int, foot: Vector, n: Vector, near: float, beside: float, rims: Rims, s: Surroundings) -> int:
    """How many rims of the facet f the foot lies on, nearer than `beside`.

    At a corner, the rims there of all facets in that plane: a face may be cut into triangles.
    """
    count = 0
    corner = -1
    for c in range(s.sides[f]):
        arm = minus(foot, at(s.point, s.facets[f, c]))
        if dot(arm, arm) < 4.0 * near * near:
            corner = s.facets[f, c]
    first, end = (s.first_star[corner], s.first_star[corner + 1]) if corner >= 0 else (0, 1)
    for k in range(first, end):
        g = s.star[k] if corner >= 0 else f
        if g != f and dot(at(s.normals, g), n) < _SAME_PLANE:
            continue
        for l in range(s.sides[g]):
            edge = s.facet_edges[g, l]
            if edge < 0 or not s.rim[edge] or count == RIMS:
                continue
            a = at(s.point, s.facets[g, l])
            if s.sides[g] == 2:
                along = minus(at(s.point, s.facets[g, 1]), at(s.point, s.facets[g, 0]))
                inward = along if l == 0 else times(-1.0, along)
            else:
                following = l + 1 if l + 1 < s.sides[g] else 0
                if corner >= 0 and s.facets[g, l] != corner and s.facets[g, following] != corner:
                    continue
                inward = cross(n, minus(at(s.point, s.facets[g, following]), a))
            inward = unit(inward)
            if dot(minus(foot, a), inward) < beside:
                rims.edge[count] = edge
                rims.inwards[count, 0], rims.inwards[count, 1], rims.inwards[count, 2] = inward
                rims.start[count, 0], rims.start[count, 1], rims.start[count, 2] = a
                count += 1
    return count


@njit(cache=True)
def covers(v: int, f: int, foot: Vector, n: Vector, near: float, beside: float, rims: Rims, s: Surroundings) -> bool:
    """Whether the surface around v lies over the facet f: always for a foot well inside it, and for one on its rim only if a facet
    around v that faces it reaches over the rim inwards, without rising steeply from it, or all that surface rises steeply, on both sides
    of a rim that is no sharper than a right angle. (Blocks whose corners merely meet, in a wall or, at any angles, in a dome, do not hold
    each other, nor do triangles around a common corner; one that rocks on the rim is held, and a plate that ends on a tip.)"""
    count = _rims(f, foot, n, near, beside, rims, s)
    if count == 0:
        return True
    tip, over_it = True, False
    for r in range(count):
        one, other = s.edge_facets[rims.edge[r], 0], s.edge_facets[rims.edge[r], 1]
        tip = tip and dot(at(s.normals, one), at(s.normals, other)) > _ACUTE
    for k in range(s.first_star[v], s.first_star[v + 1]):
        g = s.star[k]
        over, steeply = True, True
        for r in range(count):
            reaches, rises = False, False
            for c in range(s.sides[g]):
                corner = at(s.point, s.facets[g, c])
                inside, rise = dot(minus(corner, at(rims.start, r)), at(rims.inwards, r)), dot(minus(corner, foot), n)
                if inside > 10.0 * near:
                    rises = True
                    reaches = reaches or rise < _RISES * inside
                elif inside < -10.0 * near and rise < -_RISES * inside:
                    tip = False
            over, steeply = over and reaches, steeply and rises
        if over and -dot(at(s.normals, g), n) > FACING:
            return True
        over_it = over_it or steeply
    return tip and over_it


@njit(cache=True)
def angle(a: Vector, b: Vector) -> float:
    """Between two unit vectors."""
    return np.arccos(min(max(dot(a, b), -1.0), 1.0))


@njit(cache=True)
def is_rim_of(down: Vector, n: Vector, beyond: Vector) -> bool:
    """Whether what faces `down`, inwards, may lie on the rim between a face with the normal n, which it lies over, and one `beyond`: not
    where it lies on either of them, nor beside both."""
    here, there = dot(down, n), dot(down, beyond)
    return here < _LEVEL and there < _LEVEL and (here > _STEEP or there < _STEEP)


@njit(cache=True)
def bears_by_its_rim(v: int, f: int, foot: Vector, n: Vector, near: float, rims: Rims, s: Surroundings) -> bool:
    """Whether a face around v lies on the rim of the facet f, rather than v on f: both end in the same place, where either is possible.

    Let that face fall away from f by the angle a, and from the facet beyond the rim by b: of both ends the one that is touched more
    squarely touches. The rim's mean normal is |a - b| / 2 off the face's, v's mean normal some other angle off that of f. A plate that
    ends on a knife does not lean on its side; of equal ends what is deformable lies on what is rigid."""
    count = _rims(f, foot, n, near, 2.0 * near, rims, s)
    if count == 0:
        return False
    inward = at(rims.inwards, 0)
    for r in range(1, count):
        if dot(at(rims.inwards, r), inward) < _STRAIGHT:
            return False
    one, other = s.edge_facets[rims.edge[0], 0], s.edge_facets[rims.edge[0], 1]
    beyond = at(s.normals, one) if dot(at(s.normals, one), n) < dot(at(s.normals, other), n) else at(s.normals, other)
    along, mean = unit(cross(n, inward)), times(-1.0, at(s.mean, v))
    own = angle(unit(minus(mean, times(dot(mean, along), along))), n)
    for k in range(s.first_star[v], s.first_star[v + 1]):
        down = times(-1.0, at(s.normals, s.star[k]))
        if dot(down, n) <= FACING or abs(dot(down, along)) > _AT_AN_ANGLE or not is_rim_of(down, n, beyond):
            continue
        bends, bent = s.star[k] < s.bending, f < s.bending
        margin = SQUARER if bends == bent else (-RIGID if bends else RIGID)
        if own > angle(down, unit(plus(n, beyond))) + margin:
            return True
    return False
