"""Cylinders with each other and with capsules: sides across sides, rims on sides, ends on ends, rims across rims.

Two cylinders that cross touch at one point of their sides. Elsewhere a rim of one touches: along the other's side, where the rim is nearest
to its axis (a cylinder lies on another by its two rims, or by one of either; it stands on it by two points of one rim), or flat on its
end, by three points of the rim, the lowest first, and where the rims cross. A rim touches in the directions between its radius and its
axis only. Rims that cross in space: see `rims`.
"""

from __future__ import annotations

import numpy as np

from fcsim.arrays import FloatArray, IntArray
from fcsim.contact_detection.exact.pairs import near_pairs_of
from fcsim.contact_detection.exact.rims import rims_in_space
from fcsim.contact_detection.exact.solids import Placed, Touch, joined, leaves_by_its_side, no_touch, rim_points, touch_of_solids
from fcsim.mesh.exact_shape import across

_PARALLEL = 0.05  # sine between axes below which sides touch at the ends of what they share
_CONE = 0.05  # sine by which the normal may leave the directions in which a rim touches
_LEVEL = 1e-3  # sine between ends that lie flat on each other
_ROUND = 1e-9  # of a radius or length
_SAMPLES, _NEWTON = 24, 6
_DEEP = 0.5  # of the smaller radius: what lies deeper is another part


def cylinders_with_cylinders(now: Placed, alert: float) -> Touch:
    """All contacts of cylinders with each other and with capsules; the capsules' ends are in `balls_on_cylinders`."""
    cylinders, capsules = now.solids.of("cylinder"), now.solids.of("capsule")
    among = near_pairs_of(now, cylinders, cylinders, alert)
    mixed = near_pairs_of(now, cylinders, capsules, alert)
    if not len(among[0]) and not len(mixed[0]):  # most looks of most scenes: none of what follows is free for no pairs
        return no_touch(now, now.solids.node.shape[1], now.solids.node.shape[1])
    a, b = np.concatenate([among[0], among[1]]), np.concatenate([among[1], among[0]])
    found = [
        _crossing_sides(now, np.concatenate([among[0], mixed[0]]), np.concatenate([among[1], mixed[1]]), alert),
        _rims_on_sides(now, np.concatenate([a, mixed[0]]), np.concatenate([b, mixed[1]]), alert),
        _rims_on_ends(now, a, b, alert),
        _rims_across_rims(now, among[0], among[1], alert),
        rims_in_space(now, among[0], among[1], alert),
    ]
    return joined(
        [touch._replace(identity=touch.identity + (kind << 52)) for kind, touch in enumerate(found)]  # codes of each within a pair
    )


def _crossing_sides(now: Placed, a: IntArray, b: IntArray, alert: float) -> Touch:
    """Where the axes are nearest, within both."""
    s_ = now.solids
    u, v, apart = now.along[a], now.along[b], now.centre[a] - now.centre[b]
    cosine, along_a, along_b = (np.einsum("nd,nd->n", *pair) for pair in ((u, v), (apart, u), (apart, v)))
    square = 1 - cosine**2
    safe = np.where(square > _PARALLEL**2, square, 1.0)
    s, t = (cosine * along_b - along_a) / safe, (along_b - cosine * along_a) / safe
    away = apart + s[:, None] * u - t[:, None] * v
    distance = np.linalg.norm(away, axis=1)
    keep = (square > _PARALLEL**2) & (np.abs(s) < s_.half[a]) & (np.abs(t) < s_.half[b]) & (distance > 0)
    gap = distance - s_.radius[a] - s_.radius[b]
    keep &= (gap <= alert) & leaves_by_its_side(now, a, s, gap) & leaves_by_its_side(now, b, t, gap)
    a, b, s, t, normal = a[keep], b[keep], s[keep], t[keep], (away / np.maximum(distance, 1e-300)[:, None])[keep]
    p = now.centre[a] + s[:, None] * u[keep] - s_.radius[a][:, None] * normal
    q = now.centre[b] + t[:, None] * v[keep] + s_.radius[b][:, None] * normal
    return touch_of_solids(now, a, b, normal, p, q, np.zeros(len(a), dtype=np.int64))


def _nearest_on_rim(now: Placed, a: IntArray, b: IntArray, end: float) -> list[tuple[FloatArray, FloatArray]]:
    """Points (n, 3) of the rims of a nearest to the axes of b, and the rims' radii's directions (n, 3) there; then the same of the other
    places where the distance is least nearby, a second end of the chord where a stands on b's side (the first, where there is none)."""
    first, second = across(now.along[a])
    axis, arm = now.along[b], now.core(a, end) - now.centre[b]
    radius = now.solids.radius[a]

    def off(x: FloatArray) -> FloatArray:
        return x - np.einsum("n...d,nd->n...", x, axis)[..., None] * axis.reshape(len(axis), *(1,) * (x.ndim - 2), 3)

    e, f, g = off(arm), off(first), off(second)
    angle = 2 * np.pi * np.arange(_SAMPLES) / _SAMPLES
    place = e[:, None] + radius[:, None, None] * (np.cos(angle)[:, None] * f[:, None] + np.sin(angle)[:, None] * g[:, None])
    square = np.einsum("nkd,nkd->nk", place, place)
    nearest = np.argmin(square, axis=1) if len(a) else np.empty(0, dtype=np.int64)
    least = (square <= np.roll(square, 1, axis=1)) & (square < np.roll(square, -1, axis=1))
    apart = np.abs((np.arange(_SAMPLES) - nearest[:, None] + _SAMPLES // 2) % _SAMPLES - _SAMPLES // 2)
    others = np.where(least & (apart > 2), square, np.inf)
    other = np.where(np.isfinite(others).any(axis=1), np.argmin(others, axis=1), nearest) if len(a) else nearest
    found = []
    for best in (angle[nearest], angle[other]):
        for _ in range(_NEWTON):  # on the derivative of the squared distance; steps no longer than a sample
            c, s = np.cos(best)[:, None], np.sin(best)[:, None]
            x, dx, ddx = e + radius[:, None] * (c * f + s * g), radius[:, None] * (c * g - s * f), -radius[:, None] * (c * f + s * g)
            slope = np.einsum("nd,nd->n", x, dx)
            bend = np.einsum("nd,nd->n", dx, dx) + np.einsum("nd,nd->n", x, ddx)
            best = best - np.clip(slope / np.where(bend > 1e-12 * radius**2, bend, np.inf), -np.pi / _SAMPLES, np.pi / _SAMPLES)
        out = np.cos(best)[:, None] * first + np.sin(best)[:, None] * second
        found.append((now.core(a, end) + radius[:, None] * out, out))
    return found


def _rims_on_sides(now: Placed, a: IntArray, b: IntArray, alert: float) -> Touch:
    """Both rims of the cylinders a on the sides of b; where rim meets rim once, of the solid of the lower number. Two points of a rim are
    told apart by which way along b their radius goes; of one side only the nearest counts."""
    found = []
    s_ = now.solids
    rims = [(end, *place) for end in (-1.0, 1.0) for place in _nearest_on_rim(now, a, b, end)]
    sides = [np.einsum("nd,nd->n", out, now.along[b]) > _CONE for _, _, out in rims]
    for k, (end, point, out) in enumerate(rims):
        arm = point - now.centre[b]
        t = np.einsum("nd,nd->n", arm, now.along[b])
        away = arm - t[:, None] * now.along[b]
        distance = np.linalg.norm(away, axis=1)
        normal = away / np.maximum(distance, 1e-300)[:, None]
        limit = s_.half[b] * np.where(a < b, 1 + _ROUND, 1 - _ROUND)
        gap = distance - s_.radius[b]
        keep = (np.abs(t) <= limit) & (gap <= alert) & (gap > -_DEEP * np.minimum(s_.radius[a], s_.radius[b]))
        keep &= np.einsum("nd,nd->n", normal, end * now.along[a]) <= _CONE
        flush = end * np.sign(t) * np.einsum("nd,nd->n", now.along[a], now.along[b]) > 0  # this end does not look at that of b
        keep &= (np.einsum("nd,nd->n", normal, out) <= _CONE) & (flush | leaves_by_its_side(now, b, t, gap))
        if k % 2:
            keep &= sides[k] != sides[k - 1]
        foot = point - gap[:, None] * normal
        code = k // 2 + 2 * sides[k][keep].astype(np.int64)
        found.append(touch_of_solids(now, a[keep], b[keep], normal[keep], point[keep], foot[keep], code))
    return joined(found)


def _facing_ends(now: Placed, a: IntArray, b: IntArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The ends (n,) of a and of b that look at each other, and the outward normals (n, 3) of those of b."""
    apart = now.centre[a] - now.centre[b]
    of_b = np.where(np.einsum("nd,nd->n", apart, now.along[b]) < 0, -1.0, 1.0)
    normal = of_b[:, None] * now.along[b]
    of_a = np.where(np.einsum("nd,nd->n", normal, now.along[a]) > 0, -1.0, 1.0)
    return of_a, of_b, normal


def _rims_on_ends(now: Placed, a: IntArray, b: IntArray, alert: float) -> Touch:
    """Three points of the rims of a within the ends of b."""
    of_a, of_b, normal = _facing_ends(now, a, b)
    found = []
    s_ = now.solids
    points = rim_points(now, a, of_a, normal)
    centre = now.core(b, of_b)
    in_front = np.einsum("nd,nd->n", now.centre[a] - centre, normal) > 0
    for code in range(3):
        arm = points[:, code] - centre
        height = np.einsum("nd,nd->n", arm, normal)
        foot = arm - height[:, None] * normal
        inside = np.linalg.norm(foot, axis=1) <= s_.radius[b] * np.where(a < b, 1 + _ROUND, 1 - _ROUND)
        keep = in_front & inside & (height <= alert) & (height > -_DEEP * np.minimum(s_.radius[a], s_.radius[b]))
        code_ = np.full(np.count_nonzero(keep), code)
        found.append(touch_of_solids(now, a[keep], b[keep], normal[keep], points[keep, code], (centre + foot)[keep], code_))
    return joined(found)


def _rims_across_rims(now: Placed, a: IntArray, b: IntArray, alert: float) -> Touch:
    """Where the circles of two ends that lie flat on each other cross."""
    of_a, of_b, normal = _facing_ends(now, a, b)
    s_ = now.solids
    level = np.linalg.norm(np.cross(now.along[a], now.along[b]), axis=1) < _LEVEL
    centre, arm = now.core(b, of_b), now.core(a, of_a) - now.core(b, of_b)
    height = np.einsum("nd,nd->n", arm, normal)
    aside = arm - height[:, None] * normal
    d, ra, rb = np.linalg.norm(aside, axis=1), s_.radius[a], s_.radius[b]
    keep = level & (d > np.abs(ra - rb)) & (d < ra + rb) & (np.abs(height) <= alert) & (d > _ROUND * rb)
    a, b, normal, centre, height, aside, d, ra, rb = (x[keep] for x in (a, b, normal, centre, height, aside, d, ra, rb))
    along = (d**2 + rb**2 - ra**2) / (2 * d)
    half_chord = np.sqrt(np.maximum(rb**2 - along**2, 0))
    direction = aside / d[:, None]
    found = []
    for code, side in enumerate((-1.0, 1.0)):
        foot = centre + along[:, None] * direction + side * half_chord[:, None] * np.cross(normal, direction)
        found.append(touch_of_solids(now, a, b, normal, foot + height[:, None] * normal, foot, np.full(len(a), 3 + code)))
    return joined(found)
