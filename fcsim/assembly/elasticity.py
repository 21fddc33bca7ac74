"""Linear elasticity of one part: stiffness, mass and loads, assembled with dolfinx in the part's own node numbering.

The dof of component c of node a is `d a + c`. dolfinx numbers nodes its own way and orders the nodes of a hexahedron as a tensor
product; both are undone in `discretisation`, so nothing else sees them. All 2D integrals carry the part's thickness. A part is
assembled once however many bodies place it: what depends on the part alone is kept for as long as the part lives, and read-only.

Source: T. J. R. Hughes, The Finite Element Method, 2000, chapters 2 (stiffness), 3 (quadrature) and 7 (mass).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array, eye_array, kron

from fcsim import runtime
from fcsim.arrays import FloatArray, is_number, numbers_of
from fcsim.assembly import elements
from fcsim.assembly.discretisation import QUADRATURE_DEGREE, discretise, once_per_part
from fcsim.brief import shown
from fcsim.errors import InputError
from fcsim.mesh.cell_type import CELL_TYPES
from fcsim.mesh.material.by_region import ByRegion
from fcsim.mesh.material.law import LinearMaterial
from fcsim.mesh.material.linear import Material
from fcsim.mesh.material.linear import lame as isotropic_lame
from fcsim.mesh.order.quadrature import quadrature
from fcsim.mesh.part import Part
from fcsim.mesh.region_parts import region_parts

BY_DOLFINX = ("Q1", "P1", "Q2", "P2")
"""Elements whose strain is that of their displacements."""


@dataclass(frozen=True, eq=False)
class PartOperators:
    """What a part brings to a model: stiffness and consistent_mass (d nn, d nn) [N/m], [kg]; lumped_mass (d nn,) [kg];
    nodal_volume (nn,) [m^3], that of the lumped mass, all positive. Shared by all bodies that place the part, therefore read-only."""

    stiffness: csr_array
    consistent_mass: csr_array
    lumped_mass: FloatArray
    nodal_volume: FloatArray


@once_per_part
def assemble(part: Part) -> PartOperators:
    """Return all operators of the part. Raises as `stiffness` does."""
    return PartOperators(stiffness(part), consistent_mass(part), lumped_mass(part), lumped_volume(part))


def _of_regions(part: Part, of: Callable[[Part], csr_array]) -> csr_array:
    """The sum of the regions' matrices (d nn, d nn)."""
    d, n = part.dimension, part.points.size
    total = csr_array((n, n))
    for region in region_parts(part):
        own = of(region.part).tocoo()
        dofs = (d * region.nodes[:, None] + np.arange(d)).ravel()
        total = total + csr_array((own.data, (dofs[own.row], dofs[own.col])), shape=(n, n))
    return _read_only(csr_array(total))


@once_per_part
def stiffness(part: Part) -> csr_array:
    """Return K (d nn, d nn) [N/m], exactly symmetric: x^T K y = integral of sigma(x) : eps(y), with
    sigma = lambda tr(eps) I + 2 mu eps in 3D and plane strain, and lambda replaced by 2 lambda mu / (lambda + 2 mu) in plane stress;
    sigma = C eps of other linear materials. eps is that of the part's elements: `BY_DOLFINX` of isotropic materials here, all others by
    `fcsim.assembly.elements`.

    Raises InputError for a mesh with nodes that belong to no cell, MissingDependency without dolfinx or a C compiler.
    """
    import ufl

    discrete = discretise(part)
    if isinstance(part.material, ByRegion):
        return _of_regions(part, stiffness)
    if part.elements not in BY_DOLFINX or not isinstance(part.material, Material):
        return _read_only(elements.stiffness(part, elasticity_matrix(part)))
    V = discrete.vector_space
    first, second = (discrete.constant(value) for value in lame(part))
    u, v = ufl.TrialFunction(V), ufl.TestFunction(V)
    eps_u, eps_v = ufl.sym(ufl.grad(u)), ufl.sym(ufl.grad(v))
    form = (first * ufl.div(u) * ufl.div(v) + 2 * second * ufl.inner(eps_u, eps_v)) * discrete.dx("stiffness")
    half = 0.5 * part.thickness * discrete.matrix(form, V)
    return _read_only(half + half.T)


@once_per_part
def consistent_mass(part: Part) -> csr_array:
    """Return M (d nn, d nn) [kg]: x^T M y = integral of density x . y. Raises as `stiffness` does."""
    import ufl

    if isinstance(part.material, ByRegion):
        return _of_regions(part, consistent_mass)
    discrete = discretise(part)
    V = discrete.scalar_space
    form = ufl.TrialFunction(V) * ufl.TestFunction(V) * discrete.dx("mass")
    half = 0.5 * part.material.density * part.thickness * discrete.matrix(form, V)
    return _read_only(kron(half + half.T, eye_array(part.dimension), format="csr"))


@once_per_part
def lumped_mass(part: Part) -> FloatArray:
    """Return the density times `lumped_volume` (d nn,) [kg]. Raises as `stiffness` does."""
    if isinstance(part.material, ByRegion):
        mass = np.zeros((len(part.points), part.dimension))
        for region in region_parts(part):
            mass[region.nodes] += lumped_mass(region.part).reshape(-1, part.dimension)
        return _read_only(mass.ravel())
    return _read_only(np.repeat(part.material.density * lumped_volume(part), part.dimension))


@once_per_part
def lumped_volume(part: Part) -> FloatArray:
    """Return the share (nn,) [m^3] of the volume that each node has in the lumped mass, all positive: `nodal_volume`, the row sums of the
    consistent mass, for first-order cells; for second order, where these are negative in the corners of simplices, each cell's volume in
    the proportion of int N_a^2 (E. Hinton, T. Rock, O. C. Zienkiewicz, "A note on mass lumping and related processes in the finite element
    method", Earthq. Eng. Struct. Dyn. 4, 1976). Raises as `stiffness` does."""
    cell = CELL_TYPES[part.cell_type]
    if cell.order == 1:
        return nodal_volume(part)
    discretise(part)  # refuses what it must
    at, weights = quadrature(cell, 4)
    gradients, squares = cell.gradient(at), cell.shape(at) ** 2
    own = np.zeros((len(part.cells), cell.size))
    volume = np.zeros(len(part.cells))
    nodes = part.points[part.cells] - part.points[part.cells[:, :1]]
    for weight, gradient, square in zip(weights, gradients, squares, strict=True):
        measure = weight * np.linalg.det(nodes.transpose(0, 2, 1) @ gradient)
        own += measure[:, None] * square
        volume += measure
    own *= (volume / own.sum(axis=1))[:, None]
    return _read_only(part.thickness * np.bincount(part.cells.ravel(), own.ravel(), minlength=len(part.points)))


@once_per_part
def nodal_volume(part: Part) -> FloatArray:
    """Return the integral of each node's shape function (nn,) [m^3]; they sum to the volume, and are negative in the corners of
    tetrahedra of second order, zero in those of triangles. Raises as `stiffness` does."""
    import ufl

    discrete = discretise(part)
    form = ufl.TestFunction(discrete.scalar_space) * discrete.dx("load")
    return _read_only(part.thickness * discrete.vector(form, discrete.scalar_space))


def body_force(part: Part, force_density: ArrayLike) -> FloatArray:
    """Return the nodal forces (d nn,) [N] of a uniform force per volume (d,) [N/m^3], in the part's axes."""
    density = _vector(force_density, part, "body_force", "force_density [N/m^3]")
    return np.outer(nodal_volume(part), density).ravel()


def traction(part: Part, surface_name: str, traction: ArrayLike) -> FloatArray:
    """Return the nodal forces (d nn,) [N] of a uniform force per area (d,) [N/m^2] on a surface, in the part's axes.

    Raises InputError for an unknown surface, or one with facets that are not on the part's boundary.
    """
    return _surface_load(part, surface_name, _vector(traction, part, "traction", "traction [N/m^2]"), 0.0)


def pressure(part: Part, surface_name: str, pressure: float) -> FloatArray:
    """Return the nodal forces (d nn,) [N] of a pressure [Pa] on a surface: positive pushes into the part. Raises as `traction` does."""
    if not is_number(pressure):
        raise InputError(f"pressure on Part {part.name!r}: expected a finite pressure in Pa, got {shown(pressure)}")
    return _surface_load(part, surface_name, np.zeros(part.dimension), float(pressure))


def lame(part: Part) -> tuple[float, float]:
    """Return Lame's constants (lambda, mu) [Pa] of the part's isotropic material, lambda being that of plane stress for such a part."""
    if not isinstance(part.material, Material):
        raise InputError(f"Part {part.name!r}: expected a Material (isotropic, linear elastic), got {type(part.material).__name__}")
    E, nu = part.material.E, part.material.nu
    if part.dimension == 2 and part.plane == "stress":
        return E * nu / (1 - nu**2), E / (2 * (1 + nu))
    return isotropic_lame(E, nu)


def elasticity_matrix(part: Part) -> FloatArray:
    """Return C (6, 6) [Pa], stress = C (eps_xx, eps_yy, eps_zz, gamma_xy, gamma_yz, gamma_zx), with the plane hypothesis applied.

    Raises InputError for a material that is not linear."""
    material = part.material
    if not isinstance(material, LinearMaterial):
        raise InputError(
            f"Part {part.name!r}: expected a linear elastic material, got {type(material).__name__}, which has no one stiffness"
        )
    C = np.array(material.elasticity)
    if part.dimension == 2 and part.plane == "stress":
        C -= np.outer(C[:, 2], C[2]) / C[2, 2]  # sigma_zz = 0
        C[2] = 0
        C[:, 2] = 0
    return C


def _surface_load(part: Part, surface_name: str, force: FloatArray, pressure: float) -> FloatArray:
    """Return the integral of (force - pressure n) . v over the surface; one form, so that both loads share its compiled code."""
    import ufl

    if not isinstance(surface_name, str):
        raise InputError(f"Part {part.name!r}: expected the name of a surface, got {shown(surface_name)}")
    discrete = discretise(part)
    mesh, V = discrete.mesh, discrete.vector_space
    tags = runtime.dolfinx().mesh.meshtags(mesh, part.dimension - 1, discrete.boundary_facets(part, surface_name), 1)
    degree = QUADRATURE_DEGREE[part.cell_type]["load"]
    ds = ufl.Measure("ds", domain=mesh, subdomain_data=tags, subdomain_id=1, metadata={"quadrature_degree": degree})
    load = discrete.constant(force) - discrete.constant(pressure) * ufl.FacetNormal(mesh)
    return part.thickness * discrete.vector(ufl.inner(load, ufl.TestFunction(V)) * ds, V)


def _read_only[A: (csr_array, FloatArray)](values: A) -> A:
    (values.data if isinstance(values, csr_array) else values).setflags(write=False)
    return values


def _vector(values: ArrayLike, part: Part, function: str, argument: str) -> FloatArray:
    array = numbers_of(values)
    if array.shape != (part.dimension,) or not np.all(np.isfinite(array)):
        raise InputError(f"{function} on Part {part.name!r}: expected {argument} as {part.dimension} finite numbers, got {values!r}")
    return array
