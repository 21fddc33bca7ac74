"""Outlines of plane bodies: a closed polygon and those of its holes."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from fcsim.arrays import FloatArray, numbers_of
from fcsim.brief import shown
from fcsim.errors import InputError


def outline_of(name: str, points: ArrayLike, holes: Sequence[ArrayLike] = ()) -> list[FloatArray]:
    """Return the corners (n, 2) [m] of a polygon, counter-clockwise, then those of its holes, clockwise: the body is on their left.

    InputError for polygons without an area, with a corner twice, that cross themselves or touch each other, and holes that are not within.
    """
    if not isinstance(holes, Iterable):
        raise InputError(f"polygon {name!r}: expected holes as a list of polygons, each by its corners, got {shown(holes)}")
    loops = [_turned(_polygon(f"polygon {name!r}", points), 1.0)]
    for k, hole in enumerate(holes):
        loops.append(_turned(_polygon(f"polygon {name!r}, hole {k}", hole), -1.0))
    if len(loops) > 1 and _touch(loops):
        raise InputError(
            f"polygon {name!r}: expected holes whose sides touch no others (one at the outline is part of it, holes that meet are one)"
        )
    for k, hole in enumerate(loops[1:]):
        if not _within(hole[0], loops[0]) or any(_within(hole[0], other) for j, other in enumerate(loops[1:]) if j != k):
            raise InputError(f"polygon {name!r}: expected holes within it, none in another, got hole {k} with {hole[0].tolist()} elsewhere")
    return loops


def area_of(loop: FloatArray) -> float:
    """The area [m^2] within a polygon, < 0 of one that is clockwise."""
    x, y = (loop - loop.mean(axis=0)).T
    return float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y) / 2)


def _polygon(what: str, points: ArrayLike) -> FloatArray:
    """The corners, checked."""
    p = numbers_of(points)
    if p.ndim != 2 or p.shape[1] != 2 or len(p) < 3 or not np.isfinite(p).all():
        mend = "; holes are given by holes=[...], each by its corners" if p.ndim != 2 else ""
        raise InputError(f"{what}: expected at least three finite corners of shape (n, 2), got shape {p.shape}{mend}")
    after = np.roll(p, -1, axis=0)
    if (same := np.flatnonzero((p == after).all(axis=1))).size:
        again = (int(same[0]) + 1) % len(p)
        raise InputError(
            f"{what}: expected corners that differ from the next one (the last is joined to the first by itself), got corner {again} "
            f"where corner {int(same[0])} is, at {tuple(p[again].tolist())}"
        )
    if not abs(area_of(p)) > 1e-12 * np.ptp(p, axis=0).max() ** 2:
        raise InputError(f"{what}: expected corners around an area, got {abs(area_of(p)):.3g} m^2")
    if (back := np.flatnonzero(((p[:, None] == after) & (after[:, None] == p)).all(axis=2).any(axis=1))).size:
        raise InputError(
            f"{what}: expected sides that are run along once, got that from {tuple(p[back[0]].tolist())} to "
            f"{tuple(after[back[0]].tolist())} both ways: a hole is given by holes=[...]"
        )
    if _cross(p, after):
        raise InputError(f"{what}: expected sides that do not cross each other")
    return p


def _turned(loop: FloatArray, sign: float) -> FloatArray:
    return loop if area_of(loop) * sign > 0 else loop[::-1]


def _cross(a: FloatArray, b: FloatArray) -> bool:
    """Whether two of the sides from a to b (n, 2), which are no neighbours, cross."""
    splits = _sides(a, b) < 0
    return bool((splits & splits.T).any())


def _touch(loops: list[FloatArray]) -> bool:
    """Whether sides of two polygons have a point in common."""
    a, b = np.concatenate(loops), np.concatenate([np.roll(loop, -1, axis=0) for loop in loops])
    loop, low, high = np.repeat(np.arange(len(loops)), [len(p) for p in loops]), np.minimum(a, b), np.maximum(a, b)
    near = np.all((low[:, None] <= high) & (low <= high[:, None]), axis=2) & (loop[:, None] != loop)
    splits = _sides(a, b) <= 0
    return bool((splits & splits.T & near).any())


def _sides(a: FloatArray, b: FloatArray) -> FloatArray:
    """(n, n): -1 where the line of side i, from a to b (n, 2), passes between the ends of side j, 0 where through one, else 1."""
    along, arms = (b - a)[:, None], (a - a[:, None], b - a[:, None])
    first, last = (np.sign(along[..., 0] * arm[..., 1] - along[..., 1] * arm[..., 0]) for arm in arms)
    return np.asarray(first * last)


def _within(point: FloatArray, loop: FloatArray) -> bool:
    """Whether a point is within a polygon: a ray to the right meets an odd number of sides."""
    a, b = loop, np.roll(loop, -1, axis=0)
    over = (a[:, 1] > point[1]) != (b[:, 1] > point[1])
    x = a[over, 0] + (point[1] - a[over, 1]) * (b[over, 0] - a[over, 0]) / (b[over, 1] - a[over, 1])
    return bool(np.count_nonzero(x > point[0]) % 2)
