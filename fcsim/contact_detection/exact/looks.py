"""How often exact shapes are looked at along the way of a step, so that none passes another or a plate unseen.

Bodies that approach by less than the alert distance are looked at once, with all that they may close. What is faster is looked at in
parts of half the smaller radius: the normal there is that of the meeting, where the one at the beginning would stop bodies that pass by.
"""

from __future__ import annotations

import numpy as np

from fcsim.arrays import FloatArray, IntArray
from fcsim.contact_detection.exact.mesh_skin import MeshSkin
from fcsim.contact_detection.exact.solids import Placed
from fcsim.contact_detection.general._near_kernels import body_pairs
from fcsim.contact_detection.sweep import samples

_BETWEEN = 0.5  # of the smaller radius


def looks(now: Placed, skin: MeshSkin | None, x: FloatArray, way: FloatArray, alert: float) -> tuple[int, float]:
    """Into how many parts the way (n_nodes, d) [m] of a step is cut, 0 = none, and how much the nearest bodies may close in each [m]."""
    solids, d = now.solids, x.shape[1]
    plane = np.array([kind == "plane" for kind in solids.kind])
    reach = np.where(plane, 1e300, solids.radius + solids.half)[:, None]
    low, high = [now.centre - reach], [now.centre + reach]
    moves = way[solids.node]
    least, most = [moves.min(axis=1)], [moves.max(axis=1)]
    size = [np.where(plane, np.inf, solids.radius)]
    if skin is not None and len(skin.vertices):
        owner = _owners(skin)
        first = np.searchsorted(owner[1], np.unique(owner[1]))
        nodes = owner[0]
        for found, values, reduce in ((low, x, np.minimum), (high, x, np.maximum), (least, way, np.minimum), (most, way, np.maximum)):
            found.append(reduce.reduceat(values[nodes], first, axis=0))
        size.append(np.full(len(first), np.inf))
    low_, high_, least_, most_ = (np.pad(np.concatenate(part), ((0, 0), (0, 3 - d))) for part in (low, high, least, most))
    radius, ns = np.concatenate(size), len(solids.body)
    low_, high_ = np.minimum(low_, low_ + least_), np.maximum(high_, high_ + most_)
    axis = int(np.argmax(np.ptp(now.centre, axis=0)))
    pairs = body_pairs(low_, high_, np.full(len(radius), alert), np.argsort(low_[:, axis] - alert, kind="stable"), axis)
    pairs = pairs[pairs.min(axis=1) < ns]
    a, b = pairs.T
    closing = np.maximum(np.abs(most_[a] - least_[b]), np.abs(most_[b] - least_[a]))
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
