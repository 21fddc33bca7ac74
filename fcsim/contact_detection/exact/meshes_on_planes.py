"""Meshed bodies on planes: every vertex of the skin, whatever the body's form, has its height above the plane."""

from __future__ import annotations

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.contact_detection.exact.mesh_skin import MeshSkin
from fcsim.contact_detection.exact.solids import Placed, Touch, no_touch


def meshes_on_planes(now: Placed, skin: MeshSkin, x: FloatArray, alert: float) -> Touch:
    """Vertices of meshed bodies, no higher than `alert` above planes or below them, at node positions x (n_nodes, d) [m].

    The vertex is the slave, with its own node; the master is the plane at the vertex' foot.
    """
    planes = now.solids.of("plane")
    if not len(planes):
        return no_touch(now, 1, now.solids.node.shape[1])
    body = np.zeros(len(skin.vertices), dtype=np.int64)
    body[skin.vertex] = skin.body[:, None]
    height = np.einsum("vpd,pd->vp", x[skin.vertices][:, None] - now.centre[planes], now.along[planes])
    v, p = np.nonzero(height <= alert)
    plane, above = planes[p], height[v, p]
    normal, point = now.along[plane], x[skin.vertices[v]]
    foot = point - above[:, None] * normal
    return Touch(
        normal,
        point,
        foot,
        skin.vertices[v][:, None],
        np.ones((len(v), 1)),
        now.solids.node[plane],
        now.weights(plane, foot),
        np.stack([body[v], now.solids.body[plane]], axis=1),
        plane * len(skin.vertices) + v,
    )
