"""What a contact force stands for: the area of a surface that belongs to each of its nodes."""

from __future__ import annotations

import numpy as np

from fcsim.arrays import FloatArray
from fcsim.assembly import elasticity
from fcsim.assembly.layout import BodyLayout
from fcsim.errors import InputError
from fcsim.mesh.part import Body


def nodal_area(layout: BodyLayout, body: str, surface: str) -> FloatArray:
    """Return A_a = integral of N_a over a deformable body's surface (n_nodes,) [m^2], by the model's node numbers, zero elsewhere.

    N_a is the shape function of node a on the reference configuration (in 2D times the thickness). A contact force divided by it is
    the nodal pressure, or traction, on that surface.
    """
    owner = layout.bodies[layout.body_number(body)]
    if not isinstance(owner, Body):
        raise InputError(f"nodal_area: expected a deformable body, got the rigid body {body!r}")
    area = np.zeros(layout.n_nodes)
    first = layout.node_offset[layout.number[body]]
    along = np.eye(layout.dimension)[0]
    area[first : first + len(owner.part.points)] = elasticity.traction(owner.part, surface, along)[:: layout.dimension]
    return area
