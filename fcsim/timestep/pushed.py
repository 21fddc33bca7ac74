"""How far loads alone push bodies that are at rest within a step, where that is far: detection along the way has to know of it."""

from __future__ import annotations

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.assembly.model import Model

FAR = 1.0
"""Of the thinnest body: where loads move bodies by less in a step, contacts at its beginning and its end see them, and bodies at rest that
press each other have no contacts beside those which carry."""
ABSURD = 1e8
"""Of the model's extent: a way that is refused by other means, since round-off hides the bodies beside it."""


def pushed(model: Model, force: FloatArray, h: float) -> FloatArray | None:
    """The increment h^2 a (n_dofs,) [m] that loads, `force` (n_dofs,) [N], add to the way of bodies over the step h [s], rotations left
    out; None where it is less than `FAR` for all.

    a = sum F / m of each body, of a deformable one for all its nodes; 0 of those that supports hold, be it in part.
    """
    d, first = model.dimension, model.dof_offset[:-1]
    acceleration = np.empty((len(model.bodies), d))
    count = len(model.deformable)
    nodal = force[: model.n_elastic].reshape(-1, d)
    acceleration[:count] = np.add.reduceat(nodal, first[:count] // d) if count else 0.0
    acceleration[count:] = model.rigid_part(force)[:, :d]
    free = ~model.held.some_of(first) & (model.body_mass > 0)
    acceleration[free] /= model.body_mass[free, None]
    acceleration[~free] = 0.0
    most = h**2 * float(np.abs(acceleration).max())
    if not most > 0 or not model.n_nodes:
        return None
    if not most > FAR * model.thinnest or not most < ABSURD * float(np.ptp(model.reference, axis=0).max()):
        return None
    way = np.zeros(model.n_dofs)
    nodes = np.diff(first, append=model.dof_offset[-1])[:count] // d
    way[: model.n_elastic] = (h**2 * np.repeat(acceleration[:count], nodes, axis=0)).ravel()
    model.rigid_part(way)[:, :d] = h**2 * acceleration[count:]
    return way
