"""A body's state as dolfinx functions: displacement, velocity, stress, internal variables."""

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

SYMMETRIC = np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2]])
"""Places of the components (xx, yy, zz, xy, yz, zx) in a tensor."""


def body_function(
    model: Model,
    body: str,
    x: FloatArray,
    v: FloatArray,
    field: Field | str = "displacement",
    internal: FloatArray | None = None,
    t: float = 0.0,
) -> Function:
    """Return a field of a deformable body as a `dolfinx.fem.Function`, on the mesh that its part was made of, else on the part's own.

    displacement [m], velocity [m/s]: of the elements' order, components along the world axes.
    stress (3, 3), von_mises [Pa]: constant in each cell. Of linear materials that of the cell's centre, without a turning body's rotation;
    of laws of points Cauchy's, along the world's axes, the mean of the cell's points.
    Any other name: an internal variable of the body's law (as "plastic_strain"), constant in each cell, the mean of its points; components
    along the part's axes, nan in regions whose law has none of that name. internal, t: the internal variables and the time of the state.
    The mesh is the part's, unplaced. InputError for rigid bodies and names that are none.
    """
    number = model.body_number(body)
    owner = model.bodies[number]
    if not isinstance(owner, Body):
        raise InputError(f"function of body {body!r}: expected a deformable body, got a rigid one")
    part, cell = owner.part, CELL_TYPES[owner.part.cell_type]
    fem, mesh, node = runtime.dolfinx().fem, own_mesh(part), None
    if mesh is None:
        discrete = discretise(part)
        mesh, node = discrete.mesh, discrete.node
    if field in ("displacement", "velocity"):
        own = slice(int(model.node_offset[number]), int(model.node_offset[number + 1]))
        values = model.node_displacement(x)[own] if field == "displacement" else model.node_velocity(v, x)[own]
        function = fem.Function(fem.functionspace(mesh, ("Lagrange", cell.order, (part.dimension,))))
        places = mesh.geometry.dofmaps[0]
        function.x.array.reshape(-1, part.dimension)[function.function_space.dofmap.list] = values[places if node is None else node[places]]
    else:
        values = _of_cells(model, owner, number, x, field, internal, t)
        if node is not None:
            values = values[mesh.topology.original_cell_index]
        shape = values.shape[1:]
        function = fem.Function(fem.functionspace(mesh, ("DG", 0, shape) if shape else ("DG", 0)))
        function.x.array.reshape(len(values), -1)[function.function_space.dofmap.list[:, 0]] = values.reshape(len(values), -1)
    function.name = field
    return function


def _of_cells(model: Model, body: Body, number: int, x: FloatArray, field: str, internal: FloatArray | None, t: float) -> FloatArray:
    """Values (nc,), (nc, k) or (nc, 3, 3) of a field that is constant in each cell, cells in the part's order."""
    variables: dict[str, FloatArray] = {}
    stress = None
    for group, inner, by_name in model.nonlinear.at_cells(x, internal, t):
        for b in np.flatnonzero(group.members == number):
            stress, variables = inner.stress[b], {name: values[b] for name, values in by_name.items()}
    if field in variables:
        return variables[field]
    if field not in ("stress", "von_mises"):
        known = ", ".join([*get_args(Field), *variables])
        raise InputError(f"function of body {body.name!r}: expected one of {known}, got {field!r}")
    if stress is None:
        own = slice(int(model.node_offset[number]), int(model.node_offset[number + 1]))
        strained = model.strained_displacement(x)[own] @ body.rotation
        stress = (stress_operator(body.part) @ strained.ravel()).reshape(-1, 6)
    if field == "von_mises":
        return von_mises(stress)
    R = np.eye(3)
    R[: body.part.dimension, : body.part.dimension] = body.rotation
    full: FloatArray = R @ stress[:, SYMMETRIC] @ R.T
    return full
