"""Blocks meshed with gmsh: bricks and rectangles as parts, rigid boxes and rectangles, and parts from a user's own gmsh model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from types import ModuleType
from typing import Literal

import numpy as np

from fcsim.arrays import BoolArray, FloatArray, IntArray, numbers_of
from fcsim.brief import shown
from fcsim.errors import InputError
from fcsim.memory import refuse_beyond_memory
from fcsim.mesh.cell_type import CELL_TYPES, RAISED
from fcsim.mesh.material.by_region import ByRegion
from fcsim.mesh.material.law import AnyMaterial
from fcsim.mesh.material.linear import Material
from fcsim.mesh.named_mesh import NamedMesh, from_gmsh
from fcsim.mesh.part import Part, RigidBody, refuse_mass, refuse_name
from fcsim.runtime import gmsh_model

AXES = "xyz"
BYTES_PER_CELL = 1200.0
"""What gmsh holds and hands out of a structured mesh, measured at 64 000 and 343 000 hexahedra."""


_TOLERANCE, _SMALLEST, _LARGEST = 1e-8, 1e-15, 1e15  # of gmsh's geometry
_SMALL = 1e-4  # m: from there on down gmsh meshes larger boxes; of 2e-7 m it makes a mixture of cells


def part_from_gmsh(
    gmsh: ModuleType,
    name: str,
    material: AnyMaterial | ByRegion,
    *,
    volume: str | None = None,
    plane: Literal["strain", "stress"] = "strain",
    thickness: float = 1.0,
    elements: str | None = None,
) -> Part:
    """Return the part meshed in the current gmsh model (use it inside `with fcsim.runtime.gmsh_model(name) as gmsh`).

    The cells are those of the physical group `volume` (of surfaces, for a plane model), which can be left out where there is one
    group or none; the part's surfaces are the physical groups of one dimension less, by name, oriented outwards. A model of several
    volume groups makes several parts, one call each; a surface keeps the facets that bound the part. InputError for cells that are
    of several types or none of `fcsim.mesh.cell_type`, inverted or degenerate, and for surfaces that are not on the boundary.
    """
    mesh = from_gmsh(gmsh, f"gmsh model {gmsh.model.getCurrent()!r}", plane=plane, thickness=thickness)
    return mesh.part(material, name=name, volume=volume, elements=elements)


def brick(
    name: str,
    size: Sequence[float] | FloatArray,
    divisions: Sequence[int],
    material: AnyMaterial,
    cell: str = "hexahedron",
    origin: Sequence[float] | FloatArray = (0.0, 0.0, 0.0),
    *,
    elements: str | None = None,
) -> Part:
    """Return a box from `origin` to `origin + size` [m] with surfaces "x-", "x+", "y-", "y+", "z-", "z+".

    A structured mesh of `divisions` = (nx, ny, nz) hexahedra; with cell="tetrahedron" each of them is cut into tetrahedra.
    elements: "Q1" (default), "Q1-enhanced" where the brick bends or is nearly incompressible, "Q1-bbar", "Q2"; of tetrahedra "P1", "P2";
    see `Part`.
    """
    return _box(name, size, divisions, cell, origin, dimension=3).part(material, name=name, elements=elements)


def rectangle(
    name: str,
    size: Sequence[float] | FloatArray,
    divisions: Sequence[int],
    material: AnyMaterial,
    cell: str = "quadrilateral",
    *,
    plane: Literal["strain", "stress"] = "strain",
    thickness: float = 1.0,
    origin: Sequence[float] | FloatArray = (0.0, 0.0),
    elements: str | None = None,
) -> Part:
    """Return a rectangle from `origin` to `origin + size` [m] with surfaces "x-", "x+", "y-", "y+".

    A structured mesh of `divisions` = (nx, ny) quadrilaterals; with cell="triangle" each of them is cut in two. `plane` and
    `thickness` [m] are those of `Part`, as are `elements`: "Q1" (default), "Q1-enhanced", "Q1-bbar", "Q2"; "P1", "P2".
    """
    return _box(name, size, divisions, cell, origin, dimension=2, plane=plane, thickness=thickness).part(
        material, name=name, elements=elements
    )


def rigid_box(
    name: str, size: Sequence[float] | FloatArray, centre: Sequence[float] | FloatArray, mass: float, divisions: Sequence[int] | None = None
) -> RigidBody:
    """Return a rigid homogeneous box of edges `size` [m] around `centre` [m], `mass` [kg], with six named surfaces of quadrilaterals.

    Inertia m/12 diag(ly^2 + lz^2, lx^2 + lz^2, lx^2 + ly^2). `divisions` = (nx, ny, nz) facets along the edges, by default one
    facet a face.
    """
    refuse_mass(name, mass)
    points, surfaces = _hull(name, size, centre, divisions, dimension=3)
    squares = np.square(np.asarray(size, dtype=float))
    return RigidBody(name, mass, mass / 12 * np.diag(squares.sum() - squares), np.asarray(centre), points, surfaces)


def rigid_rectangle(
    name: str, size: Sequence[float] | FloatArray, centre: Sequence[float] | FloatArray, mass: float, divisions: Sequence[int] | None = None
) -> RigidBody:
    """Return a rigid homogeneous rectangle of edges `size` [m] around `centre` [m], `mass` [kg], with four named surfaces.

    Inertia m/12 (lx^2 + ly^2). `divisions` = (nx, ny) segments along the edges, by default one a side.
    """
    refuse_mass(name, mass)
    points, surfaces = _hull(name, size, centre, divisions, dimension=2)
    inertia = mass / 12 * np.square(np.asarray(size, dtype=float)).sum()
    return RigidBody(name, mass, np.array([[inertia]]), np.asarray(centre), points, surfaces)


def _hull(
    name: str, size: Sequence[float] | FloatArray, centre: Sequence[float] | FloatArray, divisions: Sequence[int] | None, dimension: int
) -> tuple[FloatArray, dict[str, IntArray]]:
    """Nodes on the boundary of a box, and its surfaces numbered in them."""
    _check_numbers(name, "centre", centre, dimension)
    corner = np.asarray(centre) - _check_numbers(name, "size", size, dimension) / 2
    if divisions is None:
        lengths, corner, _ = _check_box(name, size, (1,) * dimension, corner, dimension)
        far, surfaces = _corners(dimension)
        return np.where(far, corner + lengths, corner), {label: facets.copy() for label, facets in surfaces.items()}
    return _meshed_hull(name, size, corner, divisions, dimension)


@cache
def _corners(dimension: int) -> tuple[BoolArray, dict[str, IntArray]]:
    """Of a box of one facet a face, in the numbering of a meshed one: on which side along each axis a node lies, and the surfaces.

    Boxes by the thousand are made of it: gmsh takes ten milliseconds for each.
    """
    points, surfaces = _meshed_hull("box", (1.0,) * dimension, (0.0,) * dimension, (1,) * dimension, dimension)
    return points > 0.5, surfaces


def _meshed_hull(
    name: str, size: Sequence[float] | FloatArray, corner: Sequence[float] | FloatArray, divisions: Sequence[int], dimension: int
) -> tuple[FloatArray, dict[str, IntArray]]:
    mesh = _box(name, size, divisions, "hexahedron" if dimension == 3 else "quadrilateral", corner, dimension)
    part = mesh.part(Material(E=1.0, nu=0.0, density=0.0))  # of the checked part only the shape is taken
    used, numbers = np.unique(np.concatenate(list(part.surfaces.values())), return_inverse=True)
    ends = np.cumsum([len(facets) for facets in part.surfaces.values()])[:-1]
    return part.points[used], dict(zip(part.surfaces, np.split(numbers.reshape(-1, 2 * dimension - 2), ends), strict=True))


def _check_numbers(name: str, argument: str, values: Sequence[float] | FloatArray, dimension: int) -> FloatArray:
    numbers = numbers_of(values)
    if numbers.shape != (dimension,) or not np.all(np.isfinite(numbers)):
        raise InputError(f"{name!r}, {argument}: expected {dimension} finite numbers, got {shown(values)}")
    return numbers


def _check_box(
    name: str, size: Sequence[float] | FloatArray, divisions: Sequence[int], origin: Sequence[float] | FloatArray, dimension: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Size, origin and divisions as arrays; InputError for a box that gmsh would not tell from a thinner one, or that has no inside."""
    refuse_name("box", name)
    size, origin = _check_numbers(name, "size", size, dimension), _check_numbers(name, "origin", origin, dimension)
    counts = _check_numbers(name, "divisions", divisions, dimension)
    if np.any(size <= 0):
        raise InputError(f"{name!r}, size: expected lengths > 0 in m, got {size.tolist()}")
    if size.min() <= _SMALLEST or size.max() > _LARGEST or size.min() <= _TOLERANCE * size.max():
        known = f"above {_SMALLEST:g} m, below {_LARGEST:g} m and of a ratio below {1 / _TOLERANCE:g}, which gmsh tells apart"
        raise InputError(f"{name!r}, size: expected lengths {known}, got {size.tolist()}")
    if not np.allclose((origin + size) - origin, size, rtol=1e-6, atol=0):
        raise InputError(f"{name!r}, origin: expected one within 1e9 lengths of the box, got {origin.tolist()} for {size.tolist()}")
    if np.any(counts < 1) or np.any(counts != np.round(counts)):
        raise InputError(f"{name!r}, divisions: expected whole numbers >= 1, got {divisions!r}")
    return size, origin, counts


def _box(
    name: str,
    size: Sequence[float] | FloatArray,
    divisions: Sequence[int],
    cell: str,
    origin: Sequence[float] | FloatArray,
    dimension: int,
    *,
    plane: Literal["strain", "stress"] = "strain",
    thickness: float = 1.0,
) -> NamedMesh:
    """Extrude a point along x, y and z with gmsh, so that the mesh is structured; cut into simplices unless gmsh recombines.

    Small boxes are meshed in units of a power of two, which changes no digit: gmsh's geometry takes lengths below 1e-8 for none.
    """
    size, origin, counts = _check_box(name, size, divisions, origin, dimension)
    unit = 2.0 ** np.floor(np.log2(size.max())) if size.min() < _SMALL else 1.0
    size, origin = size / unit, origin / unit
    if cell not in RAISED or CELL_TYPES[cell].dimension != dimension:
        known = " or ".join(repr(c) for c in RAISED if CELL_TYPES[c].dimension == dimension)
        raise InputError(f"{name!r}, cell: expected {known}, got {cell!r}")

    refuse_beyond_memory(
        f"{name!r}: a mesh of {' x '.join(f'{count:g}' for count in counts)} cells", BYTES_PER_CELL * float(np.prod(counts))
    )
    with gmsh_model(name) as gmsh:
        swept = [(0, gmsh.model.geo.addPoint(*origin, *(0.0,) * (3 - dimension)))]
        for axis in range(dimension):
            step = np.zeros(3)
            step[axis] = size[axis]
            extruded = gmsh.model.geo.extrude(
                swept, *step, numElements=[int(counts[axis])], recombine=cell in ("hexahedron", "quadrilateral")
            )
            swept = [entity for entity in extruded if entity[0] == axis + 1]
        gmsh.model.geo.synchronize()
        gmsh.model.addPhysicalGroup(dimension, [swept[0][1]], name=name)
        faces = gmsh.model.getBoundary(swept, oriented=False)
        for label, face in sorted(zip(_face_labels(gmsh, faces, origin + size / 2, size), faces, strict=True), key=_minus_first):
            gmsh.model.addPhysicalGroup(face[0], [face[1]], name=label)
        gmsh.model.mesh.generate(dimension)
        mesh = from_gmsh(gmsh, repr(name), plane=plane, thickness=thickness)
        return mesh if unit == 1.0 else replace(mesh, points=mesh.points * unit)


def _minus_first(labelled: tuple[str, tuple[int, int]]) -> tuple[str, bool]:
    return labelled[0][0], labelled[0][1] == "+"


def _face_labels(gmsh: ModuleType, faces: Sequence[tuple[int, int]], centre: FloatArray, size: FloatArray) -> list[str]:
    """ "x-" ... "z+" for each face, from where the middle of its bounding box lies."""
    boxes = np.array([gmsh.model.getBoundingBox(*face) for face in faces])
    offset = ((boxes[:, :3] + boxes[:, 3:])[:, : len(size)] / 2 - centre) / size
    axis = np.argmax(np.abs(offset), axis=1)
    return [AXES[a] + ("+" if offset[i, a] > 0 else "-") for i, a in enumerate(axis)]
