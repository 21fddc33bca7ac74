"""Contacts between exact shapes: balls and capsules with each other, with planes and with cylinders, cylinders with planes."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.contact_detection.exact.solids import Placed, Touch, joined, no_touch, rim_points, touch_of_solids
from fcsim.mesh.exact_shape import across

_PARALLEL = 0.05  # cores whose directions differ by less (sine) touch at the ends of what they share, not at one point


def near_pairs_of(now: Placed, one: IntArray, other: IntArray, alert: float) -> tuple[IntArray, IntArray]:
    """Pairs of solids whose enclosing balls are nearer than alert; of one set with itself (the same array) each pair once."""
    reach = now.solids.radius + now.solids.half
    if not len(one) or not len(other):
        return np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64)
    tree = cKDTree(now.centre[one])
    if one is other:
        i, j = tree.query_pairs(2 * float(reach[one].max()) + alert, output_type="ndarray").reshape(-1, 2).T
    else:
        near = tree.sparse_distance_matrix(
            cKDTree(now.centre[other]), float(reach[one].max() + reach[other].max()) + alert, output_type="ndarray"
        )
        i, j = near["i"], near["j"]
    a, b = one[i], other[j]
    apart = now.centre[a] - now.centre[b]
    close = np.einsum("nd,nd->n", apart, apart) <= (reach[a] + reach[b] + alert) ** 2
    return a[close], b[close]


def rounded_contacts(now: Placed, alert: float) -> Touch:
    """Balls and capsules with each other: where their cores, points or segments, are nearest.

    Segments that cross touch at one point; nearly parallel ones at the ends of what they share, so that a capsule lies still on another.
    """
    round_ = now.solids.of("sphere", "capsule")
    a, b = near_pairs_of(now, round_, round_, alert)
    if not len(a):
        return no_touch(now, now.solids.node.shape[1], now.solids.node.shape[1])
    share_a, share_b = _core_points(now, a, b)
    k = share_a.shape[1]
    a, b, code = np.repeat(a, k), np.repeat(b, k), np.tile(np.arange(k), len(a))
    taken = np.isfinite(share_a.ravel())
    a, b, code, s, t = a[taken], b[taken], code[taken], share_a.ravel()[taken], share_b.ravel()[taken]
    p, q = now.core(a, s), now.core(b, t)
    return _between_balls(now, a, b, p, q, code, alert)


def _between_balls(now: Placed, a: IntArray, b: IntArray, p: FloatArray, q: FloatArray, code: IntArray, alert: float) -> Touch:
    """Balls of the solids' radii around core points p and q; where the two coincide they are pushed apart along the last axis."""
    away = p - q
    distance = np.linalg.norm(away, axis=1)
    normal = np.where(distance[:, None] > 0, away / np.maximum(distance, 1e-300)[:, None], np.eye(p.shape[1])[-1])
    r = now.solids.radius
    touch = touch_of_solids(now, a, b, normal, p - r[a][:, None] * normal, q + r[b][:, None] * normal, code)
    return touch.take(touch.gap <= alert)


def _core_points(now: Placed, a: IntArray, b: IntArray) -> tuple[FloatArray, FloatArray]:
    """Shares (n, 5) in -1 ... 1 along the cores of a and b of the points that may touch, NaN where there is none.

    Columns: the middle of a where it is a point, or its ends; the ends of b; the inner points of both that are nearest. A foot of an end
    counts where the distance does not shrink towards the inside; two ends that are each other's feet are one contact.
    """
    half_a, half_b = now.solids.half[a], now.solids.half[b]
    u, v, apart = now.along[a], now.along[b], now.centre[a] - now.centre[b]
    cosine, n = np.einsum("nd,nd->n", u, v), len(a)
    along_a, along_b = np.einsum("nd,nd->n", apart, u), np.einsum("nd,nd->n", apart, v)
    s, t = np.full((n, 5), np.nan), np.full((n, 5), np.nan)  # [m] from the centres
    for c, sign in enumerate((-1.0, 1.0)):
        s[:, c], t[:, 2 + c] = sign * half_a, sign * half_b
        t[:, c] = np.clip(along_b + cosine * s[:, c], -half_b, half_b)
        s[:, 2 + c] = np.clip(cosine * t[:, 2 + c] - along_a, -half_a, half_a)
    away = apart[:, None] + s[..., None] * u[:, None] - t[..., None] * v[:, None]
    distance = np.maximum(np.linalg.norm(away, axis=2), 1e-300)
    grows = [-np.einsum("nd,nd->n", away[:, c], u) * sign / distance[:, c] for c, sign in ((0, -1.0), (1, 1.0))]
    grows += [np.einsum("nd,nd->n", away[:, c], v) * sign / distance[:, c] for c, sign in ((2, -1.0), (3, 1.0))]
    points = [half_a == 0, half_a == 0, half_b == 0, half_b == 0]
    for c in range(4):
        drop = np.where(points[c], c % 2 == 1, grows[c] < -_PARALLEL)
        s[drop, c] = np.nan
    for c in (2, 3):  # an end of b whose foot is an end of a was found from a
        met = np.isclose(np.abs(s[:, c]), half_a, rtol=0, atol=1e-12) & _found_from_a(s, t, c)
        s[met, c] = np.nan
    crossing = (1 - cosine**2 > _PARALLEL**2) & (half_a > 0) & (half_b > 0)
    square = np.where(crossing, 1 - cosine**2, 1.0)
    inner_s, inner_t = (cosine * along_b - along_a) / square, (along_b - cosine * along_a) / square
    crossing &= (np.abs(inner_s) < half_a) & (np.abs(inner_t) < half_b)
    s[:, 4], t[:, 4] = np.where(crossing, inner_s, np.nan), inner_t
    scale_a, scale_b = np.where(half_a > 0, half_a, 1.0)[:, None], np.where(half_b > 0, half_b, 1.0)[:, None]
    return s / scale_a, t / scale_b


def _found_from_a(s: FloatArray, t: FloatArray, c: int) -> BoolArray:
    """Whether one of a's ends has the end of b in column c as its foot."""
    return np.any((s[:, :2] == s[:, c : c + 1]) & np.isclose(t[:, :2], t[:, c : c + 1], rtol=0, atol=1e-12), axis=1)


def on_planes(now: Placed, alert: float) -> Touch:
    """Balls, capsules (both ends) and cylinders (three points of each rim, the lowest first) on planes."""
    found = []
    planes = now.solids.of("plane")
    for round_, shares in ((now.solids.of("sphere"), (0.0,)), (now.solids.of("capsule"), (-1.0, 1.0))):
        if not len(round_) or not len(planes):
            continue
        a, b = (x.ravel() for x in np.meshgrid(round_, planes, indexing="ij"))
        for code, share in enumerate(shares):
            normal = now.along[b]
            point = now.core(a, share) - now.solids.radius[a][:, None] * normal
            found.append(_on_plane(now, a, b, point, code, alert))
    cylinders = now.solids.of("cylinder")
    if len(cylinders) and len(planes):
        a, b = (x.ravel() for x in np.meshgrid(cylinders, planes, indexing="ij"))
        for end, share in enumerate((-1.0, 1.0)):
            points = rim_points(now, a, share, now.along[b])
            found += [_on_plane(now, a, b, points[:, third], 3 * end + third, alert) for third in range(3)]
    return joined(found) if found else no_touch(now, now.solids.node.shape[1], now.solids.node.shape[1])


def _on_plane(now: Placed, a: IntArray, b: IntArray, point: FloatArray, code: int, alert: float) -> Touch:
    normal = now.along[b]
    height = np.einsum("nd,nd->n", point - now.centre[b], normal)
    near = height <= alert
    foot = point - height[:, None] * normal
    return touch_of_solids(now, a[near], b[near], normal[near], point[near], foot[near], np.full(np.count_nonzero(near), code))


def balls_on_cylinders(now: Placed, alert: float) -> Touch:
    """Balls, and the half balls at capsules' ends, on a cylinder's side, rim or end: at the point of the solid cylinder nearest to the
    ball's centre."""
    cylinders = now.solids.of("cylinder")
    pairs = [near_pairs_of(now, now.solids.of(kind), cylinders, alert) for kind in ("sphere", "capsule", "capsule")]
    a, b = (np.concatenate(part) for part in zip(*pairs, strict=True))
    if not len(a):
        return no_touch(now, now.solids.node.shape[1], now.solids.node.shape[1])
    share = np.repeat([0.0, -1.0, 1.0], [len(one) for one, _ in pairs])
    centre = now.core(a, share)
    axis, arm = now.along[b], centre - now.centre[b]
    height = np.einsum("nd,nd->n", arm, axis)
    out = arm - height[:, None] * axis
    distance = np.linalg.norm(out, axis=1)
    outwards = np.where(distance[:, None] > 0, out / np.maximum(distance, 1e-300)[:, None], across(axis)[0])
    r, half = now.solids.radius[b], now.solids.half[b]
    inside = (distance < r) & (np.abs(height) < half)
    side = inside & (r - distance <= half - np.abs(height))
    z = np.where(inside & ~side, np.where(height < 0, -half, half), np.clip(height, -half, half))
    rho = np.where(side, r, np.minimum(distance, r))
    foot = now.centre[b] + z[:, None] * axis + rho[:, None] * outwards
    away = np.where(inside[:, None], foot - centre, centre - foot)
    length = np.linalg.norm(away, axis=1)
    normal = np.where(length[:, None] > 0, away / np.maximum(length, 1e-300)[:, None], outwards)
    touch = touch_of_solids(now, a, b, normal, centre - now.solids.radius[a][:, None] * normal, foot, (share > 0).astype(np.int64))
    return touch.take(touch.gap <= alert)
