"""Points with the sum, the centre and the second moments of an area: their shares m_k of it times f, f_0 + b . x + x . B x or exp(...).

See `fcsim.contact_law.areas.flat_faces`. Points of share 0 take part in nothing, and f is told there too.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fcsim.arrays import BoolArray, FloatArray, IntArray

_KNOWN = 1e-3
"""Of a patch's area: moments are none of its points' below it."""
LEAST = 0.05
"""Of f_0: what f keeps at least."""
_ROUNDS = 8
"""Of Newton's method for f = exp(...) in place of a polynomial that would be negative."""


class Points(NamedTuple):
    """Points (n, d) [m] of patches, their shares (n,) [m^2; 2D: m] and patch (n,)."""

    place: FloatArray
    share: FloatArray
    patch: IntArray


class _Squares(NamedTuple):
    """Of points and Gauss points along principal axes over radii of gyration: places (n, i), (nq, i), their products (n, j), (nq, j)."""

    x: FloatArray
    y: FloatArray
    square: FloatArray
    of_gauss: FloatArray


def factors(points: Points, gauss: Points, patches: int) -> FloatArray:
    """f (n,) at the points, for the moments of the Gauss points of the patches' overlaps."""
    at = points.patch
    tried, begun, factor = points, _change(points, gauss, patches), np.ones(len(at))
    linear, curved = begun
    for _ in range(_ROUNDS):
        low = _below(1.0 + linear + curved, at, patches)
        if not low.any():
            break
        steepest = np.ones(patches)
        np.maximum.at(steepest, at, np.abs(linear + curved))
        factor = np.maximum(factor * np.where(low[at], np.exp((linear + curved) / steepest[at]), 1.0), LEAST)
        tried = points._replace(share=points.share * factor)
        linear, curved = _change(tried, gauss, patches)
    back = _below(1.0 + linear + curved, at, patches)[at]  # there is no such exponential: the polynomial, scaled down
    linear, curved = np.where(back, begun[0], linear), np.where(back, begun[1], curved)
    factor = np.where(back, 1.0, factor)
    first = 1.0 + linear * np.where(back, _part(np.ones(len(at)), linear, 2 * LEAST, at, patches), 1.0)
    whole, sums = np.bincount(gauss.patch, gauss.share, patches), np.bincount(at, points.share * factor, patches)
    scale = np.divide(whole, sums, out=np.zeros(patches), where=sums > 0)[at]
    return factor * scale * (first + curved * np.where(back, _part(first, curved, LEAST, at, patches), 1.0))


def lowest(points: Points, gauss: Points, patches: int) -> FloatArray:
    """The least value (patches,) of the polynomial f at the points, over f_0."""
    least, (linear, curved) = np.full(patches, np.inf), _change(points, gauss, patches)
    np.minimum.at(least, points.patch, 1.0 + linear + curved)
    return least


def misses(points: Points, gauss: Points, patches: int) -> FloatArray:
    """By how much (patches,) second moments of the points are off, over those of the overlap: the largest of theirs along its axes."""
    share, over = _over_sums(points, patches), _over_sums(gauss, patches)
    _, _, square, of_gauss = _squares_of(points, gauss, share, over, patches)
    off = _means(square, share, points.patch, patches) - _means(of_gauss, over, gauss.patch, patches)
    return np.asarray(np.abs(off).max(axis=1))


def _below(factor: FloatArray, patch: IntArray, patches: int) -> BoolArray:
    """Which patches have a factor below `LEAST`."""
    low = np.zeros(patches, dtype=bool)
    low[patch[factor < LEAST]] = True
    return low


def _over_sums(points: Points, patches: int) -> FloatArray:
    """Shares (n,) over their sum in each patch."""
    return points.share / np.maximum(np.bincount(points.patch, points.share, patches), 1e-300)[points.patch]


def _squares_of(points: Points, gauss: Points, share: FloatArray, over: FloatArray, patches: int) -> _Squares:
    """The coordinates of points, from their centre, and of Gauss points, from theirs, of the shares of 1."""
    at, where = points.patch, gauss.patch
    arm = gauss.place - _means(gauss.place, over, where, patches)[where]
    size, axes = np.linalg.eigh(_summed(where, over, arm, arm, patches))
    size, axes = size[:, 1:], axes[:, :, 1:]  # without the normal
    scaled = axes / np.sqrt(np.maximum(size, 1e-12 * np.maximum(size[:, -1:], 1e-300)))[:, None, :]
    mean = _means(points.place, share, at, patches)
    x, y = (np.einsum("qi,qij->qj", place - mean[k], scaled[k]) for place, k in ((points.place, at), (gauss.place, where)))
    return _Squares(x, y, *(_products(z) for z in (x, y)))


def _change(points: Points, gauss: Points, patches: int) -> tuple[FloatArray, FloatArray]:
    """By how much f differs from f_0, over f_0, at the points (n,): b . x, and what goes with x . B x."""
    at, where, share, over = points.patch, gauss.patch, _over_sums(points, patches), _over_sums(gauss, patches)
    x, y, square, of_gauss = _squares_of(points, gauss, share, over, patches)
    inverse = _inverse(_summed(at, share, x, x, patches))
    linear = np.einsum("qi,qij,qj->q", x, inverse[at], _means(y, over, where, patches)[at])
    mean, along = _means(square, share, at, patches), _summed(at, share, square, x, patches) @ inverse
    square, of_gauss = (q - mean[k] - np.einsum("qij,qj->qi", along[k], z) for q, z, k in ((square, x, at), (of_gauss, y, where)))
    inverse = _inverse(_summed(at, share, square, square, patches))
    return linear, np.einsum("qi,qij,qj->q", square, inverse[at], _means(of_gauss, over, where, patches)[at])


def _means(values: FloatArray, share: FloatArray, patch: IntArray, patches: int) -> FloatArray:
    """sum share values (patches, i), of shares whose sum is 1 in each patch."""
    return np.stack([np.bincount(patch, share * column, patches) for column in values.T], axis=1)


def _products(x: FloatArray) -> FloatArray:
    """The products (n, 3) of coordinates (n, 2), in 2D (n, 1): sums of squares of theirs do not depend on the axes."""
    return x**2 if x.shape[1] == 1 else np.stack([x[:, 0] ** 2, np.sqrt(2) * x[:, 0] * x[:, 1], x[:, 1] ** 2], axis=1)


def _summed(patch: IntArray, weight: FloatArray, one: FloatArray, other: FloatArray, patches: int) -> FloatArray:
    """sum weight one other^T (patches, i, j)."""
    columns = [[np.bincount(patch, weight * a * b, patches) for b in other.T] for a in one.T]
    return np.moveaxis(np.array(columns), 2, 0)


def _inverse(matrices: FloatArray) -> FloatArray:
    """Pseudo-inverses of symmetric matrices (n, k, k) of the order of 1, without what is `_KNOWN` of that."""
    size, axes = np.linalg.eigh(matrices)
    return np.asarray((axes * np.where(size > _KNOWN, 1 / np.maximum(size, _KNOWN), 0.0)[:, None, :]) @ np.swapaxes(axes, 1, 2))


def _part(base: FloatArray, more: FloatArray, least: float, patch: IntArray, patches: int) -> FloatArray:
    """How much (n,) of `more` leaves at least `least` of each patch's factors."""
    part = np.ones(patches)
    down = np.flatnonzero(more < 0)
    room = (base - least)[down]
    np.minimum.at(part, patch[down], np.maximum(room, 0.0) / np.maximum(-more[down], 1e-300))
    return part[patch]
