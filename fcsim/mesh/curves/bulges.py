"""How far a curved surface bulges over its facets: what lies between the chords that a mesh has and the surface that they stand for.

Facets of length L on a surface of radius R are chords, L^2 / 8R below it in their middle. Two bodies that fit each other with other facets
each, a shaft in its hub, have gaps of such lengths where there is none: what is pressed together by less bears elsewhere, by many times too
much, or not at all. With unit normals n_k of the surface at the corners x_k of a facet of the normal N, and its shape functions psi_k,

    b(psi) = sum_kl psi_k psi_l B_kl,    B_kl = n_k . (x_k - x_l) / (1 + n_k . N)                                                 (1)

is the height of the surface over the facet, > 0 outwards: exact on paraboloids, and in the middle of a circle's chord. B is of the
reference and moves with the body: a point of a body is where the surface was, displaced as the shape functions say.

The normals weigh corners by sin / (|a|^2 |b|^2) of their sides (2D: 1 / length), exact on spheres and circles with facets of any lengths;
at the rim of a smooth patch they are carried on along the facets' sides from inner corners, mirrored at the sides' middles. Of unstructured
triangles they are those of a surface that is fitted to the vertices around (`fitted_normals`), at the rim too, and sides between two
of these belong to curves. Of B_kl and B_lk the smaller counts, but their mean, exact to the third order, where both ends have a fit and
they differ by no more than those of curves (`AGREE`); none where they differ in sign. Facets more than `LONG` times as long as one beside
them are flat: the straight part of what ends in a curve is none. Nor is what is no curve evidently (`evident_curves`): a
ramp, chamfers; `bulges` has none there, `bulges_of_all_edges` has them wherever three normals are.

Sources: N. Max, Weights for computing vertex normals from facet normals, Journal of Graphics Tools 4, 1999; M. A. Puso and T. A. Laursen, A
3D contact smoothing method using Gregory patches, IJNME 54, 2002 (what chords do to contact, and smooth surfaces in their place).
"""

from __future__ import annotations

import numpy as np

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.mesh.curves.evident_curves import AGREE, evident_sides
from fcsim.mesh.curves.fitted_normals import fitted_normals

LEVEL = 1e-9
"""Of a facet's size: less is round-off, and the facet is flat."""
LEVEL_OF_NORMALS = 1e-6
"""What normals of one flat face may differ by."""
SLIGHTLY = 0.05
"""Of the largest of a facet."""
LONG = 2.5
"""Times the size of a facet beside it: what is longer is no chord of the same curve."""


def bulges(
    nodes: IntArray, sides: IntArray, points: FloatArray, normal: FloatArray, size: FloatArray, patch: IntArray
) -> FloatArray | None:
    """Return B (nf, k, k) [m] of (1) of evident curves, symmetric, 0 on the diagonal and of flat facets; None where all are flat.

    nodes (nf, k), of which the first `sides` (nf,) count; points (n, d) [m]; normal (nf, d), size (nf,) [m] of the facets; patch (nf,): the
    number of the smooth part of the surface that each facet is in.
    """
    if not len(nodes) or not _bent(normal, patch):
        return None
    B, curved = _both_ways(nodes, sides, points, normal, size, patch)
    return _smaller(_of_curves(B, sides, *curved), sides, size)


def bulges_of_all_edges(
    nodes: IntArray, sides: IntArray, points: FloatArray, normal: FloatArray, size: FloatArray, patch: IntArray
) -> FloatArray | None:
    """The same of a surface all of whose blunt edges are those of chords, but where two flat faces meet in one."""
    if not len(nodes) or not _bent(normal, patch):
        return None
    B, _ = _both_ways(nodes, sides, points, normal, size, patch)
    B[_edges_alone(normal, patch)] = 0.0
    return _smaller(B, sides, size)


def _both_ways(
    nodes: IntArray, sides: IntArray, points: FloatArray, normal: FloatArray, size: FloatArray, patch: IntArray
) -> tuple[FloatArray, tuple[IntArray, IntArray, BoolArray, BoolArray]]:
    """B_kl (nf, k, k) [m] by the normal at k alone, nan where that is unknown; and the sides (facet, corner) with whether they belong to
    evident curves, by the normals as they are at the rim, and whether those of an end were carried on."""
    real = np.arange(nodes.shape[1]) < sides[:, None]
    vertex = np.zeros_like(nodes)
    vertex[real] = np.unique((nodes * (1 + patch.max()) + patch[:, None])[real], return_inverse=True)[1]
    x = points[nodes]
    means, n = _normals(vertex, real, sides, x, normal)
    fits = np.zeros(len(n), dtype=bool)
    if x.shape[2] == 3:
        fits, fitted = fitted_normals(vertex, real, x, normal, means)
        means[fits] = n[fits] = fitted[fits]
    carried = (n != means).any(axis=1)
    uneven = _uneven(vertex, real, size) & ~fits
    means[uneven] = n[uneven] = np.nan
    own = n[vertex]
    own[~real] = np.nan  # triangles among quadrilaterals
    towards = np.einsum("fkd,fkld->fkl", own, x[:, :, None] - x[:, None])
    B = towards / (1.0 + np.einsum("fkd,fd->fk", own, normal))[:, :, None]
    B = np.where(real[:, None], B, np.nan)
    back, both = B.transpose(0, 2, 1), fits[vertex][:, :, None] & fits[vertex][:, None]
    near = both & (B * back > 0) & (np.abs(B - back) <= AGREE * np.maximum(np.abs(B), np.abs(back)))
    B = np.where(near, 0.5 * (B + back), B)
    f, at = np.nonzero(real if x.shape[2] == 3 else real[:, :1])
    to = (at + 1) % sides[f]
    first, second = vertex[f, at], vertex[f, to]
    evident = evident_sides(first, second, x[f, to] - x[f, at], means) | (fits[first] & fits[second])
    return B, (f, at, evident, carried[first] | carried[second])


def _smaller(B: FloatArray, sides: IntArray, size: FloatArray) -> FloatArray | None:
    """The smaller of B_kl and B_lk, 0 where they differ in sign, are unknown, or round-off; None where all are 0."""
    real = np.arange(B.shape[1]) < sides[:, None]
    back = B.transpose(0, 2, 1)
    alike = (B * back > 0) & real[:, :, None] & real[:, None]  # not of nan
    B = np.where(alike, np.where(np.abs(B) < np.abs(back), B, back), 0.0)
    B[np.abs(B) < LEVEL * size[:, None, None]] = 0.0
    return B if B.any() else None


def _of_curves(B: FloatArray, sides: IntArray, f: IntArray, at: IntArray, evident: BoolArray, carried: BoolArray) -> FloatArray:
    """B with 0 along sides (f, at) of no evident curve, but of a triangle with a side of one where all others are of one, or as good as
    flat (`SLIGHTLY`), or where the side is bent alike at both ends, by normals that are not carried on; along the diagonals of a
    quadrilateral with a bent side that is of none what the others say of a surface without twist."""
    to = (at + 1) % sides[f]
    own = np.maximum(np.abs(B[f, at, to]), np.abs(B[f, to, at]))
    flat = own <= SLIGHTLY * np.nanmax(np.abs(B), axis=(1, 2), initial=0.0)[f]
    without = np.bincount(f[~(evident | flat)], minlength=len(B))[f]
    some = np.bincount(f[evident & ~flat], minlength=len(B))[f] > 0
    forth, back = B[f, at, to], B[f, to, at]
    even = ~carried & (forth * back > 0) & (np.abs(forth - back) <= AGREE * own)
    none = ~evident & ~((sides[f] == 3) & some & ((without <= 1) | even))
    B = B.copy()
    B[f[none], at[none], to[none]] = B[f[none], to[none], at[none]] = 0.0
    four = np.unique(f[none & ~flat & (sides[f] == 4)])
    if len(four):
        least = _smaller(B[four], sides[four], np.zeros(len(four)))
        known = np.zeros_like(B[four]) if least is None else least
        across = 0.5 * (known[:, 0, 1] + known[:, 2, 3] + known[:, 1, 2] + known[:, 3, 0])
        for one, other in ((0, 2), (1, 3)):
            B[four, one, other] = B[four, other, one] = across
    return B


def heights(bulge: FloatArray, facet: IntArray, weights: FloatArray) -> FloatArray:
    """b (n,) [m] over facets (n,) at their shape functions (n, k), for B (nf, k', k'), k' >= k."""
    k = weights.shape[1]
    return np.einsum("nk,nl,nkl->n", weights, weights, bulge[facet, :k, :k])


def highest(bulge: FloatArray) -> FloatArray:
    """What b does not exceed on each facet (nf,) [m], >= 0."""
    return np.asarray(np.maximum(bulge, 0.0).sum(axis=(1, 2)) / bulge.shape[1])


def _bent(normal: FloatArray, patch: IntArray) -> bool:
    """Whether facets of one patch have different normals."""
    first = np.zeros(1 + patch.max(), dtype=np.int64)
    first[patch] = np.arange(len(patch))
    return bool((np.abs(normal - normal[first[patch]]) > LEVEL).any())


def _edges_alone(normal: FloatArray, patch: IntArray) -> BoolArray:
    """Which facets (nf,) are of patches that have two normals: flat faces on both sides of a blunt edge, no curve."""
    different = np.unique(np.column_stack([patch, np.round(normal / LEVEL_OF_NORMALS)]), axis=0)
    return np.asarray(np.bincount(different[:, 0].astype(np.int64), minlength=1 + patch.max())[patch] < 3)


def _normals(vertex: IntArray, real: BoolArray, sides: IntArray, x: FloatArray, normal: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Unit normals (nv, d) of the surface at the vertices by the facets around, and with those at the rim carried on; vertex (nf, k), x
    (nf, k, d) [m]."""
    count, each = 1 + int(vertex.max()), np.arange(vertex.shape[1])
    ahead, back = ((each + step) % sides[:, None] for step in (1, -1))
    if x.shape[2] == 2:
        length = np.linalg.norm(x[:, 1] - x[:, 0], axis=1)
        corner = np.repeat((normal / length[:, None])[:, None], 2, axis=1)
        rim = np.bincount(vertex[real], minlength=count) == 1
    else:
        a, b = (np.take_along_axis(x, k[:, :, None], axis=1) - x for k in (ahead, back))
        square = np.maximum(np.einsum("fkd,fkd->fk", a, a) * np.einsum("fkd,fkd->fk", b, b), 1e-300)
        corner = np.cross(a, b) / square[:, :, None]
        ends = np.sort(np.stack([vertex, np.take_along_axis(vertex, ahead, axis=1)], axis=-1)[real], axis=1)
        _, edge, times = np.unique(ends @ [count, 1], return_inverse=True, return_counts=True)
        rim = np.zeros(count, dtype=bool)
        rim[ends[times[edge] == 1]] = True
    n = _unit(_sums(vertex[real], corner[real], count))
    return n, _carried_on(n, rim, vertex, real, (ahead, back), x)


def _carried_on(
    n: FloatArray, rim: BoolArray, vertex: IntArray, real: BoolArray, beside: tuple[IntArray, IntArray], x: FloatArray
) -> FloatArray:
    """The normals with those at the rim carried on along the facets' sides from inner corners, then from those that have got theirs so;
    where a facet has no inner corner (a strip of one cell), from corners that more facets share. beside (2, nf, k): each corner's next."""
    valence = np.bincount(vertex[real], minlength=len(n))
    within = real & ~rim[vertex]
    shared = real & (valence[vertex] > np.where(real, valence[vertex], valence.max()).min(axis=1)[:, None])
    inner = np.where(within.any(axis=1)[:, None], within, shared)
    left = rim.copy()
    for _ in range(2):  # the corners of a patch lie beside its rim alone
        outer = real & left[vertex] & ~inner
        carried = np.zeros_like(x)
        for next_to in beside:
            from_inner = outer & np.take_along_axis(inner, next_to, axis=1)
            own, side = (np.take_along_axis(values, next_to[:, :, None], axis=1) for values in (n[vertex], x))
            carried += np.where(from_inner[:, :, None], _mirrored(own, x - side), 0.0)
        outer &= carried.any(axis=2)
        arrived = left & (np.bincount(vertex[outer], minlength=len(n)) == valence)
        n = np.where(arrived[:, None], _unit(_sums(vertex[outer], _unit(carried[outer]), len(n))), n)
        left &= ~arrived
        inner |= real & arrived[vertex]
    return n


def _mirrored(n: FloatArray, side: FloatArray) -> FloatArray:
    """Normals n (..., d) at one end of sides (..., d) as they are at the other: mirrored at the middle, exact on circles and spheres."""
    square = np.maximum(np.einsum("...d,...d->...", side, side), 1e-300)
    return np.asarray(n - 2.0 * (np.einsum("...d,...d->...", n, side) / square)[..., None] * side)


def _uneven(vertex: IntArray, real: BoolArray, size: FloatArray) -> BoolArray:
    """Vertices (nv,) of which a facet around is far longer than another."""
    at = np.broadcast_to(size[:, None], vertex.shape)[real]
    least = np.full(1 + vertex.max(), np.inf)
    most = np.zeros_like(least)
    np.minimum.at(least, vertex[real], at)
    np.maximum.at(most, vertex[real], at)
    return np.asarray(most > LONG * least)


def _sums(row: IntArray, values: FloatArray, count: int) -> FloatArray:
    return np.stack([np.bincount(row, column, minlength=count) for column in values.T], axis=1)


def _unit(vectors: FloatArray) -> FloatArray:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1), 1e-300)[..., None]
