"""How deep the skin of a body lies in another part of the same body, compiled."""

from __future__ import annotations

import numpy as np
from numba import njit

from fcsim.witness._distance_kernels import _STACK, _TIE, _cross, _dot, _minus, _nearest_on_triangle, _square_to_box, winding

_OPPOSED = -0.1  # cosine between a vertex' normal and that of a facet that it may lie behind
_OUT = 0.25  # of its depth: so far out of its own skin a point is looked at


@njit(cache=True)
def vertex_normals(body, forest, modulus):
    """Normals (np, 3) of the points of a body, by the areas around them; points with the same number modulo `modulus` are one."""
    points, triangles, root = forest.points, forest.triangles, forest.roots[body]
    normal = np.zeros((min(modulus, len(points)), 3))
    for t in range(forest.begin[root], forest.end[root]):
        a, b, c = triangles[t]
        area = _cross(_minus(points[b], points[a]), _minus(points[c], points[a]))
        for corner in range(3):
            for i in range(3):
                normal[triangles[t, corner] % modulus, i] += area[i]
    return normal


@njit(cache=True)
def samples(body, vertices, forest, modulus):
    """Points p (ns, 3) of a body's skin, its vertices and the centres of its triangles; the skin's normals n there, not of unit length,
    zero where there is none; and the points around each, own (ns, 3), -1 = none."""
    points, triangles, root = forest.points, forest.triangles, forest.roots[body]
    first, last, nv = forest.begin[root], forest.end[root], len(vertices)
    p, n = np.zeros((nv + last - first, 3)), np.zeros((nv + last - first, 3))
    own = np.full((nv + last - first, 3), -1, dtype=np.int64)
    mean = vertex_normals(body, forest, modulus)
    for k in range(nv):
        own[k, 0] = vertices[k]
        for i in range(3):
            p[k, i] = points[vertices[k], i]
            if vertices[k] < len(mean):
                n[k, i] = mean[vertices[k], i]
    for t in range(first, last):
        k = nv + t - first
        a, b, c = triangles[t]
        area = _cross(_minus(points[b], points[a]), _minus(points[c], points[a]))
        for i in range(3):
            p[k, i] = (points[a, i] + points[b, i] + points[c, i]) / 3.0
            n[k, i] = area[i]
            own[k, i] = triangles[t, i] % modulus
    return p, n, own


@njit(cache=True)
def _nearest_opposed(p, n, own, body, most, behind, forest, modulus):
    """Distance [m] from p, of normal n, to the nearest triangle that opposes it and shares no point with it, `most` where none is
    nearer, and its height above that; behind > 0: among those only behind which it lies by more."""
    stack = np.empty(_STACK, dtype=np.int64)
    points, triangles, low, high, child = forest.points, forest.triangles, forest.low, forest.high, forest.child
    best, side = most * most, 0.0
    stack[0], k = forest.roots[body], 1
    while k:
        k -= 1
        node = stack[k]
        if _square_to_box(p, low[node], high[node]) > best * (1.0 + _TIE):
            continue
        if child[node] >= 0:
            stack[k], stack[k + 1] = child[node], child[node] + 1
            k += 2
            continue
        for t in range(forest.begin[node], forest.end[node]):
            shared = False
            for corner in range(3):
                one = triangles[t, corner] % modulus
                shared = shared or one == own[0] or one == own[1] or one == own[2]
            if shared:
                continue
            a, b, c = points[triangles[t, 0]], points[triangles[t, 1]], points[triangles[t, 2]]
            normal = _cross(_minus(b, a), _minus(c, a))
            length = np.sqrt(_dot(normal, normal))
            if length == 0.0 or _dot(normal, n) > _OPPOSED * length * np.sqrt(_dot(n, n)):
                continue
            height = _dot(_minus(p, a), normal) / length
            if behind > 0.0 and height >= -behind:
                continue
            s, w = _nearest_on_triangle(p, a, b, c)
            u = 1.0 - s - w
            away = (
                p[0] - u * a[0] - s * b[0] - w * c[0],
                p[1] - u * a[1] - s * b[1] - w * c[1],
                p[2] - u * a[2] - s * b[2] - w * c[2],
            )
            square = _dot(away, away)
            if square < best * (1.0 - _TIE) or (square <= best * (1.0 + _TIE) and abs(height) > abs(side)):
                side = height
            best = min(best, square)
    return np.sqrt(best), side


@njit(cache=True)
def thicknesses(body, vertices, least, forest, modulus):
    """Distance (ns,) [m] from the samples of a body's skin to the nearest facet behind which they lie by more than `least` and that opposes
    them: through the body; infinity for none."""
    p, n, own = samples(body, vertices, forest, modulus)
    result = np.full(len(p), np.inf)
    for k in range(len(p)):
        if _dot(n[k], n[k]) > 0.0:
            result[k] = _nearest_opposed(p[k], n[k], own[k], body, np.inf, least, forest, modulus)[0]
    return result


@njit(cache=True)
def deepest_in_itself(body, vertices, limit, least, forest, modulus):
    """Depth [m] of the deepest sample of a body's skin in another part of it, 0 for none, and its place (3,).

    A sample is looked at where the nearest facet that opposes it is nearer than limit (ns,) [m] and before it, and counts where a point a
    little out of its own skin, or of that of a triangle around it, is inside the body.
    """
    p, n, own = samples(body, vertices, forest, modulus)
    depth, nv = 0.0, len(vertices)
    place, out = np.zeros(3), np.empty(3)
    held = np.zeros(min(modulus, len(forest.points)), dtype=np.bool_)  # vertices around a triangle that is in another part
    for turn in range(2):  # the triangles first: what they say holds for the vertices around them, on rims too
        for k in range(nv if turn == 0 else 0, len(p) if turn == 0 else nv):
            length = np.sqrt(_dot(n[k], n[k]))
            if length == 0.0:
                continue
            below, height = _nearest_opposed(p[k], n[k], own[k], body, limit[k], 0.0, forest, modulus)
            if below >= limit[k] or below <= least or height >= -least or (turn == 1 and below <= depth):
                continue
            inside = turn == 1 and held[own[k, 0]]
            if not inside:
                for i in range(3):
                    out[i] = p[k, i] + _OUT * below * n[k, i] / length
                inside = winding(out, body, forest) > 0.5
            if inside:
                if turn == 0:
                    for i in range(3):
                        held[own[k, i]] = True
                if below > depth:
                    depth = below
                    for i in range(3):
                        place[i] = p[k, i]
    return depth, place
