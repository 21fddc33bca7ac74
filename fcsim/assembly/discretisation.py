"""A part as dolfinx has it: its mesh, spaces and compiled forms, in the part's own node numbering.

dolfinx numbers nodes its own way and orders the nodes of a hexahedron as a tensor product; both are undone here.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps
from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array

from fcsim import runtime
from fcsim.arrays import FloatArray, IntArray
from fcsim.errors import InputError
from fcsim.linear.sparse.short_indices import with_short_indices
from fcsim.mesh.cell_type import CELL_TYPES
from fcsim.mesh.part import Part

if TYPE_CHECKING:
    from dolfinx.fem import Constant, FunctionSpace
    from dolfinx.mesh import Mesh
    from ufl import Form, Measure

# Polynomial degree integrated exactly, in each direction for hexahedra and quadrilaterals: 3 = two Gauss points a direction.
# Exact for simplices; for trilinear cells exact for nodal volumes, pressures and mass, and the full 2 x 2 x 2 rule for stiffness.
QUADRATURE_DEGREE = {
    "hexahedron": {"stiffness": 3, "mass": 4, "load": 3},
    "quadrilateral": {"stiffness": 3, "mass": 3, "load": 3},
    "tetrahedron": {"stiffness": 0, "mass": 2, "load": 1},
    "triangle": {"stiffness": 0, "mass": 2, "load": 1},
    "hexahedron27": {"stiffness": 5, "mass": 5, "load": 5},  # three Gauss points a direction
    "quadrilateral9": {"stiffness": 5, "mass": 5, "load": 5},
    "tetrahedron10": {"stiffness": 2, "mass": 4, "load": 3},  # exact for straight edges
    "triangle6": {"stiffness": 2, "mass": 4, "load": 3},
}


def once_per_part[T](make: Callable[[Part], T]) -> Callable[[Part], T]:
    """Call `make` once for each part and keep its value as long as the part lives (so the value must not refer to the part)."""
    made: WeakKeyDictionary[Part, T] = WeakKeyDictionary()

    @wraps(make)
    def kept(part: Part) -> T:
        if part not in made:
            made[part] = make(part)
        return made[part]

    return kept


@dataclass(frozen=True, eq=False)
class Discretisation:
    """A part's dolfinx mesh and the spaces of its order; `node` (nn,) is the part's node of each point of dolfinx's geometry."""

    mesh: Mesh
    node: IntArray
    scalar_space: FunctionSpace
    vector_space: FunctionSpace
    degree: dict[str, int]

    def dx(self, integral: str) -> Measure:
        import ufl

        return ufl.Measure("dx", domain=self.mesh, metadata={"quadrature_degree": self.degree[integral]})

    def constant(self, value: ArrayLike) -> Constant:
        """A `Constant` is no part of the generated code, so all materials share one compiled form."""
        return runtime.dolfinx().fem.Constant(self.mesh, np.asarray(value, dtype=np.float64))

    def dof(self, space: FunctionSpace) -> IntArray:
        """Return the part's dof number of each dof of the space (both list the nodes of a cell in the same order)."""
        node = np.empty(len(self.node), dtype=np.int64)
        node[space.dofmap.list] = self.node[self.mesh.geometry.dofmaps[0]]
        components = space.dofmap.index_map_bs
        return (components * node[:, None] + np.arange(components)).ravel()

    def matrix(self, form: Form, space: FunctionSpace) -> csr_array:
        entries = runtime.dolfinx().fem.assemble_matrix(runtime.compiled_form(form)).to_scipy().tocoo()
        dof = self.dof(space)
        return with_short_indices(csr_array((entries.data, (dof[entries.row], dof[entries.col])), shape=entries.shape))

    def vector(self, form: Form, space: FunctionSpace) -> FloatArray:
        dof = self.dof(space)
        values = np.empty(len(dof))
        values[dof] = runtime.dolfinx().fem.assemble_vector(runtime.compiled_form(form)).array
        return values

    def boundary_facets(self, part: Part, surface_name: str) -> IntArray:
        """Return dolfinx's sorted facet numbers of a surface; a facet listed twice counts once."""
        where = f"Part {part.name!r}, surface {surface_name!r}"
        if surface_name not in part.surfaces:
            raise InputError(f"{where}: expected one of the surfaces {sorted(part.surfaces)}")
        dmesh, dim = runtime.dolfinx().mesh, part.dimension - 1
        self.mesh.topology.create_connectivity(dim, dim + 1)
        exterior = dmesh.exterior_facet_indices(self.mesh.topology)
        known = np.sort(self.node[dmesh.entities_to_geometry(self.mesh, dim, exterior)], axis=1)
        wanted = np.sort(part.surfaces[surface_name], axis=1)
        _, key = np.unique(np.vstack([known, wanted]), axis=0, return_inverse=True)
        position = np.full(key.max() + 1, -1)
        position[key[: len(known)]] = np.arange(len(known))
        found = position[key[len(known) :]]
        if np.any(found < 0):
            stray = part.surfaces[surface_name][found < 0]
            raise InputError(
                f"{where}: expected facets on the boundary of the part, got {len(stray)} others, the first with nodes {stray[0].tolist()}"
            )
        return exterior[np.unique(found)]


@once_per_part
def discretise(part: Part) -> Discretisation:
    """The part's cells as dolfinx has them, made once a part; InputError where nodes are in no cell."""
    orphans = np.setdiff1d(np.arange(len(part.points)), part.cells)
    if orphans.size:  # they would have neither stiffness nor mass
        raise InputError(
            f"Part {part.name!r}: expected every node in a cell, got {orphans.size} in none, the first is node {orphans[0]} "
            f"at {part.points[orphans[0]].tolist()} m"
        )
    dolfinx = runtime.dolfinx()
    import basix.ufl
    from mpi4py import MPI

    d, cell = part.dimension, CELL_TYPES[part.cell_type]
    vtk_order = dolfinx.cpp.io.perm_vtk(dolfinx.mesh.to_type(cell.basix), cell.size)
    element = basix.ufl.element("Lagrange", cell.basix, cell.order, shape=(d,), dtype=np.float64)
    mesh = dolfinx.mesh.create_mesh(MPI.COMM_SELF, part.cells[:, vtk_order], element, part.points)
    return Discretisation(
        mesh=mesh,
        node=mesh.geometry.input_global_indices,
        scalar_space=dolfinx.fem.functionspace(mesh, ("Lagrange", cell.order)),
        vector_space=dolfinx.fem.functionspace(mesh, ("Lagrange", cell.order, (d,))),
        degree=QUADRATURE_DEGREE[part.cell_type],
    )
