"""Vertices of deformable bodies under spheres and the sides of capsules and cylinders that dent them.

The distance to a dented skin has a minimum in each of its facets, that to a flat one a single minimum: with minima alone a round body is
borne, over a step, by the facets that it touched first. Where facets are short beside the radius, their vertices take the place of the
minima on them; on longer ones what rolls would be kicked by the vertices that it passes.

Not so in a hollow, as of a ring around a shaft: its vertices lie behind its chords, which by themselves would bear as if the hollow were
narrower by their height. There the vertices of facets of any length take their place.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.contact_detection.exact.mesh_skin import MeshSkin, normals
from fcsim.contact_detection.exact.solids import Placed, Touch
from fcsim.contact_detection.surfaces.broad_phase import near_pairs
from fcsim.mesh.curves.ragged import each_of

FINE = 0.1  # of the radius: vertices all of whose facets are no longer touch
FITS = 0.9  # of the round body's curvature: in a hollow that is less curved it rolls, and would fall into each vertex
_SAG = 0.01  # of the height of a round body over a chord: vertices so near touch, and the facets around them are dented
_AROUND = 1.0  # of that height: minima so near on the facets around a vertex, it twice as far, lie round the body
_DEEP = 0.5  # of the radius: what lies deeper is another part of the body
_FACING = 0.5  # cosine between the way out and a facet around the vertex
_ROUND = 1e-9  # of a length


class Dents(NamedTuple):
    """touch: vertices under round bodies, gaps up to the alert; pressed (k,): solid * n_nodes + node of those that touch, ascending.

    close (m,): the same of those no farther than twice the height of the round body over a chord; near (m,) [m]: that height."""

    touch: Touch
    pressed: IntArray
    close: IntArray
    near: FloatArray


def vertices_under(now: Placed, skin: MeshSkin, x: FloatArray, alert: float) -> Dents:
    """Contacts of spheres, capsules and cylinders' sides with the vertices of deformable bodies at node positions x (n_nodes, d) [m].

    The identity is solid * vertices + vertex.
    """
    solids = now.solids
    chosen = solids.of("sphere", "capsule", "cylinder")
    soft = np.unique(skin.vertex[skin.deforms])
    reach = float((solids.radius + solids.half)[chosen].max(initial=0.0)) + alert
    i, j = near_pairs(now.centre[chosen], x[skin.vertices[soft]], np.full(len(soft), reach))
    k, v = chosen[i], soft[j]
    arm = x[skin.vertices[v]] - now.centre[k]
    along = np.einsum("nd,nd->n", arm, now.along[k])
    s = np.clip(along, -solids.half[k], solids.half[k])
    away = s[:, None] * now.along[k] - arm
    distance = np.linalg.norm(away, axis=1)
    gap = distance - solids.radius[k]
    flat = np.isin(k, solids.of("cylinder"))
    keep = (gap <= alert) & (gap > -_DEEP * solids.radius[k]) & (~flat | (np.abs(along) <= (1 + _ROUND) * solids.half[k]))
    k, v, s, away, distance, gap, flat = (array[keep] for array in (k, v, s, away, distance, gap, flat))
    direction = away / distance[:, None]
    end = np.where(s < 0, 1.0, -1.0)[:, None] * now.along[k]  # the way out by a cylinder's end
    facing, by_end, longest = around(skin, x, v, direction, end)
    fits = skin.hollow[v] * solids.radius[k] > FITS
    keep = ((longest <= FINE * solids.radius[k]) | fits) & (facing > _FACING) & (~flat | (facing >= by_end))
    k, v, s, direction, gap, longest = (array[keep] for array in (k, v, s, direction, gap, longest))
    node, radius = skin.vertices[v], solids.radius[k]
    key, height = k * len(x) + node, longest**2 / (8 * radius)
    pressed = np.unique(key[gap <= _SAG * height])
    close, first = np.unique(key[gap <= (1 + _AROUND) * height], return_index=True)
    near = _AROUND * height[gap <= (1 + _AROUND) * height][first]
    point = now.centre[k] + s[:, None] * now.along[k] - radius[:, None] * direction
    nodes, weights = np.full((len(v), x.shape[1]), -1), np.zeros((len(v), x.shape[1]))
    nodes[:, 0], weights[:, 0] = node, 1.0
    body = np.zeros(len(skin.vertices), dtype=np.int64)
    body[skin.vertex] = skin.body[:, None]
    bodies = np.stack([solids.body[k], body[v]], axis=1)
    identity = k * len(skin.vertices) + v
    touch = Touch(direction, point, x[node], solids.node[k], now.weights(k, point), nodes, weights, bodies, identity)
    return Dents(touch, pressed, close, near)


def beside(touch: Touch, dents: Dents, solids_of_body: IntArray, n_nodes: int) -> BoolArray:
    """Which minima (n,) stay beside these vertices: those that are not at one of them nor on a facet or edge that is dented.

    solids_of_body (n_bodies,): the numbers of bodies among the solids, -1 = none. Where the minima of as many facets around a vertex as
    there are directions are as near as the height over a chord, the skin is bent round the body, a flat one has one minimum. It would
    stay on the middles of its chords, its vertices that height off, which bends what is clamped there. Not only where such minima touch:
    what comes to lie round the body within a step would bear on the next two middles at each iterate, which are left out at the next.
    """

    def keys(t: Touch) -> IntArray:
        solid = solids_of_body[t.bodies[:, 0]][:, None]
        return np.where(t.master_node >= 0, solid * n_nodes + t.master_node, -1)

    corners = keys(touch)
    at_one = touch.master_weights > 1 - _ROUND
    own = np.isin(np.where(at_one, corners, -1), keys(dents.touch)[:, 0]).any(axis=1)
    within = np.where(at_one.any(axis=1)[:, None], -1, corners)
    place = np.minimum(np.searchsorted(dents.close, within), max(len(dents.close) - 1, 0))
    bears = np.zeros(place.shape, dtype=bool)
    if len(dents.close):
        bears = (dents.close[place] == within) & (touch.gap[:, None] <= dents.near[place])
    wrapped = dents.close[np.bincount(place[bears], minlength=len(dents.close)) >= touch.normal.shape[1]]
    return ~(own | np.isin(corners, np.concatenate([dents.pressed, wrapped])).any(axis=1))


def around(skin: MeshSkin, x: FloatArray, v: IntArray, direction: FloatArray, end: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Of facets around vertices v (n,): the largest cosines of normals with direction and with end (n, d); the longest side."""
    d = skin.facets.shape[1]
    corners, normal = x[skin.facets], normals(skin, x)
    length = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2).max(axis=1)
    facet = np.argsort(skin.vertex, axis=None, kind="stable") // d
    first = np.searchsorted(np.sort(skin.vertex, axis=None), np.arange(len(skin.vertices) + 1))
    count = first[v + 1] - first[v]
    row, place = each_of(first[v], count)
    f, start = facet[place], np.cumsum(count) - count
    if not len(v):
        return np.empty(0), np.empty(0), np.empty(0)
    cosines = (np.einsum("nd,nd->n", normal[f], way[row]) for way in (direction, end))
    facing, by_end = (np.maximum.reduceat(cosine, start) for cosine in cosines)
    return facing, by_end, np.maximum.reduceat(length[f], start)
