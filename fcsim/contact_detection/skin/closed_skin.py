"""From boundary facets to a `Skin`: who borders whom, and refusal of what does not enclose a body."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.contact_detection.skin._shape_kernels import facet_geometry
from fcsim.contact_detection.skin.blunt_edges import blunt
from fcsim.contact_detection.skin.boundary import Boundary
from fcsim.contact_detection.skin.skin import BENT, FLAT, SMOOTH, Skin
from fcsim.errors import InputError
from fcsim.mesh.curves.patches import ROUND


def closed_skin(boundary: Boundary, positions: FloatArray, names: Sequence[str]) -> Skin:
    """Return the skin of the bodies `names` at the reference positions (n_nodes, d) [m].

    InputError naming the body: a surface that is open, that is crossed by a third sheet, whose facets do not agree on what is outside, or
    that is inside out.
    """
    d, nb = positions.shape[1], len(names)
    node, vertex = np.unique(boundary.facets, return_inverse=True)
    vertex = vertex.reshape(boundary.facets.shape) - int(node[0] < 0)
    node = node[node >= 0]
    facets = np.where(boundary.facets < 0, vertex[:, :1], vertex)
    if d == 2:
        facets = facets[:, [0, 1, 1, 0]]
    facets = np.ascontiguousarray(facets)  # else by columns where one body's are: each kernel would be compiled twice
    real = np.arange(4) < boundary.sides[:, None]
    vertex_body = np.zeros(len(node), dtype=np.int64)
    vertex_body[facets[real]] = np.broadcast_to(boundary.body[:, None], facets.shape)[real]
    points = np.pad(positions[node], ((0, 0), (0, 3 - d)))
    normal, centre, size = facet_geometry(points, facets, boundary.sides)
    _refuse_without_area(size, points[facets], boundary, names)
    neighbours = _edges(facets, boundary, names, node) if d == 3 else _joints(facets, boundary, names, node)
    _refuse_inside_out(normal, centre, size, boundary, names, d)
    edges, edge_facets, facet_edges = neighbours
    first, second = edge_facets.T
    cosine = np.einsum("ed,ed->e", normal[first], normal[second])
    rises = np.einsum("ed,ed->e", centre[second] - centre[first], normal[first] - normal[second])
    convex = rises < 0
    smooth = cosine > SMOOTH
    patch = _patches(edge_facets[cosine > ROUND], len(facets))
    edges_alone = blunt(facets, boundary.sides, normal, edge_facets, cosine, patch)
    rough = np.zeros(len(node), dtype=bool)
    rough[edges[~smooth]] = True
    order = np.argsort(facets[real], kind="stable")
    owner = np.broadcast_to(np.arange(len(facets))[:, None], facets.shape)[real]
    return Skin(
        dimension=d,
        node=node,
        vertex_body=vertex_body,
        first_vertex=np.searchsorted(vertex_body, np.arange(nb + 1)),
        facets=facets,
        sides=boundary.sides,
        facet_body=boundary.body,
        first_facet=np.searchsorted(boundary.body, np.arange(nb + 1)),
        edges=edges,
        edge_facets=edge_facets,
        first_edge=np.searchsorted(boundary.body[first], np.arange(nb + 1)),
        facet_edges=facet_edges,
        sharp=convex & (cosine < FLAT),
        smooth=smooth,
        star=owner[order],
        first_star=np.searchsorted(facets[real][order], np.arange(len(node) + 1)),
        side=_patches(edge_facets[smooth], len(facets)),
        patch=_patches(edge_facets[(cosine > ROUND) & ~edges_alone], len(facets)) if edges_alone.any() else patch,
        smooth_vertex=~rough,
    )


def faces_of(skin: Skin, normal: FloatArray, curved: BoolArray, patch: IntArray) -> IntArray:
    """Numbers (nf,) of what is one face: facets that meet at less than `BENT`, normal (nf, 3), and on the bodies (nb,) that are curved
    those of one patch (nf,), chords of a curve."""
    first, second = skin.edge_facets.T
    one = np.einsum("ed,ed->e", normal[first], normal[second]) > BENT
    one |= curved[skin.facet_body[first]] & (patch[first] == patch[second])
    return _patches(skin.edge_facets[one], len(skin.facets))


def _patches(pairs: IntArray, count: int) -> IntArray:
    """Number of the patch of each of `count` facets, those that pairs (n, 2) connect."""
    graph = csr_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    return connected_components(graph, directed=False)[1].astype(np.int64)


def _edges(facets: IntArray, boundary: Boundary, names: Sequence[str], node: IntArray) -> tuple[IntArray, IntArray, IntArray]:
    """Edges (ne, 2) sorted by body, their two facets (ne, 2), and the edge of each side of a facet (nf, 4)."""
    real = np.arange(4) < boundary.sides[:, None]
    following = np.where(np.arange(4) == boundary.sides[:, None] - 1, facets[:, :1], np.roll(facets, -1, axis=1))
    start, end = facets[real], following[real]
    facet, side = (np.broadcast_to(k, facets.shape)[real] for k in (np.arange(len(facets))[:, None], np.arange(4)))
    key = np.minimum(start, end) * len(node) + np.maximum(start, end)
    order = np.lexsort((start > end, key))
    _, begin, count = np.unique(key[order], return_index=True, return_counts=True)
    wrong = count != 2
    if wrong.any():
        _refuse(
            wrong, count, boundary.body[facet[order[begin]]], names, node[start[order[begin]]], node[end[order[begin]]], "edge", "facets"
        )
    one, two = order[begin], order[begin + 1]
    alike = start[one] == start[two]
    if alike.any():
        row = one[np.argmax(alike)]
        raise InputError(
            f"contact of everything, body {names[boundary.body[facet[row]]]!r}: expected facets whose normals all point outwards, got "
            f"neighbours that disagree, at the edge of nodes {node[start[row]]} and {node[end[row]]}"
        )
    by_body = np.argsort(boundary.body[facet[one]], kind="stable")
    one, two = one[by_body], two[by_body]
    facet_edges = np.full(facets.shape, -1)
    facet_edges[facet[one], side[one]] = facet_edges[facet[two], side[two]] = np.arange(len(one))
    return np.column_stack([start[one], end[one]]), np.column_stack([facet[one], facet[two]]), facet_edges


def _joints(facets: IntArray, boundary: Boundary, names: Sequence[str], node: IntArray) -> tuple[IntArray, IntArray, IntArray]:
    """The same in 2D, where two segments meet in a vertex: an edge is (v, v), side 0 of a segment begins and side 1 ends in it."""
    start, end = facets[:, 0], facets[:, 1]
    count = np.bincount(facets[:, :2].ravel(), minlength=len(node))
    body = np.zeros(len(node), dtype=np.int64)
    body[start], body[end] = boundary.body, boundary.body
    wrong = count != 2
    if wrong.any():
        _refuse(wrong, count, body, names, node, node, "point", "segments")
    twice = np.bincount(start, minlength=len(node)) != 1
    if twice.any():
        raise InputError(
            f"contact of everything, body {names[body[np.argmax(twice)]]!r}: expected segments whose normals all point outwards, got "
            f"neighbours that disagree, at node {node[np.argmax(twice)]}"
        )
    vertex = np.arange(len(node))
    after, before = np.empty_like(vertex), np.empty_like(vertex)
    after[start], before[end] = np.arange(len(facets)), np.arange(len(facets))
    facet_edges = np.full(facets.shape, -1)
    facet_edges[:, 0], facet_edges[:, 1] = start, end
    return np.column_stack([vertex, vertex]), np.column_stack([before, after]), facet_edges


def _refuse(
    wrong: BoolArray, count: IntArray, body: IntArray, names: Sequence[str], a: IntArray, b: IntArray, kind: str, parts: str
) -> None:
    """InputError that names a body whose surface does not enclose it."""
    row = int(np.argmax(wrong))
    own = wrong & (body == body[row])
    what = "open" if count[row] == 1 else "not a single sheet"
    where = f"nodes {a[row]} and {b[row]}" if kind == "edge" else f"node {a[row]}"
    raise InputError(
        f"contact of everything, body {names[body[row]]!r}: expected a closed surface, two {parts} at each {kind}, got one that is {what}: "
        f"{np.count_nonzero(own)} {kind}s with another number, the first with {count[row]} at {where}"
    )


def _refuse_without_area(size: FloatArray, corners: FloatArray, boundary: Boundary, names: Sequence[str]) -> None:
    extent = np.ptp(corners, axis=1).max(axis=1, initial=0.0)
    bad = ~(size > 1e-7 * extent)
    if bad.any():
        row = int(np.argmax(bad))
        raise InputError(
            f"contact of everything, body {names[boundary.body[row]]!r}: expected facets of positive area, got area "
            f"{size[row] ** 2:.3g} at nodes {boundary.facets[row, : boundary.sides[row]].tolist()}"
        )


def _refuse_inside_out(
    normal: FloatArray,
    centre: FloatArray,
    size: FloatArray,
    boundary: Boundary,
    names: Sequence[str],
    d: int,
) -> None:
    """A closed surface whose normals point outwards encloses int x . n / d > 0."""
    middle = np.stack([np.bincount(boundary.body, centre[:, i], len(names)) for i in range(3)], axis=1)
    middle /= np.maximum(np.bincount(boundary.body, minlength=len(names)), 1)[:, None]
    flux = np.einsum("fd,fd->f", centre - middle[boundary.body], normal) * size ** (d - 1)
    volume = np.bincount(boundary.body, flux, len(names)) / d
    if np.any(volume <= 0):
        body = int(np.argmax(volume <= 0))
        raise InputError(
            f"contact of everything, body {names[body]!r}: expected a surface whose normals point out of the body, got one inside out "
            f"(it encloses {volume[body]:.3g} m^{d})"
        )
