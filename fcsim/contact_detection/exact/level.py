"""Cylinders that roll from body to body over joints of a level ground, whose edges are not in their way."""

from __future__ import annotations

import numpy as np

from fcsim.arrays import BoolArray
from fcsim.contact_detection.exact.facets import LEVEL
from fcsim.contact_detection.exact.mesh_skin import MeshSkin
from fcsim.contact_detection.exact.solids import Placed, Touch
from fcsim.mesh.curves.ragged import of_same_key

_LEANS = 1 - 1e-9  # cosine of normals that lean against each other


def in_the_way(touch: Touch, rims: Touch, now: Placed, skin: MeshSkin) -> BoolArray:
    """Which contacts (n,) of cylinders with meshed bodies may act, beside those of their rims on faces, `rims` (of `cylinders_on_meshes`).

    A cylinder whose rims both lie on faces is kept above these by the lowest point of each. What is level with both faces or below them, by
    an edge or a vertex of another body with a normal that leans against that of the faces, it cannot touch: linear in the way of a step,
    such contacts are closed sooner than what is round touches, and would hold up what rolls.
    """
    if not len(touch.bodies) or not len(rims.bodies):
        return np.ones(len(touch.bodies), dtype=bool)
    code, feature = np.divmod(rims.identity, skin.n_features)
    lowest = (feature < len(skin.facets)) & (code % 3 == 0)
    rims, code = rims.take(lowest), code[lowest]
    row, face = of_same_key(rims.bodies[:, 0], touch.bodies[:, 0])
    radius = np.zeros(int(now.solids.body.max(initial=-1)) + 1)
    radius[now.solids.body] = now.solids.radius
    above = np.einsum("nd,nd->n", touch.master_point[row] - rims.master_point[face], rims.normal[face])
    level = (above <= LEVEL * radius[rims.bodies[face, 0]]) & (np.einsum("nd,nd->n", touch.normal[row], rims.normal[face]) < _LEANS)
    other = level & (touch.bodies[row, 1] != rims.bodies[face, 1])
    n = len(touch.bodies)
    borne = [np.bincount(row[level & (code[face] // 3 % 2 == end)], minlength=n) > 0 for end in range(2)]
    return ~(borne[0] & borne[1] & (np.bincount(row[other], minlength=n) > 0))
