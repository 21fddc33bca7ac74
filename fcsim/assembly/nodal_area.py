"""What a contact force stands for: the area of a surface that belongs to each of its nodes."""

from __future__ import annotations

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.assembly import elasticity
from fcsim.assembly.model import Model
from fcsim.errors import InputError
from fcsim.mesh.part import Body


def nodal_area(model: Model, body: str, surface: str) -> FloatArray:
    """Return A_a = integral of N_a over a deformable body's surface (n_nodes,) [m^2], by the model's node numbers, zero elsewhere.

    N_a is the shape function of node a on the reference configuration (in 2D times the thickness). A contact force divided by it is
    the nodal pressure, or traction, on that surface.
    """
    owner = model.bodies[model.body_number(body)]
    if not isinstance(owner, Body):
        raise InputError(f"nodal_area: expected a deformable body, got the rigid body {body!r}")
    area = np.zeros(model.n_nodes)
    first = model.node_offset[model.number[body]]
    along = np.eye(model.dimension)[0]
    area[first : first + len(owner.part.points)] = elasticity.traction(owner.part, surface, along)[:: model.dimension]
    return area
