"""The closed skins of a model's bodies: all boundary facets, whatever surfaces are named, cut into triangles, each body's in a tree."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.assembly.model import Model
from fcsim.errors import InputError
from fcsim.mesh.cell_type import CELL_TYPES
from fcsim.mesh.exact_shape import ExactShape
from fcsim.mesh.facets import match_facets
from fcsim.mesh.order.linear_facets import linear_facets
from fcsim.mesh.part import Body, Part, Placed, RigidBody
from fcsim.witness._distance_kernels import Forest
from fcsim.witness._overlap_kernels import refit, with_means
from fcsim.witness.exact_overlap import ExactBodies, exact_bodies
from fcsim.witness.folding import NONE, Folding, folding, is_convex
from fcsim.witness.tree import build_trees

FLAT = 1e-2  # [rad] an edge that bends its skin less is no edge: what pierces there is no deeper than FLAT / 8 of a facet
_FEW = 60  # facets of a body whose centres are looked at too
_PRISM = 50.0  # half the height of the prism that a 2D outline becomes, relative to its size: its open ends are far away


class Skin(NamedTuple):
    """The skin of one body in its own node numbers: facets (nf, k) with -1 in place of a triangle's fourth node; edges (ne, 2) that
    bend it; closed: every edge (2D: node) joins two facets, which go around it the same way."""

    facets: IntArray
    edges: IntArray
    closed: bool


class Skins(NamedTuple):
    """The skins of all bodies as triangles of one list of points.

    The points are the model's nodes; in 3D the centres of quadrilaterals of deformable bodies, which cut them into four triangles
    whichever way they warp; in 2D the nodes moved down and up by `prism`, between which an outline becomes the wall of a prism.
    mean (nq, 4): nodes whose means the centres are; triangles (nt, 3), vertices (nv,), edges (ne, 2): point numbers, body after body;
    among the vertices are the centres of facets so few and large that flush bodies have no node between their sides
    first_vertex, first_edge (nbodies + 1,); begin, end, child, roots: the trees, see `_distance_kernels`, roots -1 without a skin
    size (nbodies,) [m]: smallest extent in the reference configuration; infinity without a skin; closed (nbodies,)
    movable (nbodies,): not held completely by supports; exact: the bodies of exact shape; folding: the bodies that may overlap themselves
    without (n,): pairs of bodies whose overlap is not measured, lower * nbodies + higher
    modulus: points with the same number modulo this are one node, as in 2D its three in the prism
    """

    dimension: int
    prism: float
    mean: IntArray
    triangles: IntArray
    vertices: IntArray
    first_vertex: IntArray
    edges: IntArray
    first_edge: IntArray
    begin: IntArray
    end: IntArray
    child: IntArray
    roots: IntArray
    size: FloatArray
    closed: BoolArray
    movable: BoolArray
    exact: ExactBodies
    modulus: int
    folding: Folding = NONE
    without: IntArray = np.empty(0, dtype=np.int64)

    def forest(self, positions: FloatArray) -> Forest:
        """The trees at the nodes' positions (n_nodes, d) [m]."""
        points = self.points(positions)
        low, high = np.empty((len(self.begin), 3)), np.empty((len(self.begin), 3))
        refit(points, self.triangles, self.begin, self.end, self.child, low, high)
        return Forest(points, self.triangles, low, high, self.begin, self.end, self.child, self.roots)

    def points(self, positions: FloatArray) -> FloatArray:
        """All points (np, 3) [m] for the nodes' positions (n_nodes, d) [m]."""
        if self.dimension == 3:
            return with_means(positions, self.mean) if len(self.mean) else np.ascontiguousarray(positions)
        n = len(positions)
        points = np.zeros((3 * n, 3))
        points[:, :2] = np.tile(positions, (3, 1))
        points[n : 2 * n, 2], points[2 * n :, 2] = -self.prism, self.prism
        return points


def skin_of(body: Body | RigidBody) -> Skin:
    """Return the skin of a body: the facets of its cells that bound it, or of a rigid body all its surfaces, each facet once."""
    if isinstance(body, Body):
        facets = boundary_facets(body.part)
        points = body.part.points
    else:
        width = max((f.shape[1] for f in body.surfaces.values()), default=body.dimension)
        all_facets = [np.pad(f, ((0, 0), (0, width - f.shape[1])), constant_values=-1) for f in body.surfaces.values()]
        facets = np.concatenate([*all_facets, np.empty((0, width), dtype=np.int64)])
        facets = facets[np.unique(np.sort(facets, axis=1), axis=0, return_index=True)[1]]
        points = body.points
    return _skin(facets, points)


def boundary_facets(part: Part) -> IntArray:
    """Facets (nf, k) of a part's cells that belong to one cell, outwards; those of second order cut at their nodes."""
    cell = CELL_TYPES[part.cell_type]
    facets = part.cells[:, cell.facets].reshape(-1, cell.facet_size)
    _, first, count = np.unique(np.sort(facets, axis=1), axis=0, return_index=True, return_counts=True)
    return linear_facets(facets[np.sort(first[count == 1])], cell)


def _skin(facets: IntArray, points: FloatArray) -> Skin:
    """Edges and closedness of facets; nodes at one place count as one, as in a surface of pieces."""
    if not len(facets):
        return Skin(facets, np.empty((0, 2), dtype=np.int64), False)
    scale = 1e-9 * float(np.ptp(points, axis=0).max()) or 1.0
    _, place = np.unique(np.round(points / scale), axis=0, return_inverse=True)
    place = place.ravel()
    if points.shape[1] == 2:
        balanced = np.array_equal(np.sort(place[facets[:, 0]]), np.sort(place[facets[:, 1]]))
        return Skin(facets, facets, balanced)
    corners = np.where(facets < 0, facets[:, :1], facets)
    start, stop = corners.ravel(), np.roll(corners, -1, axis=1).ravel()
    facet = np.repeat(np.arange(len(corners)), corners.shape[1])
    real = place[start] != place[stop]
    start, stop, facet = start[real], stop[real], facet[real]
    a, b = place[start], place[stop]
    key = np.minimum(a, b) * len(points) + np.maximum(a, b)
    order = np.argsort(key, kind="stable")
    _, first, count = np.unique(key[order], return_index=True, return_counts=True)
    turn = np.add.reduceat(np.where(a < b, 1, -1)[order], first)
    normal = _normals(points[corners])
    pair = order[first], order[np.minimum(first + 1, len(order) - 1)]
    bend = np.einsum("nd,nd->n", normal[facet[pair[0]]], normal[facet[pair[1]]]) < np.cos(FLAT)
    chosen = order[first[bend | (count != 2)]]
    return Skin(facets, np.stack([start[chosen], stop[chosen]], axis=1), bool(np.all(turn == 0)))


def _normals(corners: FloatArray) -> FloatArray:
    """Unit normals (nf, 3) of facets (nf, k, 3)."""
    area = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3 % corners.shape[1]] - corners[:, 1])
    return area / np.maximum(np.linalg.norm(area, axis=1), 1e-300)[:, None]


def volume(skin: Skin, points: FloatArray) -> float:
    """Volume [m^3] (2D: area [m^2]) within a closed skin; negative where it is inside out."""
    x = points - points[skin.facets[0, 0]]
    if points.shape[1] == 2:
        a, b = x[skin.facets[:, 0]], x[skin.facets[:, 1]]
        return 0.5 * float(np.sum(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]))
    t = x[_fan(skin.facets)]
    return float(np.einsum("nd,nd->", t[:, 0], np.cross(t[:, 1], t[:, 2]))) / 6


def _fan(facets: IntArray) -> IntArray:
    """Triangles of facets (nf, 3 or 4), quadrilaterals cut in two."""
    if facets.shape[1] == 3:
        return facets
    return np.concatenate([facets[:, [0, 1, 2]], facets[facets[:, 3] >= 0][:, [0, 2, 3]]])


def smallest_extent(points: FloatArray) -> float:
    """The smallest extent [m] of points (n, d), along their principal axes or those of space."""
    axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2] if len(points) > 1 else np.eye(points.shape[1])
    return float(min(np.ptp(points, axis=0).min(), np.ptp(points @ axes.T, axis=0).min()))


def inside_out(bodies: Sequence[Body | RigidBody], skins: Sequence[Skin]) -> None:
    """InputError naming a body whose closed skin, or whose named surface on its cells, faces inwards: contacts would pass through it."""
    checked: set[int] = set()
    for body, skin in zip(bodies, skins, strict=True):
        if isinstance(body, RigidBody):
            if skin.closed and volume(skin, body.points) < 0:
                raise InputError(
                    f"body {body.name!r}: expected surfaces that face outwards, got a closed skin inside out: reverse the nodes' order"
                )
            continue
        part = body.part
        if id(part) in checked:
            continue
        checked.add(id(part))
        for name, facets in part.surfaces.items():
            if not len(facets):
                continue
            count, oriented = match_facets(part.cells, part.cell_type, facets)
            corners = skin.facets.shape[1]
            same = np.einsum("nd,nd->n", _area(part.points[facets[:, :corners]]), _area(part.points[oriented[:, :corners]])) > 0
            if np.any(wrong := (count == 1) & ~same):
                raise InputError(
                    f"body {body.name!r}, surface {name!r}: expected facets that face outwards, got {np.count_nonzero(wrong)} of "
                    f"{len(facets)} inside out: reverse the order of their nodes (fcsim.mesh.facets.orient_facets does)"
                )


def _shape(body: Body | RigidBody) -> ExactShape | None:
    return body.shape if isinstance(body, RigidBody) else None


def _area(corners: FloatArray) -> FloatArray:
    if corners.shape[2] == 2:
        return corners[:, 1] - corners[:, 0]
    return np.cross(corners[:, 2] - corners[:, 0], corners[:, 3 % corners.shape[1]] - corners[:, 1])


def skins_of(model: Model) -> tuple[Skins, tuple[Skin, ...]]:
    """Return the skins of a model's bodies, together and one by one; a part's is found once. InputError: see `inside_out`."""
    known: dict[int, Skin] = {}
    single = []
    for body in model.bodies:
        key = id(body.part) if isinstance(body, Body) else id(body)
        if key not in known:
            known[key] = skin_of(body)
        single.append(known[key])
    inside_out(model.bodies, single)
    together = _joined(model, single)
    return together._replace(folding=_folding(model, together, single)), tuple(single)


def _folding(model: Model, together: Skins, skins: Sequence[Skin]) -> Folding:
    """The deformable bodies that are not convex and not held completely, with their thickness in the reference configuration."""
    convex: dict[int, bool] = {}
    chosen = []
    for k, (body, skin) in enumerate(zip(model.bodies, skins, strict=True)):
        if not (isinstance(body, Body) and skin.closed and together.movable[k]):
            continue
        if id(body.part) not in convex:
            used = np.unique(skin.facets[skin.facets >= 0])
            convex[id(body.part)] = is_convex(body.part.points[used], volume(skin, body.part.points))
        if not convex[id(body.part)]:
            chosen.append(k)
    if not chosen:
        return NONE
    vertices = [together.vertices[together.first_vertex[k] : together.first_vertex[k + 1]] for k in chosen]
    return folding(chosen, vertices, [float(together.size[k]) for k in chosen], together.forest(model.reference), together.modulus)


def _triangles(facets: IntArray, middle: IntArray, body: Placed, n: int) -> IntArray:
    """(t, 3) corners of a body's facets: in 2D two of each segment's strip in space, whose other side has numbers n larger; of facets with
    four nodes of deformable bodies four about their middle; of others a fan."""
    if facets.shape[1] == 2:
        a, b = facets.T
        return np.concatenate([np.stack([n + a, n + b, 2 * n + b], axis=1), np.stack([n + a, 2 * n + b, 2 * n + a], axis=1)])
    if isinstance(body, Body) and facets.shape[1] == 4:
        return np.concatenate([np.stack([facets[:, i], facets[:, (i + 1) % 4], middle], axis=1) for i in range(4)])
    return _fan(facets)


def _joined(model: Model, skins: Sequence[Skin]) -> Skins:
    driven = np.bincount(np.searchsorted(model.dof_offset, model.driven_dofs, side="right") - 1, minlength=len(skins))
    d, n, offset = model.dimension, model.n_nodes, model.node_offset
    prism = _PRISM * float(np.ptp(model.reference, axis=0).max())
    none = np.empty(0, dtype=np.int64)
    triangles, mean, sizes, vertices = [], [], [], []
    centres = n
    roots = np.full(len(skins), -1)
    points_of = [model.reference[offset[k] : offset[k + 1]] for k in range(len(skins))]
    for k, (skin, body) in enumerate(zip(skins, model.bodies, strict=True)):
        used = np.unique(skin.facets[skin.facets >= 0])
        sizes.append(smallest_extent(points_of[k][used]) if skin.closed else shape.size if (shape := _shape(body)) else np.inf)
        if not skin.closed:
            vertices.append(none)
            continue
        facets = np.where(skin.facets < 0, -1, skin.facets + offset[k])
        flush = d == 3 and len(facets) <= _FEW
        middle = centres + np.arange(len(facets))
        if flush or (d == 3 and isinstance(body, Body) and facets.shape[1] == 4):
            mean.append(facets if facets.shape[1] == 4 else facets[:, [0, 1, 2, 2]])
            mean[-1] = np.where(mean[-1] < 0, mean[-1][:, :1], mean[-1])
            centres += len(facets)
        vertices.append(np.concatenate([np.unique(facets[facets >= 0]), middle[: len(facets) if flush else 0]]))
        triangles.append(_triangles(facets, middle, body, n))
    counts = np.array([len(t) for t in triangles], dtype=np.int64)
    all_means, corners = np.concatenate([none.reshape(0, 4), *mean]), np.concatenate([none.reshape(0, 3), *triangles])
    where = np.concatenate([model.reference, model.reference[all_means].mean(axis=1)])
    centre = np.pad(where[corners % n if d == 2 else corners].mean(axis=1), ((0, 0), (0, 3 - d)))
    order, begin, end, child = build_trees(centre, counts)
    roots[[k for k, skin in enumerate(skins) if skin.closed]] = np.arange(len(counts))
    edges = [s.edges + o if s.closed else none.reshape(0, 2) for s, o in zip(skins, offset, strict=False)]
    return Skins(
        dimension=d,
        prism=prism,
        mean=all_means,
        triangles=corners[order],
        vertices=np.concatenate([none, *vertices]),
        first_vertex=np.cumsum([0, *map(len, vertices)]),
        edges=np.concatenate([none.reshape(0, 2), *edges]),
        first_edge=np.cumsum([0, *map(len, edges)]),
        begin=begin,
        end=end,
        child=child,
        roots=roots,
        size=np.array(sizes),
        closed=np.array([s.closed or _shape(b) is not None for s, b in zip(skins, model.bodies, strict=True)]),
        exact=exact_bodies(model),
        movable=driven < np.diff(model.dof_offset),
        modulus=n if d == 2 else np.iinfo(np.int64).max,
    )
