"""Overlaps of facets in space, compiled: polygons, Gauss points in them, mortar sums. One (slave facet, master facet) pair a row."""

from __future__ import annotations

import numpy as np
from numba import njit

from fcsim.arrays import FloatArray, IntArray

MAX_CORNERS = 8  # of the intersection of two convex quadrilaterals
_SLIVER = 1e-12  # overlaps of a smaller part of the slave facet are round-off
_NEAR = 1e-9  # corners nearer than this, relative to the slave facet, are one
_MAX_NEWTON = 20
_STEP = 1e-12  # Newton's error is the square of its last step


@njit(cache=True)
def _in_plane(corners: FloatArray, count: int, frame: FloatArray, centre: FloatArray, plane: FloatArray, height: FloatArray) -> None:
    """Coordinates of a facet's corners in the slave's frame: (t1, t2) in the plane, and the height along its normal."""
    for k in range(count):
        height[k] = 0.0
        plane[k, 0] = 0.0
        plane[k, 1] = 0.0
        for i in range(3):
            arm = corners[k, i] - centre[i]
            height[k] += frame[0, i] * arm
            plane[k, 0] += frame[1, i] * arm
            plane[k, 1] += frame[2, i] * arm


@njit(cache=True)
def _apart(a: FloatArray, n: int, b: FloatArray, m: int, by: float) -> bool:
    """Whether the first n numbers of a and m of b are in ranges more than `by` apart. Loops: they compile ten times faster than min()."""
    a_low, a_high, b_low, b_high = a[0], a[0], b[0], b[0]
    for k in range(1, n):
        a_low, a_high = min(a_low, a[k]), max(a_high, a[k])
    for k in range(1, m):
        b_low, b_high = min(b_low, b[k]), max(b_high, b[k])
    return a_low - b_high > by or b_low - a_high > by


@njit(cache=True)
def _clip(subject: FloatArray, n: int, window: FloatArray, sides: int, other: FloatArray) -> int:
    """Sutherland-Hodgman: cut the polygon `subject` (n corners, changed in place) by the convex, counter-clockwise `window`."""
    for side in range(sides):
        ax, ay = window[side, 0], window[side, 1]
        ex, ey = window[(side + 1) % sides, 0] - ax, window[(side + 1) % sides, 1] - ay
        if ex == 0.0 and ey == 0.0:
            continue
        m = 0
        for k in range(n):
            px, py = subject[k, 0], subject[k, 1]
            qx, qy = subject[(k + 1) % n, 0], subject[(k + 1) % n, 1]
            p = ex * (py - ay) - ey * (px - ax)
            q = ex * (qy - ay) - ey * (qx - ax)
            if p >= 0.0 and m < len(other):
                other[m, 0], other[m, 1] = px, py
                m += 1
            if ((p > 0.0 and q < 0.0) or (p < 0.0 and q > 0.0)) and m < len(other):
                t = p / (p - q)
                other[m, 0], other[m, 1] = px + t * (qx - px), py + t * (qy - py)
                m += 1
        n = m
        for k in range(n):
            subject[k, 0], subject[k, 1] = other[k, 0], other[k, 1]
        if n < 3:
            return 0
    return n


@njit(cache=True)
def _distinct(polygon: FloatArray, n: int, near: float) -> int:
    """Leave out corners that are the same as the one before but for round-off."""
    m = 0
    for k in range(n):
        before = m - 1 if m else n - 1
        if abs(polygon[k, 0] - polygon[before, 0]) > near or abs(polygon[k, 1] - polygon[before, 1]) > near:
            polygon[m, 0], polygon[m, 1] = polygon[k, 0], polygon[k, 1]
            m += 1
    return m


@njit(cache=True)
def overlap_polygons(
    slave: IntArray,
    master: IntArray,
    slave_corners: FloatArray,
    slave_sides: IntArray,
    frame: FloatArray,
    centre: FloatArray,
    size: FloatArray,
    master_corners: FloatArray,
    master_sides: IntArray,
    master_normal: FloatArray,
    opposing: float,
    reach: FloatArray,
) -> tuple[FloatArray, IntArray, FloatArray]:
    """Intersections of the projections of both facets on the slave facet's tangent plane, along its normal.

    slave, master (np,) facet numbers; corners (nf, k, 3), of which the first `sides` count; frame (ns, 3, 3) rows N, T1, T2 outwards of
    the slave; reach (np,) [m]: facets farther apart along the normal do not meet. Returns corners (np, 8, 2) in the axes T1, T2 from the
    centre, counter-clockwise, their number (np,), 0 where the facets do not overlap or do not face each other, and the areas (np,).
    """
    count = len(slave)
    polygon = np.zeros((count, MAX_CORNERS, 2))
    corners = np.zeros(count, dtype=np.int64)
    area = np.zeros(count)
    window, low = np.empty((4, 2)), np.empty(4)
    subject, other = np.empty((2 * MAX_CORNERS, 2)), np.empty((2 * MAX_CORNERS, 2))
    plane, high = np.empty((4, 2)), np.empty(4)
    for row in range(count):
        s, m = slave[row], master[row]
        if frame[s, 0, 0] * master_normal[m, 0] + frame[s, 0, 1] * master_normal[m, 1] + frame[s, 0, 2] * master_normal[m, 2] >= opposing:
            continue
        sides, n = slave_sides[s], master_sides[m]
        _in_plane(slave_corners[s], sides, frame[s], centre[s], window, low)
        _in_plane(master_corners[m], n, frame[s], centre[s], plane, high)
        if _apart(low, sides, high, n, reach[row]):
            continue
        if _apart(plane[:, 0], n, window[:, 0], sides, 0.0) or _apart(plane[:, 1], n, window[:, 1], sides, 0.0):
            continue
        for k in range(n):  # the master looks the other way: its corners are clockwise here
            subject[k, 0], subject[k, 1] = plane[n - 1 - k, 0], plane[n - 1 - k, 1]
        n = _distinct(subject, _clip(subject, n, window, sides, other), _NEAR * size[s])
        double = 0.0
        for k in range(1, n - 1):
            ax, ay = subject[k, 0] - subject[0, 0], subject[k, 1] - subject[0, 1]
            bx, by = subject[k + 1, 0] - subject[0, 0], subject[k + 1, 1] - subject[0, 1]
            double += ax * by - ay * bx
        if double > 2.0 * _SLIVER * size[s] ** 2 and n <= MAX_CORNERS:
            corners[row], area[row] = n, 0.5 * double
            for k in range(n):
                polygon[row, k, 0], polygon[row, k, 1] = subject[k, 0], subject[k, 1]
    return polygon, corners, area


@njit(cache=True)
def _shape_functions(x: float, y: float, plane: FloatArray, sides: int, shape: FloatArray) -> None:
    """Shape functions of a plane triangle or bilinear quadrilateral at the point (x, y), by Newton's method in the latter."""
    if sides == 3:
        bx, by = plane[1, 0] - plane[0, 0], plane[1, 1] - plane[0, 1]
        cx, cy = plane[2, 0] - plane[0, 0], plane[2, 1] - plane[0, 1]
        px, py = x - plane[0, 0], y - plane[0, 1]
        det = bx * cy - by * cx
        shape[1], shape[2] = (px * cy - py * cx) / det, (bx * py - by * px) / det
        shape[0] = 1.0 - shape[1] - shape[2]
        return
    ax, ay = 0.25 * (plane[0, 0] + plane[1, 0] + plane[2, 0] + plane[3, 0]), 0.25 * (plane[0, 1] + plane[1, 1] + plane[2, 1] + plane[3, 1])
    bx, by = 0.25 * (plane[1, 0] + plane[2, 0] - plane[0, 0] - plane[3, 0]), 0.25 * (plane[1, 1] + plane[2, 1] - plane[0, 1] - plane[3, 1])
    cx, cy = 0.25 * (plane[2, 0] + plane[3, 0] - plane[0, 0] - plane[1, 0]), 0.25 * (plane[2, 1] + plane[3, 1] - plane[0, 1] - plane[1, 1])
    ex, ey = 0.25 * (plane[0, 0] + plane[2, 0] - plane[1, 0] - plane[3, 0]), 0.25 * (plane[0, 1] + plane[2, 1] - plane[1, 1] - plane[3, 1])
    xi, eta = 0.0, 0.0
    for _ in range(_MAX_NEWTON):
        rx, ry = x - ax - bx * xi - cx * eta - ex * xi * eta, y - ay - by * xi - cy * eta - ey * xi * eta
        jx, jy, kx, ky = bx + ex * eta, by + ey * eta, cx + ex * xi, cy + ey * xi
        det = jx * ky - jy * kx
        d_xi, d_eta = (rx * ky - ry * kx) / det, (jx * ry - jy * rx) / det
        xi += d_xi
        eta += d_eta
        if abs(d_xi) + abs(d_eta) < _STEP:
            break
    xi, eta = min(max(xi, -1.0), 1.0), min(max(eta, -1.0), 1.0)  # round-off, and a corner of more than 180 degrees
    shape[0], shape[1] = 0.25 * (1 - xi) * (1 - eta), 0.25 * (1 + xi) * (1 - eta)
    shape[2], shape[3] = 0.25 * (1 + xi) * (1 + eta), 0.25 * (1 - xi) * (1 + eta)


@njit(cache=True)
def gauss_points(
    slave: IntArray,
    master: IntArray,
    polygon: FloatArray,
    corners: IntArray,
    first: IntArray,
    slave_corners: FloatArray,
    slave_sides: IntArray,
    frame: FloatArray,
    centre: FloatArray,
    master_corners: FloatArray,
    master_sides: IntArray,
    barycentric: FloatArray,
    rule_weights: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Gauss points of the polygons, cut into triangles from their first corner; those of row p are first[p] ... first[p + 1] - 1.

    barycentric (q, 3), rule_weights (q,) of sum 1. Returns, a point a row, the weight [m^2], the gap along the slave's normal [m] and
    the shape functions of both facets, (nq, k), 0 in a triangle's fourth place.
    """
    count = first[-1]
    weight, gap = np.empty(count), np.empty(count)
    phi, psi = np.zeros((count, slave_corners.shape[1])), np.zeros((count, master_corners.shape[1]))
    plane_s, plane_m, low, high = np.empty((4, 2)), np.empty((4, 2)), np.empty(4), np.empty(4)
    for row in range(len(slave)):
        s, m = slave[row], master[row]
        _in_plane(slave_corners[s], slave_sides[s], frame[s], centre[s], plane_s, low)
        _in_plane(master_corners[m], master_sides[m], frame[s], centre[s], plane_m, high)
        at = first[row]
        a = polygon[row, 0]
        for k in range(1, corners[row] - 1):
            b, c = polygon[row, k], polygon[row, k + 1]
            area = 0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
            for g in range(len(rule_weights)):
                x = barycentric[g, 0] * a[0] + barycentric[g, 1] * b[0] + barycentric[g, 2] * c[0]
                y = barycentric[g, 0] * a[1] + barycentric[g, 1] * b[1] + barycentric[g, 2] * c[1]
                _shape_functions(x, y, plane_s, slave_sides[s], phi[at])
                _shape_functions(x, y, plane_m, master_sides[m], psi[at])
                gap[at] = 0.0
                for j in range(master_sides[m]):
                    gap[at] += psi[at, j] * high[j]
                for j in range(slave_sides[s]):
                    gap[at] -= phi[at, j] * low[j]
                weight[at] = rule_weights[g] * area
                at += 1
    return weight, gap, phi, psi


@njit(cache=True)
def mortar_sums(
    row: IntArray, count: int, weight: FloatArray, chi: FloatArray, phi: FloatArray, psi: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Sums over the Gauss points of each of `count` rows: int chi_j (count, j), int chi_j phi_k and int chi_j psi_l (count, j, k)."""
    kc, ks, km = chi.shape[1], phi.shape[1], psi.shape[1]
    share, own, others = np.zeros((count, kc)), np.zeros((count, kc, ks)), np.zeros((count, kc, km))
    for g in range(len(row)):
        p = row[g]
        for j in range(kc):
            w = weight[g] * chi[g, j]
            share[p, j] += w
            for k in range(ks):
                own[p, j, k] += w * phi[g, k]
            for k in range(km):
                others[p, j, k] += w * psi[g, k]
    return share, own, others
