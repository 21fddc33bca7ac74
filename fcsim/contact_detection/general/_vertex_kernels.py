"""Which facets of a body a vertex touches, compiled: one (vertex, body) a group of rows."""

from __future__ import annotations

import numpy as np
from numba import njit

from fcsim.arrays import FloatArray, IntArray
from fcsim.contact_detection._vector_kernels import Vector, at, dot, length, minus, plus, times, unit
from fcsim.contact_detection.general._foot_kernels import EDGE, INSIDE, VERTEX
from fcsim.contact_detection.skin._rim_kernels import FACING, RIMS, Rims, Surroundings, bears_by_its_rim, covers

_STEEP = 0.8  # sine of the slope
_AT_AN_ANGLE = 0.7  # cosine between facets that are not of one face, whatever connects them
_INNER = 0.05  # the same, of one face over another: a corner between two, not what strain bends
_FLUSH, _DESCENDS = 0.9, 0.01  # cosine between a facet around a vertex and one that it lies flush with; sine of a slope
_TIGHT = 1e-5  # of half a facet: what overlaps a face by more lies on its rim only where it is as near to that
_OPPOSITE, _ACROSS = -0.9, 1e-3  # cosine of faces that look opposite ways; of a way out: nearer to the far face than this, it leads across
_ROUND_IT = 0.5  # cosine: the way to a smooth edge that is nearest leaves it no farther from its mean normal, in or out
_ROLL = 10.0  # nearer to an edge than this times `near`, the direction from it is round-off: its mean normal is taken


@njit(cache=True)
def _facing(v: int, n: Vector, s: Surroundings) -> float:
    """How squarely the surface around the vertex v faces the direction n: the largest -n_facet . n, or that of its mean (of a needle).

    -1 where it is not v that touches there: where the surface goes on steeply against n from v, or descends from the inner corner of two
    faces, or although another facet of v looks the same way as n: a sharp corner within a body, its side flush with that body's, does not
    leave by that side.
    """
    best, lowest, flush = -dot(at(s.mean, v), n), 0.0, False
    faced, squarest = -1, 0.0
    here = at(s.point, v)
    for k in range(s.first_star[v], s.first_star[v + 1]):
        g = s.star[k]
        cosine = dot(at(s.normals, g), n)
        best, flush = max(best, -cosine), flush or cosine > _FLUSH
        if cosine < squarest:
            faced, squarest = g, cosine
        for c in range(s.sides[g]):
            along = minus(at(s.point, s.facets[g, c]), here)
            rise = dot(along, n)
            if rise < 0.0:
                lowest = min(lowest, rise / length(along))
    if lowest < -_STEEP or (lowest < -_DESCENDS and (flush or (faced >= 0 and _in_front(v, faced, s)))):
        return -1.0
    return best


@njit(cache=True)
def _differ(f: int, g: int, s: Surroundings) -> bool:
    """Whether two facets are of two faces, or of one that goes round to where they meet at an angle."""
    return s.face[f] != s.face[g] or dot(at(s.normals, f), at(s.normals, g)) < _AT_AN_ANGLE


@njit(cache=True)
def _in_front(v: int, f: int, s: Surroundings) -> bool:
    """Whether another face that ends in the vertex v rises in front of the facet f around it: v is in an inner corner."""
    here, n = at(s.point, v), at(s.normals, f)
    for k in range(s.first_star[v], s.first_star[v + 1]):
        g = s.star[k]
        if not _differ(f, g, s):
            continue
        for c in range(s.sides[g]):
            along = minus(at(s.point, s.facets[g, c]), here)
            if dot(along, n) > _INNER * length(along):
                return True
    return False


@njit(cache=True)
def _leads_across(best: int, begin: int, end: int, normal: FloatArray, height: FloatArray, distance: FloatArray) -> bool:
    """Whether the way out through the facet of row `best` leads across the whole body: the vertex is at its opposite face but for noise.

    Corners of joints that overlap by the digits of a file, flush with their neighbours' undersides, leave through no top."""
    n, across = at(normal, best), False
    for row in range(begin, end):
        across = across or (distance[row] < _ACROSS * abs(height[best]) and dot(at(normal, row), n) < _OPPOSITE)
    return across


@njit(cache=True)
def _pseudonormal(row: int, f: int, feature: int, normal: FloatArray, s: Surroundings) -> Vector:
    """Direction whose scalar product with the arm from the foot tells outside from inside."""
    if feature == INSIDE:
        return at(normal, row)
    if feature >= VERTEX:
        return at(s.mean, s.facets[f, feature - VERTEX])
    edge = s.facet_edges[f, feature - EDGE]
    return unit(plus(at(s.normals, s.edge_facets[edge, 0]), at(s.normals, s.edge_facets[edge, 1])))


@njit(cache=True)
def _in_a_corner(f: int, feature: int, s: Surroundings) -> bool:
    """Whether a foot on the boundary of a facet lies where another face rises: in a concave edge, or at its end."""
    if feature == INSIDE:
        return False
    l = feature - EDGE if feature < VERTEX else feature - VERTEX
    if _concave(s.facet_edges[f, l], s):
        return True
    if feature < VERTEX or s.sides[f] == 2:
        return False
    return _concave(s.facet_edges[f, l - 1 if l > 0 else s.sides[f] - 1], s)


@njit(cache=True)
def _concave(edge: int, s: Surroundings) -> bool:
    """Whether two faces meet in an edge and make an inner corner there."""
    f, g = s.edge_facets[edge, 0], s.edge_facets[edge, 1]
    step, n = minus(at(s.centres, g), at(s.centres, f)), minus(at(s.normals, f), at(s.normals, g))
    return not s.rim[edge] and _differ(f, g, s) and dot(step, n) > 0.0


@njit(cache=True)
def touched_facets(
    first: IntArray,
    vertex: IntArray,
    facet: IntArray,
    weights: FloatArray,
    normal: FloatArray,
    height: FloatArray,
    distance: FloatArray,
    feature: IntArray,
    alert: FloatArray,
    depth: FloatArray,
    near: FloatArray,
    s: Surroundings,
) -> tuple[IntArray, FloatArray, FloatArray, IntArray]:
    """Rows that are contacts, their normals (nc, 3) and gaps (nc,) [m], and the groups whose vertex is at a rim and touches
    nothing only since it does not reach over it; long because it is one decision, in the order of `vertices`.

    first (groups + 1,): rows of a group, one vertex and the facets of one body near it; alert, depth, near (groups,) [m].
    """
    chosen = np.empty(len(vertex), dtype=np.int64)
    beyond = np.empty(len(first), dtype=np.int64)
    n_chosen = n_beyond = 0
    N, gap = np.empty((len(vertex), 3)), np.empty(len(vertex))
    usable, under = np.empty(len(vertex), dtype=np.bool_), np.empty(len(vertex), dtype=np.bool_)
    score = np.empty(len(vertex))
    rims = Rims(np.empty(RIMS, dtype=np.int64), np.empty((RIMS, 3)), np.empty((RIMS, 3)))
    for group in range(len(first) - 1):
        begin, end = first[group], first[group + 1]
        v, tol = vertex[begin], near[group]
        closest = begin
        for row in range(begin + 1, end):
            if distance[row] < distance[closest]:
                closest = row
        # 1. inside or outside, by the nearest feature
        f, where = facet[closest], feature[closest]
        if distance[closest] > max(alert[group], depth[group]):  # nearer facets may not be in the list
            continue
        outward = _pseudonormal(closest, f, where, normal, s)
        arm = at(s.point, v)
        for k in range(4):
            arm = minus(arm, times(weights[closest, k], at(s.point, s.facets[f, k])))
        outside = dot(arm, outward) > 0.0 and distance[closest] > tol
        if outside and distance[closest] > alert[group]:
            continue
        # 2. rows whose facet is under (over) the vertex and faced by its surroundings
        for row in range(begin, end):
            aside = np.sqrt(max(distance[row] ** 2 - height[row] ** 2, 0.0))
            usable[row] = feature[row] == INSIDE or aside <= tol
            if not usable[row] and not outside and aside <= depth[group]:
                usable[row] = _in_a_corner(facet[row], feature[row], s)
            under[row] = usable[row]
            if outside:
                usable[row] = usable[row] and 0.0 < height[row] <= alert[group]
            else:
                usable[row] = usable[row] and -depth[group] <= height[row] <= tol
            if usable[row]:
                score[row] = _facing(v, at(normal, row), s)
                usable[row] = score[row] > FACING
        # 3. the least way out of the body (the nearest facet above it); of equal ones that which is faced most squarely
        best, deepest, refused = -1, np.inf, False
        while True:
            best = -1
            for row in range(begin, end):
                if usable[row] and abs(height[row]) <= deepest:
                    nearer = best < 0 or abs(height[row]) < abs(height[best]) - tol
                    alike = best >= 0 and abs(height[row]) <= abs(height[best]) + tol
                    if nearer or (alike and score[row] > score[best] + 1e-9):
                        best = row
            if best < 0:
                break
            if height[best] < 0.0 and _leads_across(best, begin, end, normal, height, distance):
                usable[best] = False
                continue
            n = at(normal, best)
            foot = minus(at(s.point, v), times(height[best], n))
            tight = min(2.0 * tol, _TIGHT * depth[group])  # flush sides of elastic bodies do not stay flush; edges that overlap are held
            beside = tight if height[best] < -tight else 2.0 * tol
            if covers(v, facet[best], foot, n, tol, beside, rims, s) and not bears_by_its_rim(v, facet[best], foot, n, tol, rims, s):
                break
            usable[best], refused = False, True
            deepest = min(deepest, abs(height[best]) + _ROLL * tol)  # where corners meet, the way out is none through a farther side
        # 4. over a smooth edge or corner: along the line to it
        rolls = False
        if where >= VERTEX:
            rolls = s.smooth_vertex[s.facets[f, where - VERTEX]]
        elif where >= EDGE:
            rolls = s.smooth[s.facet_edges[f, where - EDGE]]
        if rolls and (best < 0 or distance[closest] < abs(height[best]) - tol):
            direction, leaves = outward, True
            if distance[closest] > _ROLL * tol:
                rise = dot(arm, outward)
                leaves = abs(rise) >= _ROUND_IT * distance[closest]  # else that edge is nearest since the facets next to it are left out
                direction = times((1.0 if rise > 0.0 else -1.0) / distance[closest], arm)
            if leaves and _facing(v, direction, s) > FACING:
                chosen[n_chosen], gap[n_chosen] = closest, dot(arm, direction)
                N[n_chosen, 0], N[n_chosen, 1], N[n_chosen, 2] = direction
                n_chosen += 1
                continue
        if best < 0:
            if refused:
                beyond[n_beyond] = group
                n_beyond += 1
            continue
        # 5. that facet, and those that meet it in a concave corner
        chosen[n_chosen], gap[n_chosen] = best, height[best]
        N[n_chosen, 0], N[n_chosen, 1], N[n_chosen, 2] = at(normal, best)
        n_chosen += 1
        kept = n_chosen - 1
        for row in range(begin, end):
            if row == best or not (under[row] and -depth[group] <= height[row] <= alert[group]):
                continue
            if _facing(v, at(normal, row), s) <= FACING:
                continue
            concave = True
            for other in range(kept, n_chosen):
                g, h = facet[chosen[other]], facet[row]
                step, ng, nh = minus(at(s.centres, h), at(s.centres, g)), at(s.normals, g), at(s.normals, h)
                concave = concave and dot(step, ng) > tol and -dot(step, nh) > tol and _differ(g, h, s)
            if concave:
                chosen[n_chosen], gap[n_chosen] = row, height[row]
                N[n_chosen, 0], N[n_chosen, 1], N[n_chosen, 2] = at(normal, row)
                n_chosen += 1
    return chosen[:n_chosen].copy(), N[:n_chosen].copy(), gap[:n_chosen].copy(), beyond[:n_beyond].copy()
