"""Exact shapes along the way of a step: how often they are looked at, so that none passes another or a plate unseen, and where they meet
edges and vertices ahead of them.

Bodies that approach by less than the alert distance are looked at once, with all that they may close. What is faster is looked at in
parts of half the smaller radius: the normal there is that of the meeting, where the one at the beginning would stop bodies that pass by.
"""

from __future__ import annotations

import numpy as np

from fcsim.arrays import FloatArray, IntArray
from fcsim.contact_detection.exact.mesh_skin import MeshSkin
from fcsim.contact_detection.exact.solids import Placed, Touch
from fcsim.contact_detection.general._near_kernels import body_pairs
from fcsim.contact_detection.sweep import samples

_BETWEEN = 0.5  # of the smaller radius
_COUNTS = 1e-6  # of the radius: contacts whose gaps at the end of the way change by less stay as they are
_EDGE = 1e-9  # of a weight: less is none
_SKEW = 0.02  # cosine between an edge and the axis below which their common normal does not turn


def looks(now: Placed, skin: MeshSkin | None, x: FloatArray, way: FloatArray, alert: float) -> tuple[int, float]:
    """Into how many parts the way (n_nodes, d) [m] of a step is cut, 0 = none, and how much the nearest bodies may close in each [m]."""
    solids, d = now.solids, x.shape[1]
    plane = np.array([kind == "plane" for kind in solids.kind])
    reach = np.where(plane, 1e300, solids.radius + solids.half)[:, None]
    low, high = [now.centre - reach], [now.centre + reach]
    moves = way[solids.node]
    ends = (solids.half / solids.arm)[:, None] * np.einsum("nij,ni->nj", moves[:, 1:] - moves[:, :1], solids.axis)  # from the middle's
    least, most = [moves.min(axis=1) - np.abs(ends)], [moves.max(axis=1) + np.abs(ends)]
    size = [np.where(plane, np.inf, solids.radius)]
    if skin is not None and len(skin.vertices):
        nodes, body = _owners(skin)
        first = np.searchsorted(body, np.unique(body))
        for lowest, highest, values in ((low, high, x), (least, most, way)):
            lowest.append(np.minimum.reduceat(values[nodes], first, axis=0))
            highest.append(np.maximum.reduceat(values[nodes], first, axis=0))
        size.append(np.full(len(first), np.inf))
    begin, end, slowest, fastest = (np.pad(np.concatenate(part), ((0, 0), (0, 3 - d))) for part in (low, high, least, most))
    radius, ns = np.concatenate(size), len(solids.body)
    begin, end = np.minimum(begin, begin + slowest), np.maximum(end, end + fastest)  # the boxes that the way sweeps
    axis = int(np.argmax(np.ptp(now.centre, axis=0)))
    pairs = body_pairs(begin, end, np.full(len(radius), alert), np.argsort(begin[:, axis] - alert, kind="stable"), axis)
    pairs = pairs[pairs.min(axis=1) < ns]
    a, b = pairs.T
    closing = np.maximum(np.abs(fastest[a] - slowest[b]), np.abs(fastest[b] - slowest[a]))
    distance = np.sqrt(np.einsum("pd,pd->p", closing, closing))
    if not len(distance) or distance.max() <= alert:
        return 0, float(distance.max(initial=0.0))
    spacing = np.maximum(alert, _BETWEEN * np.minimum(radius[a], radius[b]))
    count = max(1, samples(*max(zip(distance.tolist(), spacing.tolist(), strict=True), key=lambda pair: pair[0] / pair[1])))
    return count, float((distance / count).max())


def _owners(skin: MeshSkin) -> tuple[IntArray, IntArray]:
    """Nodes of the skin sorted by body, and their bodies."""
    body = np.zeros(len(skin.vertices), dtype=np.int64)
    body[skin.vertex] = skin.body[:, None]
    order = np.argsort(body, kind="stable")
    return skin.vertices[order], body[order]


def met_ahead(touch: Touch, now: Placed, x: FloatArray, way: FloatArray) -> tuple[Touch, bool]:
    """Contacts of round bodies with edges and vertices of meshed ones, open ones as the way (n_nodes, d) [m] of the step meets them; and
    whether any is another one for it.

    With a from the edge or vertex to the core (across either), w the core's way beside it, R the radius, they meet at the first t <= 1 with
    |a + t w| = R. The law 0 <= g + h u_N takes the motion for straight along the normal: with that of t, N = (a + t w) / |a + t w| and
    g = N . a - R, it holds the body there and no sooner. With that of t = 0 it would hold up what rolls over the ground, by edges and
    vertices ahead that it never touches, at |w|^2 / (2 R) a step. What is not met has the N of where it is nearest, and stays open.
    """
    d, solids = x.shape[1], now.solids
    unchanged = touch, False
    if not len(touch.bodies):
        return unchanged
    number = np.full(int(max(touch.bodies.max(), solids.body.max())) + 1, -1)
    number[solids.body] = np.arange(len(solids.body))
    has = np.where(touch.master_node >= 0, np.abs(touch.master_weights), 0.0) > _EDGE
    kinds = np.array([kind in ("sphere", "capsule", "cylinder") for kind in solids.kind])
    rows = np.flatnonzero((has.sum(axis=1) < d) & (touch.gap > 0))
    rows = rows[kinds[number[touch.bodies[rows, 0]]]]
    if not len(rows):
        return unchanged
    k, has = number[touch.bodies[rows, 0]], has[rows]
    radius, along = solids.radius[k], np.where(np.isin(solids.half[k], 0.0)[:, None], 0.0, now.along[k])
    a = touch.slave_point[rows] + radius[:, None] * touch.normal[rows] - touch.master_point[rows]
    core = touch.master_point[rows] + a - now.centre[k]
    off = core - np.einsum("nd,nd->n", core, along)[:, None] * along
    node, weight = touch.master_node[rows], touch.master_weights[rows]
    at_core = np.einsum("nk,nkd->nd", now.weights(k, now.centre[k] + core), way[solids.node[k]])
    w = at_core - np.einsum("nk,nkd->nd", np.where(has, weight, 0.0), way[node])
    first, last = has.argmax(axis=1), d - 1 - has[:, ::-1].argmax(axis=1)
    n = np.arange(len(rows))
    edge = np.where((has.sum(axis=1) == 2)[:, None], x[node[n, last]] - x[node[n, first]], 0.0)
    edge /= np.maximum(np.linalg.norm(edge, axis=1), 1e-300)[:, None]
    w = _across(w, edge, along)
    ww, aw, aa = (np.einsum("nd,nd->n", *pair) for pair in ((w, w), (a, w), (a, a)))
    root = aw**2 - ww * (aa - radius**2)
    t = np.clip((-aw - np.sqrt(np.maximum(root, 0.0))) / np.maximum(ww, 1e-300), 0.0, 1.0)
    there = a + t[:, None] * w
    normal = there / np.maximum(np.linalg.norm(there, axis=1), 1e-300)[:, None]
    end = np.einsum("nd,nd->n", normal - touch.normal[rows], a + w)
    radial = np.linalg.norm(off, axis=1) <= _COUNTS * radius  # the contact is that of the core's nearest point
    rows, k, normal = (array[radial & (aw < 0) & (end > _COUNTS * radius)] for array in (rows, k, normal))
    if not len(rows):
        return unchanged
    normals, points, weights = touch.normal.copy(), touch.slave_point.copy(), touch.slave_weights.copy()
    points[rows] += solids.radius[k][:, None] * (normals[rows] - normal)
    normals[rows], weights[rows] = normal, now.weights(k, points[rows])
    return touch._replace(normal=normals, slave_point=points, slave_weights=weights), True


def _across(w: FloatArray, edge: FloatArray, along: FloatArray) -> FloatArray:
    """The ways w (n, d) across edges and axes (n, d) of unit length, or 0 where there is none: an edge that is skew to an axis is met by
    the same place of the axis, so its foot moves on along it."""
    cosine = np.einsum("nd,nd->n", edge, along)
    skew = np.abs(cosine) > _SKEW
    axial = np.einsum("nd,nd->n", w, along) / np.where(skew, cosine, 1.0)
    w = w - np.where(skew[:, None], axial[:, None] * edge, np.einsum("nd,nd->n", w, edge)[:, None] * edge)
    return w - np.einsum("nd,nd->n", w, along)[:, None] * along
