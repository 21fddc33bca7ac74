"""Parts in mesh files: gmsh's .msh, and the formats of meshio.

How surfaces are kept: in .msh as physical groups, as are named points and lines; in .vtu, .vtk and .xdmf as one cell array a surface, named
"surface:NAME" (special characters of NAME as in a URL, "%20" for a space), which is 1 on the facets of the surface. Reading also takes the
named cell sets of a format (.inp and others) and the tags "gmsh:physical", "medit:ref" and "cell_tags" with the names of field_data, or the
tag as the name. No format keeps the material, nor `plane`, `thickness` and `elements`: they are given when a file is read.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Literal
from urllib.parse import quote

import numpy as np

from fcsim.arrays import IntArray
from fcsim.brief import shown
from fcsim.errors import InputError
from fcsim.files import note_read, path_of, replacing
from fcsim.mesh.cell_type import CELL_TYPES, GMSH_NUMBERS, TO_MESHIO
from fcsim.mesh.foreign import SURFACE, meshio_package, quietly, read_foreign
from fcsim.mesh.material.by_region import ByRegion
from fcsim.mesh.material.law import AnyMaterial
from fcsim.mesh.named_mesh import NamedMesh
from fcsim.mesh.part import Part
from fcsim.runtime import gmsh_model

KEEPS_SURFACES = (".msh", ".vtu", ".vtk", ".xdmf")
KEEPS_SECOND_ORDER = (".msh", ".vtu", ".vtk")  # meshio writes them elsewhere too, but cannot read all of it again
KEEPS_CELLS = (*KEEPS_SURFACES, ".inp", ".med", ".mesh")  # the other formats of meshio lose cells or digits
GMSH_LINES = {2: 1, 3: 8}
"""gmsh's numbers of lines by their nodes."""
_MSH_NAME = 127  # gmsh cuts longer names of physical groups


def read_mesh(
    path: str | os.PathLike[str],
    material: AnyMaterial | ByRegion,
    *,
    name: str | None = None,
    volume: str | None = None,
    plane: Literal["strain", "stress"] = "strain",
    thickness: float = 1.0,
    elements: str | None = None,
) -> Part:
    """Return the part that a mesh file holds: `volume` of it, where it has several named volumes.

    `name` is the part's: by default that of the volume, or of the file where its cells have no name. A 2D mesh lies in a plane
    z = const. InputError where the file is missing or unreadable, has no volume cells, has cells of several types or of kinds
    that are not in `fcsim.mesh.cell_type`, has inverted, degenerate or unused elements, or surfaces that are not on the boundary.
    """
    path = path_of("path", "a mesh file", path)
    mesh = _read(path, plane, thickness)
    part_name = name or volume or next(iter(mesh.volumes)) or path.stem
    return mesh.part(material, name=part_name, volume=volume, elements=elements)


def read_parts(
    path: str | os.PathLike[str],
    materials: Mapping[str, AnyMaterial],
    *,
    plane: Literal["strain", "stress"] = "strain",
    thickness: float = 1.0,
    elements: str | None = None,
) -> list[Part]:
    """Return a part for each named volume of a mesh file, in the file's order; `materials` holds the material of each by name.

    Nodes on the interface of two volumes come in both parts, and a surface gives each part the facets that bound it. Errors as
    for `read_mesh`, and where the names of volumes and materials differ.
    """
    if not isinstance(materials, Mapping):
        raise InputError(f"materials: expected those of the volumes by their names, {{'name': Material(...)}}, got {shown(materials)}")
    return _read(path_of("path", "a mesh file", path), plane, thickness).parts(materials, elements)


def write_mesh(part: Part, path: str | os.PathLike[str], *, surfaces: bool = True) -> None:
    """Write a part's mesh and surfaces, in the format that the extension says; nothing is lost of points, cells and surfaces.
    Named points and lines (`Part.nodes`) are kept in .msh alone.

    A format that cannot keep named surfaces (.inp, .med, .mesh) is refused unless surfaces=False leaves them out. The part's name is
    kept in .msh alone. A facet that is on several surfaces is written once for each; a surface without facets is left out. The file
    appears whole or not at all. InputError where the extension is none of these, the folder is missing or a name cannot be kept.
    """
    path = path_of("path", "a mesh file to write", path)
    _check_writable(path, part, surfaces)
    kept = {name: facets for name, facets in part.surfaces.items() if len(facets)} if surfaces else {}
    with replacing(path) as temporary:
        if path.suffix == ".msh":
            _write_msh(part, kept, temporary)
        else:
            _write_meshio(part, kept, temporary)


def _check_writable(path: Path, part: Part, surfaces: bool) -> None:
    if not path.parent.is_dir():
        raise InputError(f"{path}: expected an existing folder to write to, got {str(path.parent)!r}")
    if path.suffix not in KEEPS_CELLS:
        raise InputError(f"{path}: expected one of the extensions {', '.join(KEEPS_CELLS)}, got {path.suffix!r}")
    if surfaces and part.surfaces and path.suffix not in KEEPS_SURFACES:
        raise InputError(
            f"{path}: expected one of {', '.join(KEEPS_SURFACES)}, which keep the {len(part.surfaces)} surfaces of part {part.name!r}, or "
            f"surfaces=False to leave them out, got {path.suffix!r}"
        )
    if CELL_TYPES[part.cell_type].order == 2 and path.suffix not in KEEPS_SECOND_ORDER:
        raise InputError(f"{path}: expected {', '.join(KEEPS_SECOND_ORDER)} for cells of second order, got {path.suffix!r}")
    if surfaces and "" in part.surfaces:
        raise InputError(f"{path}: expected surfaces with names, got part {part.name!r} with a surface ''")
    if path.suffix == ".msh":
        for name in (part.name, *(part.surfaces if surfaces else ()), *part.nodes):
            if not 0 < len(name.encode()) <= _MSH_NAME or set('"\n\r') & set(name):
                raise InputError(f"{path}: expected names of 1 to {_MSH_NAME} bytes without quotation marks and line breaks, got {name!r}")


def _read(path: Path, plane: Literal["strain", "stress"], thickness: float) -> NamedMesh:
    if not path.is_file():
        raise InputError(f"{path}: expected a mesh file, got none at this place")
    note_read(path)
    return read_foreign(path, plane, thickness)


def _write_msh(part: Part, surfaces: Mapping[str, IntArray], path: Path) -> None:
    """MSH 4.1 in binary, the only one that keeps every digit; one discrete entity and physical group for the cells and each surface."""
    d = part.dimension
    points = np.zeros((len(part.points), 3))
    points[:, :d] = part.points
    with gmsh_model(part.name) as gmsh:
        volume = gmsh.model.addDiscreteEntity(d)
        gmsh.model.mesh.addNodes(d, volume, np.arange(1, len(points) + 1), points.ravel())
        in_gmsh = np.argsort(CELL_TYPES[part.cell_type].from_gmsh)
        gmsh.model.mesh.addElementsByType(volume, GMSH_NUMBERS[part.cell_type], [], part.cells[:, in_gmsh].ravel() + 1)
        gmsh.model.addPhysicalGroup(d, [volume], name=part.name)
        for name, facets in surfaces.items():
            surface = gmsh.model.addDiscreteEntity(d - 1)
            gmsh.model.mesh.addElementsByType(surface, GMSH_NUMBERS[CELL_TYPES[part.cell_type].facet_type], [], facets.ravel() + 1)
            gmsh.model.addPhysicalGroup(d - 1, [surface], name=name)
        for name, nodes in part.nodes.items():
            below, kind = (0, 15) if nodes.ndim == 1 else (1, GMSH_LINES[nodes.shape[1]])
            entity = gmsh.model.addDiscreteEntity(below)
            gmsh.model.mesh.addElementsByType(entity, kind, [], nodes.ravel() + 1)
            gmsh.model.addPhysicalGroup(below, [entity], name=name)
        gmsh.option.setNumber("Mesh.Binary", 1)
        gmsh.write(str(path))


def _write_meshio(part: Part, surfaces: Mapping[str, IntArray], path: Path) -> None:
    meshio = meshio_package()
    points = np.zeros((len(part.points), 3))  # VTK has no 2D points
    points[:, : part.dimension] = part.points
    cells = [(TO_MESHIO.get(part.cell_type, part.cell_type), part.cells)]
    data: dict[str, list[np.ndarray]] = {}
    if surfaces:
        facet_type = CELL_TYPES[part.cell_type].facet_type
        cells.append((TO_MESHIO.get(facet_type, facet_type), np.concatenate(list(surfaces.values()))))
        of_surface = np.repeat(np.arange(len(surfaces)), [len(facets) for facets in surfaces.values()])
        none = np.zeros(len(part.cells), dtype=np.int32)
        data = {SURFACE + quote(name): [none, (of_surface == i).astype(np.int32)] for i, name in enumerate(surfaces)}
    options = {"data_format": "XML"} if path.suffix == ".xdmf" else {}  # one file, which can be renamed whole
    quietly(path, "a mesh that this format can hold", lambda: meshio.Mesh(points, cells, cell_data=data).write(path, **options))
