"""What an iteration of the interior point does contact by contact: scaling, right sides, changes, steps to the boundary; compiled.

Points are flat as in `cones`: x, y (nc + k d), the half-lines of all nc contacts first, then the cones of those k in `rough`. V is Nesterov
and Todd's scaling: line (nc,) of the half-lines, axis (k, d) and beta (k,) of the cones, V x = beta (2 axis (axis . x) - J x) with
J x = (x_0, -x_1). The same in NumPy, by `cones` and `pairs`, is the twin in the tests.

Sources: as `cones`; those of the elimination: `newton.systems.velocity`.
"""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit

LEAST_DETERMINANT = 1e-300
"""So that what is as good as on the boundary is not divided by zero."""


@njit(cache=True, error_model="numpy")
def _determinant(x):
    """x_0^2 - ||x_1||^2 of x (d,), as a product."""
    square = 0.0
    for i in range(1, len(x)):
        square += x[i] * x[i]
    norm = np.sqrt(square)
    return max((x[0] - norm) * (x[0] + norm), LEAST_DETERMINANT)


@njit(cache=True, error_model="numpy")
def _times(axis, beta, x, out):
    """out = V x of a cone."""
    along = 0.0
    for i in range(len(x)):
        along += axis[i] * x[i]
    for i in range(len(x)):
        out[i] = beta * (2 * along * axis[i] + x[i])
    out[0] = beta * (2 * along * axis[0] - x[0])


@njit(cache=True, error_model="numpy")
def scaling(x, y, nc, k, d):
    """line, axis, beta of the V with V x = V^-1 y, V x = point, and point o point."""
    line, axis, beta = np.empty(nc), np.empty((k, d)), np.empty(k)
    point, squared = np.empty(len(x)), np.empty(len(x))
    for a in range(nc):
        line[a] = np.sqrt(y[a] / x[a])
        point[a] = line[a] * x[a]
        squared[a] = point[a] * point[a]
    for c in range(k):
        begin = nc + c * d
        X, Y, p, w = x[begin : begin + d], y[begin : begin + d], point[begin : begin + d], axis[c]
        size_x, size_y = np.sqrt(_determinant(X)), np.sqrt(_determinant(Y))
        both = 0.0
        for i in range(d):
            both += X[i] / size_x * (Y[i] / size_y)
        gamma = np.sqrt(max(0.5 * (1 + both), 1.0))  # >= 1 but for round-off
        for i in range(d):
            w[i] = (Y[i] / size_y - X[i] / size_x) / (2 * gamma)
        w[0] = (Y[0] / size_y + X[0] / size_x) / (2 * gamma) + 1
        root = np.sqrt(2 * w[0])
        for i in range(d):
            w[i] /= root
        beta[c] = np.sqrt(size_y / size_x)
        _times(w, beta[c], X, p)
        square = 0.0
        for i in range(d):
            square += p[i] * p[i]
            squared[begin + i] = 2 * p[0] * p[i]
        squared[begin] = square
    return line, axis, beta, point, squared


@njit(cache=True, error_model="numpy")
def equations(line, axis, beta, y, velocity, mu, rough):
    """A and B (nc, d, d) of A du + B dr = ..., which V^-1 dy + V dx = b asks of the contacts, s left out and dr_T = 0 where mu = 0; and
    W r + q - u (nc, d) of velocity = W r + q (nc, d) and the u of y, zero tangentially where mu = 0."""
    nc, d = velocity.shape
    k = len(rough)
    A, B, apart = np.zeros((nc, d, d)), np.zeros((nc, d, d)), np.zeros((nc, d))
    for a in range(nc):
        A[a, 0, 0], B[a, 0, 0], apart[a, 0] = 1.0, line[a] * line[a], velocity[a, 0] - y[a]
        for i in range(1, d):
            B[a, i, i] = 1.0
    square = np.empty((d, d))
    for c in range(k):
        a, w = rough[c], axis[c]
        along = 0.0
        for i in range(d):
            along += w[i] * w[i]
        for i in range(d):  # V^2 = beta^2 (2 w w^T - J)^2 = beta^2 (4 (w . w) w w^T - 2 (w (J w)^T + J w w^T) + 1)
            for j in range(d):
                signs = (1.0 if i == 0 else -1.0) + (1.0 if j == 0 else -1.0)
                square[i, j] = beta[c] ** 2 * w[i] * w[j] * (4 * along - 2 * signs)
            square[i, i] += beta[c] ** 2
        for i in range(1, d):
            A[a, i, i] = 1.0
            B[a, i, 0] = mu[a] * square[i, 0]
            for j in range(1, d):
                B[a, i, j] = square[i, j]
            apart[a, i] = velocity[a, i] - y[nc + c * d + i]
    return A, B, apart


@njit(cache=True, error_model="numpy")
def right_side(line, axis, beta, point, target, share, apart, rough):
    """b with point o b = target, and the contacts' right side (nc, d): V b less a share of what the velocities are apart."""
    nc, d = apart.shape
    b, rhs, scaled = np.empty(len(point)), np.empty((nc, d)), np.empty(d)
    for a in range(nc):
        b[a] = target[a] / point[a]
        rhs[a, 0] = line[a] * b[a] - share * apart[a, 0]
        for i in range(1, d):
            rhs[a, i] = -share * apart[a, i]
    for c in range(len(rough)):
        begin = nc + c * d
        p, t, z = point[begin : begin + d], target[begin : begin + d], b[begin : begin + d]
        first = p[0] * t[0]
        for i in range(1, d):
            first -= p[i] * t[i]
        first /= _determinant(p)
        for i in range(1, d):
            z[i] = (t[i] - first * p[i]) / p[0]
        z[0] = first
        _times(axis[c], beta[c], z, scaled)
        for i in range(1, d):
            rhs[rough[c], i] += scaled[i]
    return b, rhs


@njit(cache=True, error_model="numpy")
def _longest(x, dx, nc, k, d):
    """The largest t <= 1 with x + t dx in the product of cones, as `ConeAlgebra.longest_step`."""
    t = 1.0
    for a in range(nc):
        if dx[a] < 0.0:
            t = min(t, -x[a] / dx[a])
    for c in range(k):
        begin = nc + c * d
        X, D = x[begin : begin + d], dx[begin : begin + d]
        a, b = D[0] * D[0], X[0] * D[0]
        for i in range(1, d):
            a -= D[i] * D[i]
            b -= X[i] * D[i]
        e = _determinant(X)
        within = b * b - a * e
        root = np.sqrt(max(within, 0.0))
        m = -(b + (root if b >= 0.0 else -root))  # the roots of a t^2 + 2 b t + e written so that nothing cancels
        if within >= 0.0:
            if a != 0.0 and m / a > 0.0:
                t = min(t, m / a)
            if m != 0.0 and e / m > 0.0:
                t = min(t, e / m)
        if D[0] < 0.0:
            t = min(t, -X[0] / D[0])
    return t


@njit(cache=True, error_model="numpy")
def changes(line, axis, beta, point, b, dr, mu, rough):
    """V dx and V^-1 dy = b - V dx of a change dr (nc, d) of the reactions, and how far a step may go, at most 1."""
    nc, d = dr.shape
    k = len(rough)
    dx, dy, cone = np.empty(len(point)), np.empty(len(point)), np.empty(d)
    for a in range(nc):
        dx[a] = line[a] * dr[a, 0]
    for c in range(k):
        a, begin = rough[c], nc + c * d
        cone[0] = mu[a] * dr[a, 0]
        for i in range(1, d):
            cone[i] = dr[a, i]
        _times(axis[c], beta[c], cone, dx[begin : begin + d])
    for e in range(len(b)):
        dy[e] = b[e] - dx[e]
    return dx, dy, min(_longest(point, dx, nc, k, d), _longest(point, dy, nc, k, d))


@njit(cache=True, error_model="numpy")
def corrected(squared, dx, dy, centre, tau, second, nc, d):
    """tau centre - squared - second dx o dy: the target of the corrector."""
    target = np.empty(len(squared))
    for e in range(nc):
        target[e] = tau * centre[e] - squared[e] - second * dx[e] * dy[e]
    for begin in range(nc, len(squared), d):
        inner = 0.0
        for i in range(d):
            inner += dx[begin + i] * dy[begin + i]
        target[begin] = tau * centre[begin] - squared[begin] - second * inner
        for e in range(begin + 1, begin + d):
            target[e] = tau * centre[e] - squared[e] - second * (dx[begin] * dy[e] + dy[begin] * dx[e])
    return target


@njit(cache=True, error_model="numpy")
def moved(R, dr, y, dy, t, line, axis, beta, mu, rough):
    """R + t dr (nc, d), its x, y + t V dy, whether both are inside, and x . y."""
    nc, d = R.shape
    new_R, x, new_y, cone = np.empty((nc, d)), np.empty(len(y)), np.empty(len(y)), np.empty(d)
    inside, total = True, 0.0
    for a in range(nc):
        for i in range(d):
            new_R[a, i] = R[a, i] + t * dr[a, i]
        x[a], new_y[a] = new_R[a, 0], y[a] + t * line[a] * dy[a]
        inside = inside and x[a] > 0.0 and new_y[a] > 0.0
        total += x[a] * new_y[a]
    for c in range(len(rough)):
        a, begin = rough[c], nc + c * d
        _times(axis[c], beta[c], dy[begin : begin + d], cone)
        squares_x, squares_y = 0.0, 0.0
        for i in range(d):
            x[begin + i] = mu[a] * new_R[a, 0] if i == 0 else new_R[a, i]
            new_y[begin + i] = y[begin + i] + t * cone[i]
            total += x[begin + i] * new_y[begin + i]
            if i > 0:
                squares_x += x[begin + i] * x[begin + i]
                squares_y += new_y[begin + i] * new_y[begin + i]
        inside = inside and x[begin] > np.sqrt(squares_x) and new_y[begin] > np.sqrt(squares_y)
    return new_R, x, new_y, inside, total


@njit(cache=True, error_model="numpy")
def inverted(A, B, own):
    """C^-1 and K = C^-1 A (nc, d, d), C = A diag(own) + B of each contact, and the first contact whose C is singular or -1."""
    nc, d = own.shape
    inverse, K, rows = np.empty((nc, d, d)), np.empty((nc, d, d)), np.empty((d, 2 * d))
    for a in range(nc):
        for i in range(d):
            for j in range(d):
                rows[i, j] = A[a, i, j] * own[a, j] + B[a, i, j]
                rows[i, d + j] = 1.0 if i == j else 0.0
        for k in range(d):
            pivot = k
            for i in range(k + 1, d):
                if abs(rows[i, k]) > abs(rows[pivot, k]):
                    pivot = i
            if rows[pivot, k] == 0.0:
                return inverse, K, a
            if pivot != k:
                for j in range(2 * d):
                    rows[k, j], rows[pivot, j] = rows[pivot, j], rows[k, j]
            for i in range(k + 1, d):
                factor = rows[i, k] / rows[k, k]
                for j in range(k + 1, 2 * d):
                    rows[i, j] -= factor * rows[k, j]
        for j in range(d, 2 * d):
            for i in range(d - 1, -1, -1):
                total = rows[i, j]
                for e in range(i + 1, d):
                    total -= rows[i, e] * rows[e, j]
                rows[i, j] = total / rows[i, i]
        for i in range(d):
            for j in range(d):
                inverse[a, i, j] = rows[i, d + j]
        for i in range(d):
            for j in range(d):
                total = 0.0
                for e in range(d):
                    total += inverse[a, i, e] * A[a, e, j]
                K[a, i, j] = total
    return inverse, K, -1


@njit(cache=True, error_model="numpy")
def to_bodies(inverse, rhs, unknowns, h, n):
    """c = C^-1 rhs (nc, d) and H c (n,), h (nc, d, k) on the unknowns (nc, k) as in `Bodies`."""
    nc, d, k = h.shape
    c, right = np.empty((nc, d)), np.zeros(n)
    for a in range(nc):
        for i in range(d):
            total = 0.0
            for e in range(d):
                total += inverse[a, i, e] * rhs[a, e]
            c[a, i] = total
        for j in range(k):
            if unknowns[a, j] < 0:
                break
            for i in range(d):
                right[unknowns[a, j]] += h[a, i, j] * c[a, i]
    return c, right


@njit(cache=True, error_model="numpy")
def from_bodies(c, K, dv, unknowns, h):
    """c - K H^T dv (nc, d)."""
    nc, d, k = h.shape
    dr, u = np.empty((nc, d)), np.empty(d)
    for a in range(nc):
        for i in range(d):
            u[i] = 0.0
        for j in range(k):
            if unknowns[a, j] < 0:
                break
            for i in range(d):
                u[i] += h[a, i, j] * dv[unknowns[a, j]]
        for i in range(d):
            total = c[a, i]
            for e in range(d):
                total -= K[a, i, e] * u[e]
            dr[a, i] = total
    return dr


@njit(cache=True, error_model="numpy")
def defect(A, B, Wdr, dr, rhs):
    """rhs - A W dr - B dr (nc, d)."""
    nc, d = dr.shape
    left = np.empty((nc, d))
    for a in range(nc):
        for i in range(d):
            total = rhs[a, i]
            for e in range(d):
                total -= A[a, i, e] * Wdr[a, e] + B[a, i, e] * dr[a, e]
            left[a, i] = total
    return left
