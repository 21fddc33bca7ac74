"""Curved surfaces made of facets: the normal of a contact is interpolated between the means at the facet's corners, without jumps.

With facet normals what slides over a curved surface of facets is thrown about: at each edge the normal jumps by the angle between the
facets, however small the steps are. Interpolated over the foot's weights, N = sum_k w_k n_k / |.|, it is continuous and off the surface's
normal by O(h^2) instead of O(h). The foot stays that of the facet, and the gap is (vertex - foot) . N: zero where the vertex lies on the
facet. On flat faces nothing changes. From that gap is taken how far the surface bulges over its facets there (`bulges`), so that bodies
which fit each other with other facets each have no gaps between them, and N is the gradient of the gap on circles.

Facets belong to one curved patch where they meet at less than `ROUND`, of bodies named as curved at less than `SMOOTH`; over sharper edges
nothing is smoothed. What truly rolls takes exact shapes (`fcsim.contact_detection.exact`): vertices stay where they are.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.contact_detection.general._smoothing_kernels import interpolated_normals
from fcsim.contact_detection.general.edges import EdgeContacts
from fcsim.contact_detection.general.vertices import SAME_PLACE, VertexContacts
from fcsim.contact_detection.skin.skin import Shape, Skin
from fcsim.mesh.curves.bulges import LEVEL_OF_NORMALS, bulges, heights

OPPOSED = -0.7
"""The cosine between two faces that bear each other is below it."""


def smoothed(skin: Skin, shape: Shape, found: VertexContacts, curved: BoolArray, patch: IntArray) -> VertexContacts:
    """The contacts with interpolated normals and the gaps along them; curved (nb,): the bodies that have them, within a patch (nf,)."""
    if not curved.any() or not len(found.gap):
        return found
    changed, normal = interpolated_normals(
        found.facet, found.weights, curved[skin.facet_body], shape.point, shape.normal, skin.facets, skin.sides, patch,
        skin.star, skin.first_star,
    )  # fmt: skip
    if not changed.any():
        return found
    foot = np.einsum("ck,ckd->cd", found.weights[changed], shape.point[skin.facets[found.facet[changed]]])
    arm = shape.point[found.vertex[changed]] - foot
    along, gap = found.normal.copy(), found.gap.copy()
    along[changed] = normal[changed]
    gap[changed] = np.einsum("cd,cd->c", arm, normal[changed])
    return found._replace(normal=along, gap=gap)


def smoothed_faces(skin: Skin, shape: Shape, found: EdgeContacts, within: IntArray, curved: BoolArray, patch: IntArray) -> EdgeContacts:
    """The same of sharp edges across the edges `within` faces, sorted: the face's normal there is interpolated along its edge."""
    row, side = np.nonzero(np.isin(found.edges, within))
    edge, place = found.edges[row, side], found.place[row, side]
    facet, ends = skin.edge_facets[edge, 0], skin.edges[edge]
    if not curved[skin.facet_body[facet]].any():
        return found
    corner = skin.facets[facet]
    weights = (corner == ends[:, :1]) * (1.0 - place)[:, None] + (corner == ends[:, 1:]) * place[:, None]
    changed, outwards = interpolated_normals(
        facet, weights * skin.real[facet], curved[skin.facet_body], shape.point, shape.normal, skin.facets, skin.sides, patch,
        skin.star, skin.first_star,
    )  # fmt: skip
    row, side, outwards = row[changed], side[changed], outwards[changed]
    along, gap = found.normal.copy(), found.gap.copy()
    along[row] = np.where(side == 1, 1.0, -1.0)[:, None] * outwards  # from the second body to the first
    gap[row] *= np.einsum("cd,cd->c", along[row], found.normal[row])
    return found._replace(normal=along, gap=gap)


def of_both_sides(skin: Skin, shape: Shape, found: VertexContacts, met: IntArray, curved: BoolArray, patch: IntArray) -> VertexContacts:
    """The contacts with the mean of both surfaces' normals, and the gaps along it, where a vertex among those `met` lies on a vertex of
    another curved body: neither surface is more the other one's than it is its own, and the order of the bodies says nothing."""
    corner = found.weights.argmax(axis=1)
    rows = np.flatnonzero(np.isin(found.vertex, met) & (found.weights.max(axis=1, initial=0.0) > 1.0 - SAME_PLACE))
    rows = rows[curved[skin.vertex_body[found.vertex[rows]]] & curved[skin.facet_body[found.facet[rows]]]]
    if not len(rows):
        return found
    vertex, N = found.vertex[rows], found.normal[rows]
    own, count = np.full(len(rows), -1), np.diff(skin.first_star)[vertex]
    least = np.full(len(rows), OPPOSED)
    for k in range(int(count.max())):  # the facets around a vertex are few
        around = skin.star[np.minimum(skin.first_star[vertex] + k, len(skin.star) - 1)]
        along = np.where(k < count, np.einsum("cd,cd->c", shape.normal[around], N), 1.0)
        own, least = np.where(along < least, around, own), np.minimum(along, least)
    known = own >= 0
    rows, vertex, N, own = rows[known], vertex[known], N[known], own[known]
    at = (skin.facets[own] == vertex[:, None]) & skin.real[own]
    changed, interpolated = interpolated_normals(
        own, at.astype(np.float64), curved[skin.facet_body], shape.point, shape.normal, skin.facets, skin.sides, patch,
        skin.star, skin.first_star,
    )  # fmt: skip
    between = N - np.where(changed[:, None], interpolated, shape.normal[own])
    between /= np.linalg.norm(between, axis=1)[:, None]
    off = (np.abs(between - N) > LEVEL_OF_NORMALS).any(axis=1)
    rows, vertex, between = rows[off], vertex[off], between[off]
    normal, gap = found.normal.copy(), found.gap.copy()
    arm = shape.point[vertex] - shape.point[skin.facets[found.facet[rows], corner[rows]]]
    normal[rows], gap[rows] = between, np.einsum("cd,cd->c", arm, between)
    return found._replace(normal=normal, gap=gap)


def bulges_of_skin(
    skin: Skin, reference: Shape, curved: BoolArray, patch: IntArray, of: Callable[..., FloatArray | None] = bulges
) -> FloatArray | None:
    """`bulges` (nf, 4, 4) [m], or a rule like it, of the bodies (nb,) that are curved, by their patches (nf,); None where all is flat."""
    own = np.flatnonzero(curved[skin.facet_body])
    width, d = (2, 2) if skin.dimension == 2 else (4, 3)
    shape = reference.point[:, :d], reference.normal[own, :d], reference.size[own]
    found = of(skin.facets[own, :width], skin.sides[own], *shape, patch[own])
    if found is None:
        return None
    every = np.zeros((len(skin.facets), 4, 4))
    every[own, :width, :width] = found
    return every


def bulge_of(
    skin: Skin, shape: Shape, bulge: FloatArray | None, patch: IntArray, vertices: VertexContacts, edges: EdgeContacts
) -> FloatArray | None:
    """How far (nc,) [m] along the contacts' normals surfaces are over their facets at vertices on facets, then at edges; None: flat.

    Where an edge joins facets of one patch (nf,) that is the mean of both heights. Along a sharp one, the rim of a cylinder's end, the
    true edge is off the chord by d in the span of both normals, d . n_f = b_f and d . n_g = b_g, and d along the contact's normal counts.
    """
    if bulge is None:
        return None
    at_vertices, at_edges = heights(bulge, vertices.facet, vertices.weights), np.zeros(len(edges.gap))
    at_vertices *= np.einsum("cd,cd->c", vertices.normal, shape.normal[vertices.facet])
    for k, outwards in enumerate((-edges.normal, edges.normal)):
        ends, s = skin.edges[edges.edges[:, k]], edges.place[:, k]
        pair = skin.edge_facets[edges.edges[:, k]].T
        b = []
        for facet in pair:
            on_edge = [(skin.facets[facet] == ends[:, j, None]) & skin.real[facet] for j in range(2)]
            b.append(heights(bulge, facet, np.where(on_edge[0], 1.0 - s[:, None], np.where(on_edge[1], s[:, None], 0.0))))
        n = shape.normal[pair]
        towards = np.einsum("fcd,cd->fc", n, outwards)
        c = np.einsum("cd,cd->c", *n)
        sharp = patch[pair[0]] != patch[pair[1]]
        across = (b[0] - c * b[1]) * towards[0] + (b[1] - c * b[0]) * towards[1]
        at_edges += np.where(sharp, across / np.where(sharp, 1.0 - c * c, 1.0), 0.5 * (b[0] + b[1]))
    return np.concatenate([at_vertices, at_edges])
