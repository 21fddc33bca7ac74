"""Bodies that may meet themselves: which they are, and what of them is apart by void and not by their own material.

Two places of one surface can touch where void lies between them in the reference configuration. Between the two faces of a plate, thinner
than the alert distance though it may be, lies material: it is strained, never closed. So

* a convex body never meets itself, nor one whose facets nowhere see each other at more than 60 degrees (a voussoir): nothing is looked at;
* a vertex does not touch the facets around it, nor an edge the edges that share its ends;
* a vertex touches facets that its surroundings face only, as the two sides of a slot do and neighbours on one side do not;
* a vertex and a facet that were neighbours in the reference configuration, no farther apart than 1.5 times what is looked at, touch only
  if they lay before each other there, as the sides of a slot or of a crack do.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.contact_detection.general._folding_kernels import across_void, edges_across_void, sees_itself
from fcsim.contact_detection.general.near import Lengths, NearBodies
from fcsim.contact_detection.skin.skin import Shape, Skin

_NEIGHBOURS = 1.5
_LEVEL = 1e-6  # of a facet: what rises less is level
_MANY = 20_000  # facets: more are not asked whether they see each other, which is but a saving


def folding_bodies(skin: Skin, reference: Shape, kind: Sequence[object | None]) -> IntArray:
    """Numbers of the bodies that may meet themselves; kind (nb,): None for bodies that do not deform, the same object for equal bodies."""
    concave = ~skin.sharp & ~_flat(skin, reference)
    known: dict[int, bool] = {}
    for body, of in enumerate(kind):
        if of is None or id(of) in known:
            continue
        first, last = skin.first_facet[body : body + 2]
        known[id(of)] = bool(concave[skin.first_edge[body] : skin.first_edge[body + 1]].any()) and (
            last - first > _MANY
            or sees_itself(first, last, reference.point, reference.normal, reference.centre, reference.size, skin.facets, skin.sides)
        )
    return np.array([body for body, of in enumerate(kind) if of is not None and known[id(of)]], dtype=np.int64)


def _flat(skin: Skin, reference: Shape) -> BoolArray:
    """Edges (ne,) between facets in one plane, and convex ones; not the tip of a crack."""
    one, other = skin.edge_facets.T
    ahead = np.einsum("ed,ed->e", reference.normal[one], reference.normal[other]) > 0
    rises = np.einsum("ed,ed->e", reference.centre[other] - reference.centre[one], reference.normal[one])
    level = _LEVEL * (reference.size[one] + reference.size[other])
    return (rises < -level) | ((rises <= level) & ahead)


def with_folding(near: NearBodies, bodies: IntArray, lengths: Lengths) -> NearBodies:
    """The pairs of bodies, and each of `bodies` with itself."""
    if not len(bodies):
        return near
    own = NearBodies(np.column_stack([bodies, bodies]), lengths.alert[bodies], lengths.depth[bodies], lengths.near[bodies])
    return NearBodies._make(np.concatenate(both) for both in zip(near, own, strict=True))


def deformation(point: FloatArray, move: FloatArray) -> FloatArray:
    """Motions (n, 3) [m] of a body's points (n, 3) without what moves and turns it as a whole (least squares, small rotation)."""
    arm = point - point.mean(axis=0)
    rest = move - move.mean(axis=0)
    moment = np.cross(arm, rest).sum(axis=0)
    inertia = np.einsum("nd,nd->", arm, arm) * np.eye(3) - arm.T @ arm
    return rest - np.cross(np.linalg.lstsq(inertia, moment, rcond=None)[0], arm)


def open_rows(
    vertex: IntArray, facet: IntArray, weights: FloatArray, reach: FloatArray, near: FloatArray, skin: Skin, shape: Shape, reference: Shape
) -> BoolArray:
    """Which rows (n,), a vertex and a facet of one body with the weights (n, 4) of its foot, may touch; reach, near (n,) [m]."""
    return across_void(
        vertex, facet, weights, _NEIGHBOURS * reach, near, shape.normal, shape.mean, reference.point, reference.normal,
        skin.facets, skin.star, skin.first_star,
    )  # fmt: skip


def open_edges(edges: IntArray, place: FloatArray, reach: FloatArray, near: FloatArray, skin: Skin, reference: Shape) -> BoolArray:
    """The same of pairs of edges (n, 2) of one body at places (n, 2) on them."""
    return edges_across_void(edges, place, _NEIGHBOURS * reach, near, reference.point, reference.normal, skin.edges, skin.edge_facets)
