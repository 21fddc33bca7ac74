"""Parts and bodies: what a simulation is made of, as arrays.

A `Part` is a mesh with a material, in its own axes. A `Body` is a part placed by a rotation and a translation, so that a wall of
thousands of bricks holds two meshes. A `RigidBody` has a mass, an inertia and a surface mesh, and moves with 6 (3 in 2D) dofs.

All arrays are stored read-only. Node numbers in cells and surfaces are those of the part (or rigid body) itself.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fcsim.arrays import FloatArray, IntArray, is_number
from fcsim.brief import brief, by_fields, shown
from fcsim.errors import InputError
from fcsim.mesh.cell_type import CELL_TYPES, ELEMENTS, RAISED
from fcsim.mesh.curves.middles import on_curves
from fcsim.mesh.exact_shape import ExactShape
from fcsim.mesh.material.by_region import ByRegion
from fcsim.mesh.material.law import AnyMaterial, LinearMaterial, PointLaw
from fcsim.mesh.order.linear_facets import linear_facets
from fcsim.mesh.order.second_order import raised
from fcsim.mesh.quality import ROUND_OFF, check_quality

Kinematics = Literal["turning", "linear"]


def refuse_name(kind: str, name: object) -> None:
    """Refuse what is no name: no text, or an empty one."""
    if not isinstance(name, str) or not name:
        raise InputError(f"name of a {kind}: expected a text that is not empty, got {shown(name)}")


def refuse_mass(name: str, mass: object) -> None:
    """Refuse what is no mass of the rigid body of that name."""
    if not (is_number(mass) and mass > 0):
        raise InputError(f"RigidBody {name!r}: expected a mass > 0 in kg, got {shown(mass)}")


def refuse_kinematics(value: str | None, what: str) -> None:
    """Refuse what is neither a kinematics nor None."""
    if value is not None and not (isinstance(value, str) and value in get_args(Kinematics)):
        raise InputError(f"{what}: expected one of {', '.join(map(repr, get_args(Kinematics)))} or None, got {shown(value)}")


def _frozen(values: ArrayLike, dtype: type, what: str, shape: tuple[int | None, ...]) -> NDArray:
    """Return a read-only copy of `values` as `dtype`, refusing a wrong shape (None = any length) and non-finite numbers."""
    try:
        given = np.asarray(values)
        array: NDArray = np.array(given, dtype=dtype, order="C")
        if dtype is np.int64 and not np.array_equal(array, given):  # a node number 1.5 would be cut to 1
            raise ValueError("not whole numbers")
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(f"{what}: expected numbers in an array of shape {shape}, got {type(values).__name__}: {error}") from None
    if array.ndim != len(shape) or any(s is not None and s != a for s, a in zip(shape, array.shape, strict=True)):
        raise InputError(f"{what}: expected shape {tuple('any' if s is None else s for s in shape)}, got {array.shape}")
    if not np.all(np.isfinite(array)):
        raise InputError(f"{what}: expected finite numbers, got NaN or infinity")
    array.setflags(write=False)
    return array


def _frozen_surfaces(surfaces: Mapping[str, ArrayLike], n_points: int, facet_nodes: int | None, what: str) -> Mapping[str, IntArray]:
    frozen = {}
    for name, facets in surfaces.items():
        array = _frozen(facets, np.int64, f"{what}, surface {name!r}", (None, facet_nodes))
        if array.size and (array.min() < 0 or array.max() >= n_points):
            raise InputError(f"{what}, surface {name!r}: expected node numbers 0 ... {n_points - 1}, got {array.min()} ... {array.max()}")
        frozen[name] = array
    return MappingProxyType(frozen)


def _frozen_nodes(groups: Mapping[str, ArrayLike], n_points: int, order: int, what: str) -> Mapping[str, IntArray]:
    frozen = {}
    for name, given in groups.items():
        about = f"{what}, nodes {name!r}"
        array = _frozen(given, np.int64, about, (None,) if np.ndim(given) == 1 else (None, 1 + order))
        if not array.size or array.min() < 0 or array.max() >= n_points:
            raise InputError(f"{about}: expected node numbers 0 ... {n_points - 1}, at least one")
        frozen[name] = array
    return MappingProxyType(frozen)


def _frozen_regions(regions: Mapping[str, ArrayLike], n_cells: int, what: str) -> Mapping[str, IntArray]:
    frozen = {}
    for name, cells in regions.items():
        array = _frozen(cells, np.int64, f"{what}, region {name!r}", (None,))
        if not array.size or array.min() < 0 or array.max() >= n_cells or len(np.unique(array)) < len(array):
            raise InputError(f"{what}, region {name!r}: expected different numbers of cells, 0 ... {n_cells - 1}, at least one")
        frozen[name] = array
    return MappingProxyType(frozen)


def _refuse_unshared(material: ByRegion, regions: Mapping[str, IntArray], n_cells: int, what: str) -> None:
    """InputError where the materials' regions do not hold each cell once."""
    names = list(material.materials)
    if missing := [name for name in names if name not in regions]:
        raise InputError(
            f"{what}: expected regions of the materials' names, {names}, got {list(regions)}; {missing[0]!r} is not among them"
        )
    count = np.bincount(np.concatenate([regions[name] for name in names]), minlength=n_cells)
    if np.any(count != 1):
        cell = int(np.argmax(count != 1))
        raise InputError(f"{what}: expected every cell in one of the regions {names}, got cell {cell} in {count[cell]}")


@dataclass(frozen=True, eq=False)
class Part:
    """A meshed piece of one material, in its own axes.

    points    (nn, d) [m], d = 2 or 3
    cells     (ncells, k) node numbers, in VTK's (= gmsh's for first order) ordering
    cell_type "hexahedron", "tetrahedron", "quadrilateral" or "triangle"; of second order "hexahedron27", "tetrahedron10",
              "quadrilateral9" or "triangle6"
    surfaces  name -> (nf, kf) node numbers of the facets; a 3D facet is ordered counter-clockwise seen from outside, so that its
              right-hand normal points out of the body; a 2D facet (a, b) has the body on its left, outward normal (t_y, -t_x). Facets
              of second order: the corners, then the middles of the edges around, then the middle of a quadrilateral
              Refused like a mesh file's, see `check_quality`: inverted, collapsed, twisted and repeated cells, unused nodes
    plane     2D only: "strain" or "stress"; thickness [m] multiplies every 2D integral
    elements  how the cells deform (`fcsim.assembly.elements`): hexahedra and quadrilaterals "Q1" (None: this), "Q1-enhanced" (bends and
              keeps its volume without locking) or "Q1-bbar" (without volumetric locking); tetrahedra and triangles "P1"; of second
              order "Q2" and "P2". Cells of first order given with these are raised: the new nodes, in the middle of straight edges or on
              the curves that these are evidently chords of (`fcsim.mesh.curves.middles`), come after the given ones, and points, cells,
              cell_type and surfaces are then those of second order. Cells given of second order stay as they are
    regions   name -> numbers of cells; where the material is a `ByRegion`, those of its names, which share all cells out among them
    nodes     name -> numbers (k,) of nodes, or (k, 2), of second order (k, 3), the edges of cells along a line, their middles last:
              points and lines that supports and forces name
    """

    name: str
    points: FloatArray
    cells: IntArray
    cell_type: str
    surfaces: Mapping[str, IntArray]
    material: AnyMaterial | ByRegion
    plane: Literal["strain", "stress"] = "strain"
    thickness: float = 1.0
    elements: str = field(default=None, kw_only=True)  # type: ignore[assignment] # set by __post_init__
    regions: Mapping[str, IntArray] = field(default_factory=dict, kw_only=True)
    nodes: Mapping[str, IntArray] = field(default_factory=dict, kw_only=True)

    __repr__, __reduce__ = brief, by_fields

    if TYPE_CHECKING:

        def __init__(
            self,
            name: str,
            points: ArrayLike,
            cells: ArrayLike,
            cell_type: str,
            surfaces: Mapping[str, ArrayLike],
            material: AnyMaterial | ByRegion,
            plane: Literal["strain", "stress"] = "strain",
            thickness: float = 1.0,
            *,
            elements: str | None = None,
            regions: Mapping[str, ArrayLike] = ...,
            nodes: Mapping[str, ArrayLike] = ...,
        ) -> None: ...

    def __post_init__(self) -> None:
        refuse_name("Part", self.name)
        what = f"Part {self.name!r}"
        if self.cell_type not in CELL_TYPES:
            raise InputError(f"{what}: expected a cell type among {', '.join(CELL_TYPES)}, got {self.cell_type!r}")
        if self.plane not in ("strain", "stress"):
            raise InputError(f"{what}: expected plane 'strain' or 'stress', got {self.plane!r}")
        if not (is_number(self.thickness) and self.thickness > 0):
            raise InputError(f"{what}: expected a thickness > 0 in m, got {shown(self.thickness)}")
        if not isinstance(self.material, LinearMaterial | PointLaw | ByRegion):
            raise InputError(
                f"{what}, material: expected a Material, another linear one or a law of points (see fcsim.mesh.material), got "
                f"{type(self.material).__name__}"
            )
        object.__setattr__(self, "elements", ELEMENTS[self.cell_type][0] if self.elements is None else self.elements)
        _refuse_elements(self)
        cell = CELL_TYPES[self.cell_type]
        object.__setattr__(self, "points", _frozen(self.points, np.float64, f"{what}, points", (None, cell.dimension)))
        object.__setattr__(self, "cells", _frozen(self.cells, np.int64, f"{what}, cells", (None, cell.size)))
        if self.cells.size == 0 or self.cells.min() < 0 or self.cells.max() >= len(self.points):
            raise InputError(f"{what}: expected cells with node numbers 0 ... {len(self.points) - 1}, got {self.cells.shape[0]} cells")
        object.__setattr__(self, "surfaces", _frozen_surfaces(self.surfaces, len(self.points), cell.facet_size, what))
        object.__setattr__(self, "regions", _frozen_regions(self.regions, len(self.cells), what))
        object.__setattr__(self, "nodes", _frozen_nodes(self.nodes, len(self.points), cell.order, what))
        if isinstance(self.material, ByRegion):
            _refuse_unshared(self.material, self.regions, len(self.cells), what)
        if cell.order == 1 and self.elements in ELEMENTS[RAISED[self.cell_type]]:
            self._raise_order()
        check_quality(self, smallest=ROUND_OFF)

    def _raise_order(self) -> None:
        mesh = raised(self.points, self.cells, self.cell_type, self.surfaces, f"Part {self.name!r}", self.nodes)
        mesh = mesh._replace(points=on_curves(mesh.points, mesh.cells, mesh.cell_type))
        for array in (mesh.points, mesh.cells, *mesh.surfaces.values(), *mesh.nodes.values()):
            array.setflags(write=False)
        for name, value in mesh._asdict().items():
            object.__setattr__(self, name, MappingProxyType(value) if isinstance(value, dict) else value)

    @property
    def dimension(self) -> int:
        return self.points.shape[1]

    @cached_property
    def linear_surfaces(self) -> Mapping[str, IntArray]:
        """The surfaces with facets of first order: those of second order are cut at their nodes, see `fcsim.mesh.order.linear_facets`."""
        cell = CELL_TYPES[self.cell_type]
        return MappingProxyType({name: linear_facets(facets, cell) for name, facets in self.surfaces.items()})


def _refuse_elements(part: Part) -> None:
    """Refuse elements that the part's cells do not have, and those that change nothing where they stand."""
    what = f"Part {part.name!r}, elements"
    cell = CELL_TYPES[part.cell_type]
    known = (*ELEMENTS[part.cell_type], *(ELEMENTS[RAISED[part.cell_type]] if cell.order == 1 else ()))
    if not isinstance(part.elements, str) or part.elements not in known:
        simplex = cell.simplex and cell.order == 1
        hint = ": their strain is constant, so there is nothing to enhance; take 'P2', mesh finer, or with " if simplex else ""
        hint += ("hexahedra" if part.cell_type == "tetrahedron" else "quadrilaterals") if simplex else ""
        raise InputError(f"{what}: expected {' or '.join(map(repr, known))} for {part.cell_type} cells, got {shown(part.elements)}{hint}")
    if part.elements == "Q1-bbar" and part.cell_type == "quadrilateral" and part.plane == "stress":
        raise InputError(f"{what}: expected 'Q1' or 'Q1-enhanced' in plane stress, which has no volumetric locking, got 'Q1-bbar'")


class Placed:
    """What a model is made of: a `Body` or a `RigidBody`. The name by which a list of both is known to type checkers."""

    name: str


@dataclass(frozen=True, eq=False)
class Body(Placed):
    """A part placed in space: a point X of the part stands at `rotation @ X + translation`.

    rotation (d, d) orthogonal with determinant +1; translation (d,) [m]
    kinematics  "turning": small strain in a frame that turns with the body; "linear": small strain and small rotation; None: as the
                model says (see `build_model`)
    """

    name: str
    part: Part
    rotation: FloatArray = None  # type: ignore[assignment] # set by __post_init__
    translation: FloatArray = None  # type: ignore[assignment] # set by __post_init__
    kinematics: Kinematics | None = field(default=None, kw_only=True)

    __repr__, __reduce__ = brief, by_fields

    if TYPE_CHECKING:  # what is given may be less than an array

        def __init__(
            self,
            name: str,
            part: Part,
            rotation: ArrayLike | None = None,
            translation: ArrayLike | None = None,
            *,
            kinematics: Kinematics | None = None,
        ) -> None: ...

    def __post_init__(self) -> None:
        if not isinstance(self.part, Part):
            raise InputError(f"Body {shown(self.name)}, part: expected a Part, as brick(...) gives, got {shown(self.part)}")
        d = self.part.dimension
        refuse_kinematics(self.kinematics, f"Body {self.name!r}, kinematics")
        rotation = np.eye(d) if self.rotation is None else self.rotation
        if np.shape(rotation) != (d, d):
            raise InputError(
                f"Body {self.name!r}, rotation: expected a rotation matrix {(d, d)}, got shape {np.shape(rotation)}; of an angle: "
                "scipy.spatial.transform.Rotation.from_euler('z', 90, degrees=True).as_matrix()" + ("[:2, :2]" if d == 2 else "")
            )
        translation = np.zeros(d) if self.translation is None else self.translation
        object.__setattr__(self, "rotation", _frozen(rotation, np.float64, f"Body {self.name!r}, rotation", (d, d)))
        object.__setattr__(self, "translation", _frozen(translation, np.float64, f"Body {self.name!r}, translation", (d,)))
        if not np.allclose(self.rotation @ self.rotation.T, np.eye(d), atol=1e-10) or np.linalg.det(self.rotation) < 0:
            raise InputError(f"Body {self.name!r}: expected a rotation matrix (orthogonal, determinant +1), got {self.rotation.tolist()}")

    @property
    def dimension(self) -> int:
        return self.part.dimension

    @property
    def points(self) -> FloatArray:
        """Placed nodes (nn, d) [m] in the reference configuration."""
        return self.part.points @ self.rotation.T + self.translation

    @property
    def surfaces(self) -> Mapping[str, IntArray]:
        """Facets of first order: `Part.linear_surfaces`."""
        return self.part.linear_surfaces


@dataclass(frozen=True, eq=False)
class RigidBody(Placed):
    """A rigid body with 6 dofs (3D: v, omega) or 3 (2D), placed in space.

    mass [kg]; inertia about the centre of mass in the world axes of the reference configuration, (3, 3) or 2D (1, 1) [kg m^2];
    centre (d,) [m]; points (np, d) [m] and surfaces name -> (nf, kf) facets, oriented as those of a Part.
    Its points move with v + omega x (p - c). shape: of a body without facets, see `fcsim.mesh.exact_shape`.
    """

    name: str
    mass: float
    inertia: FloatArray
    centre: FloatArray
    points: FloatArray
    surfaces: Mapping[str, IntArray] = field(default_factory=dict)
    shape: ExactShape | None = None

    __repr__, __reduce__ = brief, by_fields

    if TYPE_CHECKING:

        def __init__(
            self,
            name: str,
            mass: float,
            inertia: ArrayLike,
            centre: ArrayLike,
            points: ArrayLike,
            surfaces: Mapping[str, ArrayLike] = ...,
            shape: ExactShape | None = None,
        ) -> None: ...

    def __post_init__(self) -> None:
        what = f"RigidBody {self.name!r}"
        d = (0, *np.shape(self.points))[-1]
        if d not in (2, 3):
            raise InputError(f"{what}: expected points of shape (any, 2) or (any, 3), got {np.shape(self.points)}")
        refuse_mass(self.name, self.mass)
        rotations = 3 if d == 3 else 1
        object.__setattr__(self, "points", _frozen(self.points, np.float64, f"{what}, points", (None, d)))
        object.__setattr__(self, "centre", _frozen(self.centre, np.float64, f"{what}, centre", (d,)))
        object.__setattr__(self, "inertia", _frozen(np.atleast_2d(self.inertia), np.float64, f"{what}, inertia", (rotations, rotations)))
        if (
            not np.allclose(self.inertia, self.inertia.T, rtol=0, atol=1e-8 * np.abs(self.inertia).max())
            or np.linalg.eigvalsh(self.inertia).min() <= 0
        ):
            raise InputError(f"{what}: expected a symmetric positive definite inertia [kg m^2], got {self.inertia.tolist()}")
        object.__setattr__(self, "surfaces", _frozen_surfaces(self.surfaces, len(self.points), None, what))

    @property
    def dimension(self) -> int:
        return self.points.shape[1]
