"""Feet of points on bilinear quadrilaterals, compiled."""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit

EDGE = 1e-9  # parameters closer to an edge than this are on it, whichever side round-off puts them
_MAX_NEWTON = 25
_STEP = 1e-8  # Newton's error is the square of its last step
_FAR = 2.0  # an iterate is kept within [-2, 2]^2: farther out only "outside" matters, and the bilinear map may fold


@njit(cache=True, nogil=True)
def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True, nogil=True, error_model="numpy")
def closest_on_quadrilaterals(points, corners):
    """Shape functions (n, 4), unit normals (n, 3) and whether the foot is inside (n,), see `project_on_quadrilaterals`."""
    n = len(points)
    weights, normals, inside = np.empty((n, 4)), np.empty((n, 3)), np.empty(n, dtype=np.bool_)
    b, c, e, p = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    for k in range(n):
        corner, normal = corners[k], normals[k]
        for i in range(3):
            x0, x1, x2, x3 = corner[0, i], corner[1, i], corner[2, i], corner[3, i]
            p[i] = points[k, i] - 0.25 * (x0 + x1 + x2 + x3)
            b[i] = 0.25 * ((x1 + x2) - (x0 + x3))
            c[i] = 0.25 * ((x2 + x3) - (x0 + x1))
            e[i] = 0.25 * ((x0 + x2) - (x1 + x3))
        bb, cc, ee, bc, be, ce = _dot(b, b), _dot(c, c), _dot(e, e), _dot(b, c), _dot(b, e), _dot(c, e)
        pb, pc, pe = _dot(p, b), _dot(p, c), _dot(p, e)
        s, t, converged = 0.0, 0.0, False
        for _ in range(_MAX_NEWTON):
            st = s * t
            g_e = be * s + ce * t + ee * st - pe  # (x - p) . e
            g_s = bb * s + bc * t + be * st - pb + t * g_e  # gradient: (x - p) . dx/dxi
            g_t = bc * s + cc * t + ce * st - pc + s * g_e
            h_ss, h_tt = bb + t * (2 * be + t * ee), cc + s * (2 * ce + s * ee)
            h_st = bc + be * s + ce * t + ee * st
            gram = h_ss * h_tt - h_st**2
            full = h_st + g_e
            det = h_ss * h_tt - full**2
            # the point is farther than the facet's radius of curvature: the Hessian is indefinite, Gauss-Newton still descends
            if det > 0.1 * gram:
                h_st = full
            else:
                det = gram
            det = max(det, 1e-12 * bb * cc)
            s_new = min(max(s - (h_tt * g_s - h_st * g_t) / det, -_FAR), _FAR)
            t_new = min(max(t - (h_ss * g_t - h_st * g_s) / det, -_FAR), _FAR)
            converged = max(abs(s_new - s), abs(t_new - t)) <= _STEP
            s, t = s_new, t_new
            if converged:
                break
        inside[k] = converged and max(abs(s), abs(t)) < 1.0 - EDGE
        s, t = min(max(s, -1.0), 1.0), min(max(t, -1.0), 1.0)
        weights[k, 0] = 0.25 * ((1 - s) * (1 - t))
        weights[k, 1] = 0.25 * ((1 + s) * (1 - t))
        weights[k, 2] = 0.25 * ((1 + s) * (1 + t))
        weights[k, 3] = 0.25 * ((1 - s) * (1 + t))
        u0, u1, u2 = b[0] + e[0] * t, b[1] + e[1] * t, b[2] + e[2] * t
        v0, v1, v2 = c[0] + e[0] * s, c[1] + e[1] * s, c[2] + e[2] * s
        normal[0], normal[1], normal[2] = u1 * v2 - u2 * v1, u2 * v0 - u0 * v2, u0 * v1 - u1 * v0
        length = np.sqrt(_dot(normal, normal))
        for i in range(3):
            normal[i] /= length
    return weights, normals, inside
