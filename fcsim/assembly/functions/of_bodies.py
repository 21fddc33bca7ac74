"""A body's state as dolfinx functions: displacement, velocity, stress."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, get_args

import numpy as np

from fcsim import runtime
from fcsim.arrays import FloatArray
from fcsim.assembly.discretisation import discretise
from fcsim.assembly.forms.part_of_mesh import own_mesh
from fcsim.assembly.model import Model
from fcsim.assembly.stress import stress_operator, von_mises
from fcsim.errors import InputError
from fcsim.mesh.cell_type import CELL_TYPES
from fcsim.mesh.part import Body

if TYPE_CHECKING:
    from dolfinx.fem import Function

Field = Literal["displacement", "velocity", "stress", "von_mises"]


def body_function(model: Model, body: str, x: FloatArray, v: FloatArray, field: Field = "displacement") -> Function:
    """Return a field of a deformable body as a `dolfinx.fem.Function`, on the mesh that its part was made of, else on the part's own.

    displacement [m], velocity [m/s]: of the elements' order, components along the world axes; stress (3, 3) [Pa] in the axes of the
    reference without a turning body's rotation, von_mises [Pa]: constant in each cell, of its centre. The mesh is the part's, unplaced.
    """
    if field not in get_args(Field):
        raise InputError(f"function of body {body!r}: expected one of {', '.join(get_args(Field))}, got {field!r}")
    number = model.body_number(body)
    owner = model.bodies[number]
    if not isinstance(owner, Body):
        raise InputError(f"function of body {body!r}: expected a deformable body, got a rigid one")
    part, cell = owner.part, CELL_TYPES[owner.part.cell_type]
    if field in ("stress", "von_mises") and any(number in group.members for group in model.groups if group.finite):
        raise InputError(f"function of body {body!r}: expected a linear material for its {field}, got a law of points")
    own = slice(int(model.node_offset[number]), int(model.node_offset[number + 1]))
    fem, mesh, node = runtime.dolfinx().fem, own_mesh(part), None
    if mesh is None:
        discrete = discretise(part)
        mesh, node = discrete.mesh, discrete.node
    if field in ("displacement", "velocity"):
        values = model.node_displacement(x)[own] if field == "displacement" else model.node_velocity(v, x)[own]
        function = fem.Function(fem.functionspace(mesh, ("Lagrange", cell.order, (part.dimension,))))
        places = mesh.geometry.dofmaps[0]
        function.x.array.reshape(-1, part.dimension)[function.function_space.dofmap.list] = values[places if node is None else node[places]]
    else:
        strained = model.strained_displacement(x)[own] @ owner.rotation
        stress = (stress_operator(part) @ strained.ravel()).reshape(-1, 6)
        if node is not None:
            stress = stress[mesh.topology.original_cell_index]
        if field == "von_mises":
            function = fem.Function(fem.functionspace(mesh, ("DG", 0)))
            function.x.array[function.function_space.dofmap.list[:, 0]] = von_mises(stress)
        else:
            function = fem.Function(fem.functionspace(mesh, ("DG", 0, (3, 3))))
            R = np.eye(3)
            R[: part.dimension, : part.dimension] = owner.rotation
            full = R @ stress[:, [[0, 3, 5], [3, 1, 4], [5, 4, 2]]] @ R.T
            function.x.array.reshape(-1, 9)[function.function_space.dofmap.list[:, 0]] = full.reshape(-1, 9)
    function.name = field
    return function
