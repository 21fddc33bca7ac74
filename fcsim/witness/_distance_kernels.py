"""Points, segments and closed triangulated skins, compiled: nearest facet, inside or outside, piercings.

A skin's triangles hang in a binary tree: node k covers triangles begin[k] ... end[k] - 1 within low[k] ... high[k]; its children are
child[k] and child[k] + 1; child[k] = -1 marks a leaf. Sources: C. Ericson, "Real-Time Collision Detection", 2005, 5.1.5 (nearest
point of a triangle) and 5.3.6 (segment and triangle); A. van Oosterom, J. Strackee, "The solid angle of a plane triangle", IEEE Trans.
Biomed. Eng. 30, 1983.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from fcsim.arrays import FloatArray, IntArray


class Forest(NamedTuple):
    """Points (np, 3) [m], triangles (nt, 3), the nodes of the bodies' trees (see above) and where each body's begins (nbodies,)."""

    points: FloatArray
    triangles: IntArray
    low: FloatArray
    high: FloatArray
    begin: IntArray
    end: IntArray
    child: IntArray
    roots: IntArray


_STACK = 128
_TIE = 1e-9  # distances equal up to this share come from one edge or vertex


@njit(cache=True)
def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True)
def _minus(a, b):
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


@njit(cache=True)
def _cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@njit(cache=True)
def _nearest_on_triangle(p, a, b, c):
    """The barycentric weights of b and c at the point of the triangle nearest to p (Ericson 5.1.5)."""
    ab, ac, ap = _minus(b, a), _minus(c, a), _minus(p, a)
    d1, d2 = _dot(ab, ap), _dot(ac, ap)
    if d1 <= 0.0 and d2 <= 0.0:
        return 0.0, 0.0
    bp = _minus(p, b)
    d3, d4 = _dot(ab, bp), _dot(ac, bp)
    if d3 >= 0.0 and d4 <= d3:
        return 1.0, 0.0
    vc = d1 * d4 - d3 * d2
    if vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        return d1 / (d1 - d3), 0.0
    cp = _minus(p, c)
    d5, d6 = _dot(ab, cp), _dot(ac, cp)
    if d6 >= 0.0 and d5 <= d6:
        return 0.0, 1.0
    vb = d5 * d2 - d1 * d6
    if vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        return 0.0, d2 / (d2 - d6)
    va = d3 * d6 - d5 * d4
    if va <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0:
        w = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        return 1.0 - w, w
    total = va + vb + vc
    return vb / total, vc / total


@njit(cache=True)
def _square_to_box(p, low, high):
    s = 0.0
    for i in range(3):
        out = max(low[i] - p[i], 0.0, p[i] - high[i])
        s += out * out
    return s


@njit(cache=True)
def signed_distance(p, body, stop, forest):
    """Distance [m] from p to a skin, negative inside, and whether the nearest point lies within a facet.

    As soon as the distance is known to be at most `stop` the search ends with a distance in 0 ... stop. The side is that of the facet
    seen least edge-on among those that share the nearest point: where that is an edge, it is right; at saddle vertices it may not be.
    """
    stack = np.empty(_STACK, dtype=np.int64)
    points, triangles, low, high, child = forest.points, forest.triangles, forest.low, forest.high, forest.child
    stack[0], n = forest.roots[body], 1
    best, side, within = np.inf, 0.0, False
    stop2 = stop * stop
    while n:
        n -= 1
        node = stack[n]
        if _square_to_box(p, low[node], high[node]) > best * (1.0 + _TIE):
            continue
        if child[node] >= 0:
            left, other = child[node], child[node] + 1
            near_left = _square_to_box(p, low[left], high[left]) <= _square_to_box(p, low[other], high[other])
            stack[n] = other if near_left else left  # the nearer child is looked at first
            stack[n + 1] = left if near_left else other
            n += 2
            continue
        for t in range(forest.begin[node], forest.end[node]):
            a, b, c = points[triangles[t, 0]], points[triangles[t, 1]], points[triangles[t, 2]]
            v, w = _nearest_on_triangle(p, a, b, c)
            u = 1.0 - v - w
            away = (
                p[0] - u * a[0] - v * b[0] - w * c[0],
                p[1] - u * a[1] - v * b[1] - w * c[1],
                p[2] - u * a[2] - v * b[2] - w * c[2],
            )
            square = _dot(away, away)
            if square > best * (1.0 + _TIE):
                continue
            if square <= stop2:
                return np.sqrt(square), True
            normal = _cross(_minus(b, a), _minus(c, a))
            length = np.sqrt(_dot(normal, normal))
            if length == 0.0:
                continue
            height = _dot(away, normal) / length
            if square < best * (1.0 - _TIE) or abs(height) > abs(side):
                side = height
                within = min(u, v, w) > 1e-9
            best = min(best, square)
    return np.sqrt(best) if side >= 0.0 else -np.sqrt(best), within


@njit(cache=True)
def winding(p, body, forest):
    """How often a skin goes around p: 1 inside a closed skin, 0 outside (solid angles over 4 pi)."""
    points, triangles, root = forest.points, forest.triangles, forest.roots[body]
    total = 0.0
    for t in range(forest.begin[root], forest.end[root]):
        a, b, c = _minus(points[triangles[t, 0]], p), _minus(points[triangles[t, 1]], p), _minus(points[triangles[t, 2]], p)
        la, lb, lc = np.sqrt(_dot(a, a)), np.sqrt(_dot(b, b)), np.sqrt(_dot(c, c))
        below = la * lb * lc + _dot(a, b) * lc + _dot(b, c) * la + _dot(c, a) * lb
        total += 2.0 * np.arctan2(_dot(a, _cross(b, c)), below)
    return total / (4.0 * np.pi)


@njit(cache=True)
def piercings(p, q, body, forest, found):
    """Write where the segment p -> q pierces a skin, as sorted shares of its length, into `found`; return how many (Ericson 5.3.6)."""
    along = _minus(q, p)
    stack = np.empty(_STACK, dtype=np.int64)
    points, triangles, low, high, child = forest.points, forest.triangles, forest.low, forest.high, forest.child
    stack[0], n, count = forest.roots[body], 1, 0
    while n:
        n -= 1
        node = stack[n]
        enter, leave = 0.0, 1.0
        for i in range(3):
            if along[i] == 0.0:
                if p[i] < low[node, i] or p[i] > high[node, i]:
                    leave = -1.0
            else:
                s, t = (low[node, i] - p[i]) / along[i], (high[node, i] - p[i]) / along[i]
                enter, leave = max(enter, min(s, t)), min(leave, max(s, t))
        if enter > leave + 1e-12:
            continue
        if child[node] >= 0:
            stack[n], stack[n + 1] = child[node] + 1, child[node]
            n += 2
            continue
        for k in range(forest.begin[node], forest.end[node]):
            a, b, c = points[triangles[k, 0]], points[triangles[k, 1]], points[triangles[k, 2]]
            ab, ac, ap = _minus(b, a), _minus(c, a), _minus(p, a)
            normal = _cross(ab, ac)
            below = -_dot(along, normal)
            if below == 0.0:
                continue
            e = _cross((-along[0], -along[1], -along[2]), ap)
            share, v, w = _dot(ap, normal) / below, _dot(ac, e) / below, -_dot(ab, e) / below
            if 0.0 < share < 1.0 and v >= -1e-12 and w >= -1e-12 and v + w <= 1.0 + 1e-12 and count < len(found):
                place = count
                while place > 0 and found[place - 1] > share:
                    found[place] = found[place - 1]
                    place -= 1
                found[place] = share
                count += 1
    return count
