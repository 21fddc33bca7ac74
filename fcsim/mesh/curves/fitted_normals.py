"""Normals of a curved surface at the vertices of facets without rows: of a smooth surface that is fitted to the vertices around.

Means of the facets' normals are exact where facets lie in rows, and on spheres. Unstructured triangles on a cylinder leave them off by some
hundredths of the angle between facets, at a rim by a third, and what the surface bulges over its facets by as much: of two bodies that have
other facets each, more than what they are pressed together by. But the vertices themselves lie on the surface. With q the way from one to
those around, and (u, v, w) its parts along two tangents t_1, t_2 and along the normal n as the facets have it,

    w + y . (u, v, u^2, uv, v^2, uw, vw, w^2, u^3, u^2 v, u v^2, v^3) = 0                                                        (1)

holds for one y wherever the surface is a quadric (cylinder, cone, sphere, ellipsoid), else up to terms of the fourth order; the normal is
n + y_1 t_1 + y_2 t_2. Least squares, weighted by 1 / |q|^6, over three rings of vertices, where these are few over more.

A prism over any polygon of seven sides satisfies (1): rows of flat faces say nothing. So a vertex has a fit only where triangles are around
that lie in no plane with one beside (`FACETS`), and where (1) leaves little of the heights (`LEFT`), as a ridge, chamfers around a rim or
the end of an arc do not.

Sources: F. Cazals and M. Pouget, Estimating differential quantities using polynomial fitting of osculating jets, Computer Aided Geometric
Design 22, 2005; G. Taubin, Estimation of planar curves, surfaces and nonplanar space curves defined by implicit equations, IEEE PAMI 13,
1991.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.mesh.curves.ragged import each_of

RINGS, MORE, POINTS = 3, 3, 20
"""Of vertices around one, three more at most where these are fewer than `POINTS`."""
FACETS = 6
"""Around a vertex that lie in no plane with one beside: rows of facets have none on cylinders and cones, flat faces none at all."""
QUADRIC, CUBIC = 8, 12
"""Unknowns of (1) without the terms of the third order, and with them."""
SPARE = {QUADRIC: 2, CUBIC: 8}
"""Vertices around one beyond those that fit whatever they are."""
LEFT = {QUADRIC: 1e-6, CUBIC: 0.1}
"""Root mean square over that of the heights over the tangent plane: without terms of the third order only what is a quadric is fitted."""
DETERMINED = 1e-11
"""Least eigenvalue of the normal equations over the largest."""
COPLANAR = 1e-12
"""1 - cos of the angle between facets of one flat face, at most."""
ROWS = 4096
"""Vertices at a time: what is fitted takes 5 kB each."""


def fitted_normals(vertex: IntArray, real: BoolArray, x: FloatArray, normal: FloatArray, n: FloatArray) -> tuple[BoolArray, FloatArray]:
    """Which vertices (nv,) have a fit, and unit normals (nv, 3) with theirs, as n (nv, 3) elsewhere.

    vertex (nf, k), of which those that are `real` count; x (nf, k, 3) [m] where they are; normal (nf, 3) of the facets.
    """
    count = len(n)
    f, k = np.nonzero(real)
    fits, result = np.zeros(count, dtype=bool), n.copy()
    alone = (real.sum(axis=1) == 3) & ~_beside_coplanar(vertex, real, normal)
    if alone.sum() < FACETS:
        return fits, result
    of_facet = _pattern(csr_array((np.ones(len(f)), (vertex[f, k], f)), shape=(count, len(vertex))))
    of_alone = csr_array(of_facet[:, np.flatnonzero(alone)])
    beside = _pattern(of_facet @ of_facet.T)
    point = np.zeros((count, 3))
    point[vertex[f, k]] = x[f, k]
    asked = np.flatnonzero(beside @ np.diff(of_alone.indptr))
    for first in range(0, len(asked), ROWS):
        at = asked[first : first + ROWS]
        around = beside[at]
        for ring in range(1, RINGS + MORE):
            few = np.diff(around.indptr) <= POINTS if ring >= RINGS else np.ones(len(at), dtype=bool)
            if not few.any():
                break
            around = _pattern(around + csr_array(few[:, None] * around) @ beside)
        curved = np.diff(_pattern(around @ of_alone).indptr) >= FACETS
        if curved.any():
            at = at[curved]
            fits[at], result[at] = _fitted(point, at, csr_array(around[curved]), n[at])
    return fits, result


def _fitted(point: FloatArray, at: IntArray, around: csr_array, n: FloatArray) -> tuple[BoolArray, FloatArray]:
    """(1) at the vertices `at` (m,) with the normals n (m, 3) over points (nv, 3) `around` each: which hold, and their normals."""
    count = np.diff(around.indptr)
    row, place = each_of(np.zeros_like(count), count)
    other = np.repeat(at[:, None], count.max(), axis=1)
    other[row, place] = around.indices
    q = point[other] - point[at][:, None]
    square = np.einsum("mpd,mpd->mp", q, q)
    size = np.sqrt(square.max(axis=1))
    q /= size[:, None, None]
    square /= size[:, None] ** 2
    weight = np.where(square > 0, 1.0 / np.maximum(square, 1e-4) ** 3, 0.0)
    holds, found = np.zeros(len(at), dtype=bool), n.copy()
    known = np.einsum("md,md->m", n, n) > 0.5  # none where facets are folded over each other
    for unknowns in (CUBIC, QUADRIC):
        asked = np.flatnonzero(~holds & (count > unknowns + SPARE[unknowns]) & known)
        holds[asked], found[asked] = _least_squares(q[asked], weight[asked], n[asked], unknowns)
    return holds, found


def _least_squares(q: FloatArray, weight: FloatArray, n: FloatArray, unknowns: int) -> tuple[BoolArray, FloatArray]:
    """The same for ways q (m, p, 3) of weights (m, p)."""
    holds = np.zeros(len(q), dtype=bool)
    for _ in range(2):  # anew about the normal found: its own error is of second order then
        t1 = np.cross(n, np.eye(3)[np.abs(n).argmin(axis=1)])
        t1 /= np.linalg.norm(t1, axis=1)[:, None]
        t2 = np.cross(n, t1)
        u, v, w = ((q @ axis[:, :, None])[:, :, 0] for axis in (t1, t2, n))
        every = (u, v, u * u, u * v, v * v, u * w, v * w, w * w, u**3, u * u * v, u * v * v, v**3)
        terms = np.stack(every[:unknowns], axis=2)
        weighted = (weight[:, :, None] * terms).transpose(0, 2, 1)
        value, vector = np.linalg.eigh(weighted @ terms)
        inverse = np.where(value > DETERMINED * value[:, -1:], 1.0 / np.maximum(value, 1e-300), 0.0)
        y = -((vector * inverse[:, None]) @ (vector.transpose(0, 2, 1) @ (weighted @ w[:, :, None])))
        left = w + (terms @ y)[:, :, 0]
        n = n + y[:, 0] * t1 + y[:, 1] * t2
        n /= np.linalg.norm(n, axis=1)[:, None]
        height = (q @ n[:, :, None])[:, :, 0]
        small = (left**2).sum(axis=1) <= LEFT[unknowns] ** 2 * (height**2).sum(axis=1)
        holds = small & (value[:, 0] > DETERMINED * value[:, -1])
    return holds, n


def _beside_coplanar(vertex: IntArray, real: BoolArray, normal: FloatArray) -> BoolArray:
    """Which facets (nf,) lie in one plane with one that they share a side with."""
    f, at = np.nonzero(real)
    ends = np.sort(np.stack([vertex[f, at], vertex[f, (at + 1) % real.sum(axis=1)[f]]]), axis=0)
    order = np.lexsort(ends)
    same = np.flatnonzero((np.diff(ends[:, order], axis=1) == 0).all(axis=0))
    pairs = np.stack([f[order[same]], f[order[same + 1]]])
    found = np.zeros(len(vertex), dtype=bool)
    found[pairs[:, np.einsum("ed,ed->e", *normal[pairs]) > 1.0 - COPLANAR]] = True
    return found


def _pattern(matrix: csr_array) -> csr_array:
    """A matrix with ones where that has entries."""
    found = csr_array(matrix)
    found.eliminate_zeros()
    found.data[:] = 1.0
    return found
