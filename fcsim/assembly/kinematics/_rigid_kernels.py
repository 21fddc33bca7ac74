"""Finite rotations and the motion of rigid bodies' points, compiled: SciPy and NumPy take some 0.1 ms a call, whatever the number."""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import math

import numpy as np
from numba import njit

_SMALL = 1e-4
"""Angle [rad] below which the next term of the series is below round-off."""


@njit(cache=True)
def rotation_matrices(vectors):
    """R = I + sin(t)/t [a]x + (1 - cos(t))/t^2 [a]x^2 (n, 3, 3) of the rotation vectors a (n, 3), t = ||a|| (Rodrigues' formula)."""
    R = np.empty((len(vectors), 3, 3))
    for a in range(len(vectors)):
        x, y, z = vectors[a, 0], vectors[a, 1], vectors[a, 2]
        square = x * x + y * y + z * z
        t = math.sqrt(square)
        if t < _SMALL:
            first, second = 1 - square / 6, 0.5 - square / 24
        else:
            first, second = math.sin(t) / t, 2 * (math.sin(0.5 * t) / t) ** 2
        R[a, 0, 0], R[a, 1, 1], R[a, 2, 2] = 1 - second * (y * y + z * z), 1 - second * (x * x + z * z), 1 - second * (x * x + y * y)
        R[a, 0, 1], R[a, 1, 0] = second * x * y - first * z, second * x * y + first * z
        R[a, 0, 2], R[a, 2, 0] = second * x * z + first * y, second * x * z - first * y
        R[a, 1, 2], R[a, 2, 1] = second * y * z - first * x, second * y * z + first * x
    return R


@njit(cache=True)
def _quaternion(vector):
    """(w, x, y, z) of a rotation vector (3,)."""
    t = math.sqrt(vector[0] ** 2 + vector[1] ** 2 + vector[2] ** 2)
    factor = 0.5 - t * t / 48 if t < _SMALL else math.sin(0.5 * t) / t
    return math.cos(0.5 * t), factor * vector[0], factor * vector[1], factor * vector[2]


@njit(cache=True)
def composed_vectors(last, first):
    """Rotation vectors (n, 3), at most pi long, of the rotation by `first` and then by `last` (n, 3): the product of their quaternions."""
    composed = np.empty((len(last), 3))
    for a in range(len(last)):
        w, x, y, z = _quaternion(last[a])
        s, u, v, t = _quaternion(first[a])
        real = w * s - x * u - y * v - z * t
        i, j, k = w * u + x * s + y * t - z * v, w * v - x * t + y * s + z * u, w * t + x * v - y * u + z * s
        if real < 0:  # the same rotation, the short way
            real, i, j, k = -real, -i, -j, -k
        size = math.sqrt(i * i + j * j + k * k)
        factor = 2 + size * size / 3 if size < _SMALL else 2 * math.atan2(size, real) / size
        composed[a, 0], composed[a, 1], composed[a, 2] = factor * i, factor * j, factor * k
    return composed


@njit(cache=True)
def turned_arms(R, body, arm):
    """R arm (np, d) of each point, R (nr, d, d) the rotation of its body."""
    turned = np.empty_like(arm)
    d = arm.shape[1]
    for p in range(len(arm)):
        b = body[p]
        for i in range(d):
            s = R[b, i, 0] * arm[p, 0]
            for j in range(1, d):
                s += R[b, i, j] * arm[p, j]
            turned[p, i] = s
    return turned


@njit(cache=True)
def point_velocities(v, body, arm):
    """v + omega x arm (np, d) for the bodies' velocities v (nr, k) and the points' turned arms (np, d)."""
    velocity = np.empty_like(arm)
    for p in range(len(arm)):
        b = body[p]
        if arm.shape[1] == 2:
            velocity[p, 0], velocity[p, 1] = v[b, 0] - v[b, 2] * arm[p, 1], v[b, 1] + v[b, 2] * arm[p, 0]
        else:
            x, y, z = arm[p, 0], arm[p, 1], arm[p, 2]
            velocity[p, 0] = v[b, 0] + (v[b, 4] * z - v[b, 5] * y)
            velocity[p, 1] = v[b, 1] + (v[b, 5] * x - v[b, 3] * z)
            velocity[p, 2] = v[b, 2] + (v[b, 3] * y - v[b, 4] * x)
    return velocity


@njit(cache=True)
def bodies_of_columns(indptr, rows, ordered, split, d, body, count):
    """How many entries below `split`, and how many rigid bodies, each column (m,) of a nodal matrix has; see `on_bodies`. ordered: whether
    rows ascend in each column."""
    m = len(indptr) - 1
    elastic, bodies = np.zeros(m, dtype=np.int64), np.zeros(m, dtype=np.int64)
    seen = np.full(count, -1)
    for j in range(m):
        below = indptr[j + 1] - indptr[j]
        if below and not (ordered and rows[indptr[j + 1] - 1] < split):
            below = 0
            for e in range(indptr[j], indptr[j + 1]):
                below += rows[e] < split
        elastic[j] = below
        if below == indptr[j + 1] - indptr[j]:
            continue
        for e in range(indptr[j], indptr[j + 1]):
            if rows[e] >= split and seen[body[(rows[e] - split) // d]] != j:
                seen[body[(rows[e] - split) // d]] = j
                bodies[j] += 1
    return elastic, bodies


@njit(cache=True)
def on_bodies(indptr, rows, data, split, body, arm, k, count, elastic, starts, new_rows, values):
    """Write the columns B^T G of a nodal matrix G (d n_nodes, m) by columns, B the nodes' velocities by those of all dofs: rows below
    `split` as they are, those of a point at p of a rigid body b as (g, (p - c) x g) in its k rows from split + k b on.

    body (np,), arm (np, d): of the rigid bodies' points, p - c; count: rigid bodies; elastic (m,): entries below `split`; starts (m + 1,):
    of the columns written.
    """
    d = arm.shape[1]
    place = np.full(count, -1)
    for j in range(len(indptr) - 1):
        at = begin = starts[j]
        first = indptr[j]
        if elastic[j] == indptr[j + 1] - first:
            for e in range(elastic[j]):
                new_rows[np.uint64(begin + e)] = rows[np.uint64(first + e)]
            for e in range(elastic[j]):
                values[np.uint64(begin + e)] = data[np.uint64(first + e)]
            continue
        for e in range(indptr[j], indptr[j + 1]):
            row, g = rows[e], data[e]
            if row < split:
                new_rows[at], values[at] = row, g
                at += 1
                continue
            p, i = (row - split) // d, (row - split) % d
            b = body[p]
            if place[b] < begin:  # of an earlier column
                place[b] = at
                for c in range(k):
                    new_rows[at], values[at] = split + k * b + c, 0.0
                    at += 1
            own = place[b]
            values[own + i] += g
            if d == 2:
                values[own + 2] += arm[p, 0] * g if i == 1 else -arm[p, 1] * g
            else:
                after, last = (i + 1) % 3, (i + 2) % 3  # of (p - c) x g e_i
                values[own + 3 + after] += arm[p, last] * g
                values[own + 3 + last] -= arm[p, after] * g


@njit(cache=True)
def rows_of_blocks(blocks, free, eliminated):
    """diag(blocks) for blocks (n, k, k) by compressed rows (indptr, indices, data) without zeros: of the free dofs (n, k) alone where the
    others are eliminated, else with rows of the identity for these."""
    n, k = free.shape
    size = int(free.sum()) if eliminated else n * k
    indptr = np.zeros(size + 1, dtype=np.int64)
    indices, data = np.empty(n * k * k, dtype=np.int64), np.empty(n * k * k)
    number = np.empty(k, dtype=np.int64)
    row, first, stored = 0, 0, 0
    for a in range(n):
        for i in range(k):
            number[i] = first
            first += 1 if free[a, i] or not eliminated else 0
        for i in range(k):
            if free[a, i]:
                for j in range(k):
                    if free[a, j] and blocks[a, i, j] != 0.0:
                        indices[stored], data[stored] = number[j], blocks[a, i, j]
                        stored += 1
            elif not eliminated:
                indices[stored], data[stored] = number[i], 1.0
                stored += 1
            else:
                continue
            row += 1
            indptr[row] = stored
    return indptr, indices[:stored].copy(), data[:stored].copy()
