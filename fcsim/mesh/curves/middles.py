"""Middle nodes of cells raised to second order, put on the curves that the straight cells are chords of.

Along an edge of the boundary whose facets f bulge by b_f [m] over its middle (`bulges`), along their normals n_f, the middle moves by d,

    d . n_f = b_f                                                                                                                (1)

in the span of the normals: from the rim of a cylinder's end in the plane of that end. Where the facets meet at less than `ROUND`, they are
of one curve, and d is the mean of b_f along that of n_f. What is flat moves nowhere. The middles of faces and of hexahedra follow by
transfinite interpolation,

    d(face) = 1/2 sum d(edges),    d(cell) = 1/2 sum d(faces) - 1/4 sum d(edges)                                                 (2)

exact on cylinders, to the third order on spheres; so cells that are thin beside the bulge keep their thickness. The edges of a cell that
would fold, as one does with two facets of one curve, stay chords.

Source: W. J. Gordon and C. A. Hall, Construction of curvilinear co-ordinate systems and applications to mesh generation, IJNME 7, 1973.
"""

from __future__ import annotations

import numpy as np

from fcsim.arrays import FloatArray, IntArray
from fcsim.mesh.cell_type import CELL_TYPES, CellType
from fcsim.mesh.curves.bulges import bulges
from fcsim.mesh.curves.patches import ROUND, patches
from fcsim.mesh.quality import ROUND_OFF, scaled_jacobian

KEPT = 0.2
"""Of the scaled Jacobian that a cell has with straight edges: one that would have less keeps these."""


def on_curves(points: FloatArray, cells: IntArray, cell_type: str) -> FloatArray:
    """The points (nn, d) [m] of a mesh of second order with straight edges, those in the middle of chords of evident curves on these."""
    cell = CELL_TYPES[cell_type]
    edge = _displacements(points, cells, cell)
    if edge is None:
        return points
    straight = scaled_jacobian(points, cells, cell_type)
    local = [place for place, corners in enumerate(cell.middles, cell.corners) if len(corners) == 2]
    while edge.any():
        moved = points + _interpolated(edge, cells, cell)
        changed = np.flatnonzero(edge[cells[:, local]].any(axis=(1, 2)))
        now = scaled_jacobian(moved, cells[changed], cell_type)
        folded = changed[~(now >= KEPT * straight[changed])]
        if not len(folded):
            return moved
        edge[cells[folded][:, local]] = 0.0
    return points


def _displacements(points: FloatArray, cells: IntArray, cell: CellType) -> FloatArray | None:
    """d (nn, d) [m] of (1) at the middles of the boundary's edges, 0 elsewhere; None where nothing is curved, or a cell is no cell."""
    facets = cells[:, cell.facets].reshape(-1, cell.facet_size)
    k = cell.facet_corners
    _, first, count = np.unique(np.sort(facets[:, :k], axis=1), axis=0, return_index=True, return_counts=True)
    facets = facets[np.sort(first[count == 1])]
    normal, size = _normals(points[facets[:, :k]])
    if not len(facets) or not (size > 0).all() or not np.isfinite(size).all():
        return None
    corners = facets[:, :k]
    patch = patches(corners, normal, float(ROUND))
    bulge = bulges(corners, np.full(len(facets), k), points, normal, size, patch)
    if bulge is None or not (scaled_jacobian(points, cells, cell.name) >= ROUND_OFF).all():
        return None
    edges = k if k > 2 else 1
    at = np.arange(edges)
    middle, height = facets[:, k : k + edges], 0.5 * bulge[:, at, (at + 1) % k]
    d = np.zeros_like(points)
    if k == 2:
        d[middle[:, 0]] = height * normal
        return d
    facet = np.broadcast_to(np.arange(len(facets))[:, None], middle.shape).ravel()
    order = np.argsort(middle.ravel(), kind="stable")
    node, begin, count = np.unique(middle.ravel()[order], return_index=True, return_counts=True)
    pair = order[begin[count == 2][:, None] + np.arange(2)]
    d[node[count == 2]] = _between(height.ravel()[pair], normal[facet[pair]])
    return d


def _between(height: FloatArray, normal: FloatArray) -> FloatArray:
    """d (n, 3) of (1) for the heights (n, 2) [m] over two facets with the normals (n, 2, 3)."""
    cosine = np.einsum("nd,nd->n", normal[:, 0], normal[:, 1])
    smooth, back = cosine >= ROUND, cosine <= -ROUND
    sine_square = np.where(smooth | back, 1.0, 1.0 - cosine**2)
    aside = normal - cosine[:, None, None] * normal[:, ::-1]  # of a facet along an axis 0 to the last digit, so that it stays flat
    sharp = np.einsum("nf,nfd->nd", height / sine_square[:, None], aside)
    mean = normal.sum(axis=1)
    one = np.where(height.prod(axis=1) > 0, height.mean(axis=1), 0.0) / np.maximum(np.linalg.norm(mean, axis=1), 1e-300)
    return np.asarray(np.where(smooth[:, None], one[:, None] * mean, np.where(back[:, None], 0.0, sharp)))


def _interpolated(edge: FloatArray, cells: IntArray, cell: CellType) -> FloatArray:
    """Displacements (nn, d) of all nodes by (2) from those of the middles of edges."""
    d = edge.copy()
    places = list(enumerate(cell.middles, cell.corners))
    for node, corners in places:
        if len(corners) == 2:
            continue
        own = [place for place, ends in places if len(ends) == 2 and set(ends) <= set(corners)]
        faces = [place for place, ends in places if len(ends) == 4 and len(corners) == 8]
        total = edge[cells[:, own]].sum(axis=1)
        d[cells[:, node]] = 0.5 * d[cells[:, faces]].sum(axis=1) - 0.25 * total if faces else 0.5 * total
    return d


def _normals(x: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Unit normals (nf, d) of facets with the corners x (nf, k, d) [m], and sizes (nf,) [m], the square root of the area, 2D the length."""
    if x.shape[2] == 2:
        tangent = x[:, 1] - x[:, 0]
        area = np.stack([tangent[:, 1], -tangent[:, 0]], axis=1)
    else:
        area = 0.5 * np.cross(x[:, 2] - x[:, 0], x[:, 3 % x.shape[1]] - x[:, 1])
    measure = np.linalg.norm(area, axis=1)
    normal = area / np.maximum(measure, 1e-300)[:, None]
    return normal, measure if x.shape[2] == 2 else np.sqrt(measure)
