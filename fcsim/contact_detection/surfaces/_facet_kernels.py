"""Facets in space and points beside them, compiled: a wall of 192 bricks has 20 000 facets and three times as many possible pairs.

Products of vectors are summed as NumPy's einsum does with vectors of four numbers: first and third, then the second.
"""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import math

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def _dot(a, b):
    return (a[0] * b[0] + a[2] * b[2]) + a[1] * b[1]


@njit(cache=True, nogil=True, error_model="numpy")
def write_facets(closed, positions, corners, centre, radius, normal, area):
    """Write what `facets_in_space` finds."""
    n, k = closed.shape
    a, b = np.empty(3), np.empty(3)
    for f in range(n):
        own = corners[f]
        for c in range(k):
            for i in range(3):
                own[c, i] = positions[closed[f, c], i]
        for i in range(3):
            s = own[0, i] + own[1, i]
            for c in range(2, k):
                s += own[c, i]
            centre[f, i] = s / k
        square = 0.0
        for c in range(k):
            for i in range(3):
                a[i] = own[c, i] - centre[f, i]
            square = max(square, _dot(a, a))
        radius[f] = math.sqrt(square)
        for i in range(3):  # half the cross product of the diagonals
            a[i], b[i] = own[2, i] - own[0, i], own[3 % k, i] - own[1, i]
        x, y, z = 0.5 * (a[1] * b[2] - a[2] * b[1]), 0.5 * (a[2] * b[0] - a[0] * b[2]), 0.5 * (a[0] * b[1] - a[1] * b[0])
        area[f] = math.sqrt((x * x + z * z) + y * y)
        normal[f, 0], normal[f, 1], normal[f, 2] = x / area[f], y / area[f], z / area[f]


@njit(cache=True, nogil=True, error_model="numpy")
def facets_in_space(closed, positions):
    """Corners (n, k, 3), centres, radii around them, mean normals and their lengths, the areas, of facets closed (n, k), k = 3 or 4; see
    `geometry`."""
    n, k = closed.shape
    corners, centre, radius, normal, area = np.empty((n, k, 3)), np.empty((n, 3)), np.empty(n), np.empty((n, 3)), np.empty(n)
    write_facets(closed, positions, corners, centre, radius, normal, area)
    return corners, centre, radius, normal, area


@njit(cache=True, nogil=True)
def mean_points(nodes, weights, positions):
    """Sums (n, 3) of weights (n, k) times the positions of nodes (n, k), where the weight is 0 of any."""
    points = np.zeros((len(nodes), 3))
    for a in range(len(nodes)):
        for c in range(nodes.shape[1]):
            for i in range(3):
                points[a, i] += weights[a, c] * positions[nodes[a, c], i]
    return points


@njit(cache=True, nogil=True)
def near_of_list(points, centres, reach, first, second):
    """Which of the listed pairs have |points[i] - centres[j]| <= reach[j]: their numbers i and j."""
    i, j, n = np.empty_like(first), np.empty_like(second), 0
    for p in range(len(first)):
        x, y = points[first[p]], centres[second[p]]
        a, b, c = x[0] - y[0], x[1] - y[1], x[2] - y[2]
        i[n], j[n] = first[p], second[p]
        n += (a * a + c * c) + b * b <= reach[second[p]] * reach[second[p]]
    return i[:n], j[:n]


@njit(cache=True, nogil=True)
def facing_above(candidate, facet, point, outward, size, alert, master, opposing, edge_tolerance, penetration):
    """The pairs of a candidate and a facet that face each other with the point above or just beside the facet, see `plausible`.

    point, outward (np, 3), size, alert (np,) of the candidates; master: corners, centre, radius, normal, size of the facets.
    """
    corners, centre, radius, normal, facet_size = master
    i, j, n = np.empty_like(candidate), np.empty_like(facet), 0
    arm, warped = np.empty(3), np.empty(3)
    for p in range(len(candidate)):
        c, f = candidate[p], facet[p]
        N = normal[f]
        if not _dot(outward[c], N) < opposing:
            continue
        for k in range(3):
            arm[k], warped[k] = point[c, k] - centre[f, k], corners[f, 0, k] - centre[f, k]
        height, warp, least = _dot(arm, N), abs(_dot(warped, N)), min(size[c], facet_size[f])
        aside = math.sqrt(max(_dot(arm, arm) - height * height, 0.0))
        slack = edge_tolerance * least
        if height > alert[c] + warp + slack or height < -penetration * least - warp - slack:
            continue
        if aside > radius[f] + alert[c] + max(-height, 0.0) + 2 * slack:
            continue
        i[n], j[n] = c, f
        n += 1
    return i[:n], j[:n]


@njit(cache=True, nogil=True)
def feet_of_points(point, candidate, corners, facet, weights, normal):
    """Feet (n, 3), gaps and distances (n,) at shape functions weights (n, k) of the facets, along unit normals (n, 3)."""
    n, k = weights.shape
    foot, gap, distance, arm = np.zeros((n, 3)), np.empty(n), np.empty(n), np.empty(3)
    for p in range(n):
        own = corners[facet[p]]
        for c in range(k):
            for i in range(3):
                foot[p, i] += weights[p, c] * own[c, i]
        for i in range(3):
            arm[i] = point[candidate[p], i] - foot[p, i]
        gap[p], distance[p] = _dot(arm, normal[p]), math.sqrt(_dot(arm, arm))
    return foot, gap, distance


@njit(cache=True, nogil=True)
def frames_of_normals(normals):
    """See `frames`, in space."""
    frames, axis, t = np.empty((len(normals), 3, 3)), np.zeros(3), np.empty(3)
    for a in range(len(normals)):
        N = normals[a]
        steep = abs(N[0]) > 0.9
        axis[0], axis[1] = 0.0 if steep else 1.0, 1.0 if steep else 0.0
        along = _dot(axis, N)
        for i in range(3):
            t[i] = axis[i] - along * N[i]
        length = math.sqrt(_dot(t, t))
        for i in range(3):
            t[i] /= length
            frames[a, 0, i], frames[a, 1, i] = N[i], t[i]
        frames[a, 2, 0], frames[a, 2, 1] = N[1] * t[2] - N[2] * t[1], N[2] * t[0] - N[0] * t[2]
        frames[a, 2, 2] = N[0] * t[1] - N[1] * t[0]
    return frames
