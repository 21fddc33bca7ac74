"""Rims of cylinders that cross in space: neither on a side nor flat on an end of the other.

Points p(alpha) and q(beta) of two circles whose distance is stationary lie on their common normal N, along the tangents' cross product.
It is a contact where N lies in both normal cones, between each rim's radius and the end's normal: by convexity the plane across N then
parts the cylinders, and the gap (p - q) . N is their distance. Of overlapping ones the middle of p and q is in both.
"""

from __future__ import annotations

import numpy as np

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.contact_detection.exact.solids import Placed, Touch, touch_of_solids
from fcsim.mesh.exact_shape import across

_PARALLEL = 1e-3  # sine between tangents, and between axes, below which other rules hold
_SAMPLES, _NEWTON = 48, 8
_ROUND = 1e-9
_DEEP = 0.5  # of the smaller radius


def rims_in_space(now: Placed, a: IntArray, b: IntArray, alert: float) -> Touch:
    """Contacts of the rims of the cylinders a with those of b (n,), up to a gap of `alert` [m]; at most eight a pair."""
    tilted = np.linalg.norm(np.cross(now.along[a], now.along[b]), axis=1) > _PARALLEL
    ends = np.array([(i, j) for i in (-1.0, 1.0) for j in (-1.0, 1.0)])
    count = int(np.count_nonzero(tilted))
    a, b = np.repeat(a[tilted], 4), np.repeat(b[tilted], 4)
    end_a, end_b = np.tile(ends, (count, 1)).T
    r = now.solids.radius
    apart = now.core(a, end_a) - now.core(b, end_b)
    near = np.linalg.norm(apart, axis=1) <= r[a] + r[b] + alert
    near &= _to_plane(apart, now.along[b], now.along[a], r[a]) <= alert
    near &= _to_plane(apart, now.along[a], now.along[b], r[b]) <= alert
    a, b, end_a, end_b = a[near], b[near], end_a[near], end_b[near]
    row, alpha, beta = _nearest(now, a, b, end_a, end_b)
    a, b, end_a, end_b = a[row], b[row], end_a[row], end_b[row]
    p, out_a, tangent_a = on_rim(now, a, end_a, alpha)
    q, out_b, tangent_b = on_rim(now, b, end_b, beta)
    N = np.cross(tangent_a, tangent_b)
    sine = np.linalg.norm(N, axis=1)
    N = N / np.maximum(sine, 1e-300)[:, None]
    normal_a, normal_b = end_a[:, None] * now.along[a], end_b[:, None] * now.along[b]
    N = np.where(np.einsum("nd,nd->n", N, out_b + normal_b) < 0, -1.0, 1.0)[:, None] * N
    gap = np.einsum("nd,nd->n", p - q, N)
    keep = (sine > _PARALLEL) & (gap <= alert) & (gap > -_DEEP * np.minimum(r[a], r[b]))
    keep &= np.abs(np.linalg.norm(p - q, axis=1) - np.abs(gap)) <= 1e-6 * (r[a] + r[b])  # Newton's method has arrived
    for direction, sign in ((out_a, -1), (normal_a, -1), (out_b, 1), (normal_b, 1)):
        keep &= sign * np.einsum("nd,nd->n", N, direction) >= -_ROUND
    middle = 0.5 * (p + q)
    keep &= (gap >= -_ROUND * (r[a] + r[b])) | (within(now, a, middle) & within(now, b, middle))
    side = np.einsum("nd,nd->n", out_a, np.cross(now.along[a], now.along[b])) > 0  # the two are mirrored about the plane of both axes
    code = (4 * (end_a > 0) + 2 * (end_b > 0) + side).astype(np.int64)
    touch = touch_of_solids(*(now, a[keep], b[keep], N[keep], p[keep], q[keep], code[keep]))
    nearest = np.argsort(np.abs(touch.gap), kind="stable")
    return touch.take(nearest[np.unique(touch.identity[nearest], return_index=True)[1]])


def _to_plane(apart: FloatArray, normal: FloatArray, axis: FloatArray, radius: FloatArray) -> FloatArray:
    """How far (n,) [m] a circle about `axis`, its centre `apart` from a plane's point, stays off the plane with this normal."""
    rise = np.sqrt(np.maximum(1 - np.einsum("nd,nd->n", axis, normal) ** 2, 0.0))
    distance: FloatArray = np.abs(np.einsum("nd,nd->n", apart, normal)) - radius * rise
    return distance


def on_rim(now: Placed, solid: IntArray, end: FloatArray, angle: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Points (n, 3) of rims at angles (n,), the radii's directions there and the tangents."""
    first, second = across(now.along[solid])
    c, s = np.cos(angle)[:, None], np.sin(angle)[:, None]
    out = c * first + s * second
    return now.core(solid, end) + now.solids.radius[solid][:, None] * out, out, c * second - s * first


def _nearest(now: Placed, a: IntArray, b: IntArray, end_a: FloatArray, end_b: FloatArray) -> tuple[IntArray, FloatArray, FloatArray]:
    """Rows and angles on both rims where their distance is least nearby: samples of a nearest to the circle of b, then Newton's method."""
    n, r = len(a), now.solids.radius
    if not n:
        return np.empty(0, dtype=np.int64), np.empty(0), np.empty(0)
    angle = 2 * np.pi * np.arange(_SAMPLES) / _SAMPLES
    rows = np.repeat(np.arange(n), _SAMPLES)
    p, _, _ = on_rim(now, a[rows], end_a[rows], np.tile(angle, n))
    first, second = across(now.along[b])
    arm = (p - now.core(b, end_b)[rows]).reshape(n, _SAMPLES, 3)
    x, y, z = (np.einsum("nkd,nd->nk", arm, direction) for direction in (first, second, now.along[b]))
    distance = np.hypot(np.hypot(x, y) - r[b][:, None], z)
    row, sample = np.nonzero((distance <= np.roll(distance, 1, axis=1)) & (distance < np.roll(distance, -1, axis=1)))
    alpha, beta = angle[sample], np.arctan2(y[row, sample], x[row, sample])
    a, b, end_a, end_b = a[row], b[row], end_a[row], end_b[row]
    ra, rb = r[a], r[b]
    for _ in range(_NEWTON):  # on half the squared distance's derivatives by both angles, tangents turned by radii
        p, out_a, ta = on_rim(now, a, end_a, alpha)
        q, out_b, tb = on_rim(now, b, end_b, beta)
        away = p - q
        f, g = ra * np.einsum("nd,nd->n", away, ta), -rb * np.einsum("nd,nd->n", away, tb)
        faa = ra**2 - ra * np.einsum("nd,nd->n", away, out_a)
        fbb = rb**2 + rb * np.einsum("nd,nd->n", away, out_b)
        fab = -ra * rb * np.einsum("nd,nd->n", ta, tb)
        det = faa * fbb - fab**2
        det = np.where(np.abs(det) > 1e-12 * (ra * rb) ** 2, det, np.inf)
        alpha = alpha - np.clip((fbb * f - fab * g) / det, -0.2, 0.2)
        beta = beta - np.clip((faa * g - fab * f) / det, -0.2, 0.2)
    return row, alpha, beta


def within(now: Placed, solid: IntArray, point: FloatArray) -> BoolArray:
    """Whether points (n, 3) lie in cylinders."""
    arm, axis = point - now.centre[solid], now.along[solid]
    height = np.einsum("nd,nd->n", arm, axis)
    distance = np.linalg.norm(arm - height[:, None] * axis, axis=1)
    inside: BoolArray = (np.abs(height) <= now.solids.half[solid]) & (distance <= now.solids.radius[solid])
    return inside
