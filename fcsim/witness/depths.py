"""How deep single points lie in bodies."""

from __future__ import annotations

import numpy as np

from fcsim.arrays import FloatArray, IntArray
from fcsim.assembly.model import Model
from fcsim.errors import InputError
from fcsim.witness._overlap_kernels import depth_of_points
from fcsim.witness.skin import skins_of


def depths(model: Model, positions: FloatArray, points: FloatArray, bodies: IntArray, most: FloatArray) -> FloatArray:
    """Return the depth (n,) [m] of points (n, d) [m] in bodies (n,) of a model whose nodes stand at positions (n_nodes, d) [m], where it is
    more than most (n,) [m]; else 0, also in bodies without a closed skin.

    The skins are looked for anew: for a model's rare questions.
    """
    try:
        skins = skins_of(model)[0]
    except InputError:  # surfaces that face inwards: a witness refuses them where there is one
        return np.zeros(len(points))
    places = np.pad(points, ((0, 0), (0, 3 - points.shape[1])))
    return np.asarray(depth_of_points(places, bodies, most, skins.forest(positions)))
