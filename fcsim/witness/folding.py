"""Bodies that overlap themselves: a leg of a spring in the other, a ring's end in its side.

A point of the skin, a vertex or the centre of a triangle, lies in another part of its body where a point a little out of its own skin is
inside the body; how deep, tells the nearest facet that opposes it and behind which it lies. Between the two sides of a thin plate that is
the plate itself, so each point has the distance that it has there in the reference configuration, and only what is nearer by a tenth is
looked at: deeper overlaps than nine tenths of the thickness are not seen, shallower ones are. The reference configuration itself is taken
as sound.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from fcsim.arrays import FloatArray, IntArray
from fcsim.witness._distance_kernels import Forest
from fcsim.witness._folding_kernels import deepest_in_itself, thicknesses

_THINNER = 0.9
_CONVEX = 1e-3  # of the hull's volume
_ROUND = 1e-6  # of a body's size


class Folding(NamedTuple):
    """Bodies (nk,) that may overlap themselves, their vertices, one array a body, and the distances [m] below which they are looked at."""

    bodies: IntArray
    vertices: tuple[IntArray, ...]
    limits: tuple[FloatArray, ...]


NONE = Folding(np.empty(0, dtype=np.int64), (), ())


def is_convex(points: FloatArray, volume: float) -> bool:
    """Whether a skin of these points (n, d), no two in one place, that encloses `volume` is that of a convex body."""
    if len(np.unique(points, axis=0)) < len(points):  # the sides of a crack
        return False
    try:
        return bool(volume > (1 - _CONVEX) * ConvexHull(points).volume)
    except QhullError:
        return False


def folding(bodies: Sequence[int], vertices: Sequence[IntArray], sizes: Sequence[float], forest: Forest, modulus: int) -> Folding:
    """The bodies that may overlap themselves, with what their vertices have behind them in the reference configuration."""
    limits = [_THINNER * thicknesses(k, v, _ROUND * s, forest, modulus) for k, v, s in zip(bodies, vertices, sizes, strict=True)]
    return Folding(np.array(bodies, dtype=np.int64), tuple(vertices), tuple(limits))


def own_overlaps(folding: Folding, least: FloatArray, forest: Forest, modulus: int, d: int) -> tuple[IntArray, FloatArray, FloatArray]:
    """Pairs (n, 2) of a body and itself, overlap (n,) [m] and place (n, d) of those deeper in themselves than least (nk,) [m]."""
    found = [
        deepest_in_itself(body, vertices, limits, floor, forest, modulus)
        for body, vertices, limits, floor in zip(folding.bodies, folding.vertices, folding.limits, least, strict=True)
    ]
    depth = np.array([deep for deep, _ in found])
    place = np.array([at[:d] for _, at in found]).reshape(-1, d)
    body, deep = folding.bodies, depth > 0
    return np.column_stack([body, body])[deep], depth[deep], place[deep]
