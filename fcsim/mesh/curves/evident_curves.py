"""Where facets are evidently the chords of a curve, and not flat faces beside blunt edges: a ramp, chamfers, a straight part between arcs.

Along a side of the length L from the vertex k to l the surface has at k the normal curvature

    c_kl = 2 n_k . (x_k - x_l) / L^2                                                                                             (1)

of the normals n, by the facets around, the same all along a circle whatever the lengths of its chords. Half the angle is between
the last chord of an arc and the straight part that it runs into, and a flat face between two chamfers, with facets as long as its own, has
the curvature of a circle at its two ends alone. So a side belongs to a curve where three vertices in a row, one of which it ends in, have
curvatures that agree (`AGREE`), and none of the three is the surface's end: four chords one after the other are the least.

Rows of vertices go on over each along the side that is most opposite, by less than 60 degrees off. The normals are not those that `bulges`
carries on to the rim: what is carried on agrees by itself.
"""

from __future__ import annotations

import numpy as np

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.mesh.curves.ragged import of_same_key

AGREE = 1.0 / 3.0
"""Of the larger curvature: two of a curve differ by no more; where an arc runs into a straight part of as long facets by half."""
NOISE, SLIGHT = 0.5, 0.1
"""Of the largest curvature at two vertices: along sides bent by less, facets' shapes leave it uncertain by so much; as good as flat."""
STRAIGHT = -0.5
"""Cosine between sides that go on along each other, at most."""


def evident_sides(first: IntArray, second: IntArray, way: FloatArray, normal: FloatArray) -> BoolArray:
    """Which sides (ne,) belong to a curve. first, second (ne,): the vertices that each joins, given once or by both facets; way (ne, d) [m]
    from the first to the second; normal (nv, d) at the vertices, nan where it is unknown."""
    count = len(normal)
    _, given, side = np.unique(np.minimum(first, second) * count + np.maximum(first, second), return_index=True, return_inverse=True)
    first, second, way = first[given], second[given], way[given]
    square = np.einsum("sd,sd->s", way, way)
    curvature = [sign * np.einsum("sd,sd->s", normal[end], way) / square for sign, end in ((-2.0, first), (2.0, second))]
    n = len(first)  # a side is walked both ways, back as number n more
    start, unit = np.concatenate([first, second]), way / np.sqrt(square)[:, None]
    ahead, c = np.concatenate([unit, -unit]), np.concatenate(curvature)
    back = (np.arange(2 * n) + n) % (2 * n)
    opposite = _opposite(start, ahead)
    goes_on = opposite >= 0
    most = np.zeros(count)
    np.maximum.at(most, start, np.nan_to_num(np.abs(c)))
    largest = np.maximum(most[start], most[start[back]])
    even, agrees = _agree(c, c[back], largest), goes_on & _agree(c, c[opposite], largest)
    inner = agrees[back] & even  # from a vertex to one that is not the end
    core = agrees & inner & inner[opposite]
    next_to_core = agrees & even[opposite] & core[back[opposite]]
    known = core | next_to_core
    return np.asarray((known[:n] | known[n:])[side])


def _agree(one: FloatArray, other: FloatArray, largest: FloatArray) -> BoolArray:
    """Whether curvatures have one sign and differ by as little as `AGREE` says, and neither is as good as flat; not of nan."""
    own = np.maximum(np.abs(one), np.abs(other))
    bent = (one * other > 0) & (np.minimum(np.abs(one), np.abs(other)) >= SLIGHT * largest)
    return np.asarray(bent & (np.abs(one - other) <= AGREE * np.maximum(own, NOISE * largest)))


def _opposite(start: IntArray, ahead: FloatArray) -> IntArray:
    """For each way (n,) from a vertex, start, along a unit vector (n, d) that which leaves the same vertex most opposite, -1 for none."""
    one, other = of_same_key(start, start)
    turned = np.einsum("pd,pd->p", ahead[one], ahead[other])
    best = np.lexsort([turned, one])
    best = best[np.unique(one[best], return_index=True)[1]]
    found = np.full(len(start), -1)
    found[one[best]] = np.where(turned[best] < STRAIGHT, other[best], -1)
    return found
