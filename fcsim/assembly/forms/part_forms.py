"""The UFL forms of a part, to be printed or changed."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from fcsim import runtime
from fcsim.arrays import FloatArray
from fcsim.assembly.discretisation import QUADRATURE_DEGREE, Discretisation, discretise, once_per_part
from fcsim.assembly.elasticity import lame
from fcsim.errors import InputError
from fcsim.mesh.material import Material
from fcsim.mesh.part import Part

if TYPE_CHECKING:
    from dolfinx.fem import FunctionSpace
    from dolfinx.mesh import Mesh
    from scipy.sparse import csr_array
    from ufl import Argument, FacetNormal, Form, Measure, SpatialCoordinate


@dataclass(frozen=True, eq=False)
class PartForms:
    """A part on its dolfinx mesh, in the part's axes: mesh; space of its displacements; u, v trial and test functions, x the place.

    Lengths are those of the part; 2D forms are without its thickness.
    """

    part: Part
    discrete: Discretisation

    @property
    def mesh(self) -> Mesh:
        return self.discrete.mesh

    @property
    def space(self) -> FunctionSpace:
        return self.discrete.vector_space

    @cached_property
    def x(self) -> SpatialCoordinate:
        import ufl

        return ufl.SpatialCoordinate(self.mesh)

    @cached_property
    def u(self) -> Argument:
        import ufl

        return ufl.TrialFunction(self.space)

    @cached_property
    def v(self) -> Argument:
        import ufl

        return ufl.TestFunction(self.space)

    @property
    def dx(self) -> Measure:
        """The measure of the cells."""
        import ufl

        return ufl.Measure("dx", domain=self.mesh)

    @cached_property
    def normal(self) -> FacetNormal:
        """The outward normal, for forms on surfaces."""
        import ufl

        return ufl.FacetNormal(self.mesh)

    def ds(self, surface: str) -> Measure:
        """The measure of one of the part's surfaces."""
        import ufl

        tags = runtime.dolfinx().mesh.meshtags(self.mesh, self.part.dimension - 1, self.discrete.boundary_facets(self.part, surface), 1)
        return ufl.Measure("ds", domain=self.mesh, subdomain_data=tags, subdomain_id=1)

    @property
    def stiffness(self) -> Form:
        """The bilinear form int sigma(u) : eps(v), as assembled for elements whose strain is that of their displacements."""
        import ufl

        if not isinstance(self.part.material, Material):
            raise InputError(f"Part {self.part.name!r}: expected one isotropic linear material, whose form this is")
        first, second = (self.discrete.constant(value) for value in lame(self.part))
        eps_u, eps_v = ufl.sym(ufl.grad(self.u)), ufl.sym(ufl.grad(self.v))
        degree = QUADRATURE_DEGREE[self.part.cell_type]["stiffness"]
        return (first * ufl.div(self.u) * ufl.div(self.v) + 2 * second * ufl.inner(eps_u, eps_v)) * self.dx(
            metadata={"quadrature_degree": degree}
        )

    @property
    def mass(self) -> Form:
        """The bilinear form int density u . v."""
        import ufl

        if not isinstance(self.part.material, Material):
            raise InputError(f"Part {self.part.name!r}: expected one material, whose density this form has")
        degree = QUADRATURE_DEGREE[self.part.cell_type]["mass"]
        density = self.discrete.constant(self.part.material.density)
        return density * ufl.inner(self.u, self.v) * self.dx(metadata={"quadrature_degree": degree})

    def matrix(self, form: Form) -> csr_array:
        """The matrix (d nn, d nn) of a bilinear form of u and v in the part's numbering, times the thickness in 2D."""
        self._refuse_other_rank(form, 2, "a bilinear form of u and v")
        return self.part.thickness * self.discrete.matrix(form, self.space)

    def vector(self, form: Form) -> FloatArray:
        """The nodal values (d nn,) of a linear form of v in the part's numbering, times the thickness in 2D."""
        self._refuse_other_rank(form, 1, "a linear form of v")
        found: FloatArray = self.part.thickness * self.discrete.vector(form, self.space)
        return found

    def _refuse_other_rank(self, form: Form, rank: int, expected: str) -> None:
        """InputError for a form of fewer or more arguments: its cells' values would be written beyond their vector or matrix."""
        if len(form.arguments()) != rank:
            raise InputError(f"Part {self.part.name!r}: expected {expected}, got a form of {len(form.arguments())} arguments")


@once_per_part
def _kept(part: Part) -> Discretisation:
    return discretise(part)


def forms_of(part: Part) -> PartForms:
    """The UFL forms of a part on its own dolfinx mesh, and their matrices and vectors in its numbering: see `PartForms`."""
    return PartForms(part, _kept(part))
