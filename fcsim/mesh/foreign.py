"""Mesh files of others: gmsh's .msh and the formats of meshio, read in a process of their own (`apart`); `main` is what that does."""

from __future__ import annotations

import contextlib
import io
import json
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Literal, cast
from urllib.parse import unquote

import numpy as np

from fcsim.apart import limited, msh_alone, read_apart, refuse_others
from fcsim.errors import InputError, MissingDependency
from fcsim.mesh.cell_type import CELL_TYPES, FROM_MESHIO
from fcsim.mesh.named_mesh import Block, NamedMesh, from_gmsh, named_mesh
from fcsim.runtime import gmsh_model

if TYPE_CHECKING:
    from meshio import Mesh

SURFACE = "surface:"
TAGS = ("gmsh:physical", "medit:ref", "cell_tags")
ANY = "*"
_MESHIO = (
    "meshio writes such files of version 4.1 from meshes without gmsh:dim_tags, and keeps groups with file_format='gmsh22' (meshio.write) "
    "and an entity of its own for each, gmsh:geometrical"
)
NO_GROUPS = ("gmsh:geometrical", "gmsh:bounding_entities", "cell_sets", "vtkGhostType", "vtkOriginalCellIds", "GlobalCellIds")
"""Arrays of cells that programs write besides, which name no groups."""


def read_foreign(path: Path, plane: Literal["strain", "stress"], thickness: float, array: str | None = None) -> NamedMesh:
    """The mesh of a file, read in another process, see `read_apart`.

    array: of whole numbers, one a cell, that are the groups of solid cells in place of the file's own; `ANY`: the only such array there
    is, of a file without groups of solid cells. InputError for one that is not there, and for several.
    """
    arguments = (plane, repr(float(thickness)), "" if array is None else array)
    return read_apart(path, "fcsim.mesh.foreign", arguments, lambda out: _loaded(out, str(path), plane, thickness))


def _loaded(out: Path, source: str, plane: Literal["strain", "stress"], thickness: float) -> NamedMesh:
    with np.load(out, allow_pickle=False) as arrays:
        about = json.loads(str(arrays["about"]))
        return NamedMesh(
            source,
            arrays["points"],
            about["cell_type"],
            {name: arrays[f"volume {k}"] for k, name in enumerate(about["volumes"])},
            {name: arrays[f"surface {k}"] for k, name in enumerate(about["surfaces"])},
            about["ungrouped"],
            plane=plane,
            thickness=thickness,
            nodes={name: arrays[f"nodes {k}"] for k, name in enumerate(about["nodes"])},
        )


def main(path: str, out: str, plane: str, thickness: str, array: str = "") -> int:
    """Read a mesh file within the limits and write its arrays."""

    def read() -> None:
        mesh = _read(Path(path), cast(Literal["strain", "stress"], plane), float(thickness), array)
        about = {"cell_type": mesh.cell_type, "volumes": list(mesh.volumes), "surfaces": list(mesh.surfaces), "ungrouped": mesh.ungrouped}
        about["nodes"] = list(mesh.nodes)
        arrays = {f"volume {k}": cells for k, cells in enumerate(mesh.volumes.values())}
        arrays |= {f"surface {k}": facets for k, facets in enumerate(mesh.surfaces.values())}
        arrays |= {f"nodes {k}": nodes for k, nodes in enumerate(mesh.nodes.values())}
        np.savez(out, allow_pickle=False, points=mesh.points, about=np.array(json.dumps(about)), **arrays)

    return limited(path, read)


def _read(path: Path, plane: Literal["strain", "stress"], thickness: float, array: str) -> NamedMesh:
    if path.suffix == ".msh":
        if array not in ("", ANY):
            raise InputError(f"{path}: expected physical groups for the parts of a .msh file, got the name of an array, {array!r}")
        lost = _without_entities(path)
        if b"$PhysicalNames" in lost:
            raise InputError(f"{path}: expected physical groups by the $Entities of the file, got their names alone: {_MESHIO}")
        with msh_alone(path) as alone, gmsh_model(path.stem) as gmsh:
            try:
                gmsh.merge(str(alone))
                return from_gmsh(gmsh, str(path), plane=plane, thickness=thickness)
            except InputError:
                raise
            except Exception as error:  # gmsh's only exception class, and names of groups that are no UTF-8
                said = str(error).replace(str(alone), path.name) or "nothing that it gives a reason for"
                raise InputError(f"{path}: expected a mesh that gmsh can read, got: {said}{'; ' + _MESHIO if lost else ''}") from None
    refuse_others(path)
    mesh = quietly(path, "a mesh that meshio can read", lambda: _read_meshio(path))
    blocks = quietly(path, "a mesh with groups that can be read", lambda: _blocks(mesh, _chosen(path, mesh, array)))
    return named_mesh(str(path), mesh.points, blocks, plane=plane, thickness=thickness)


def _without_entities(path: Path) -> bytes:
    """The head of a .msh file of version 4 up to its nodes, where it lists no entities; else nothing."""
    head = b""
    with path.open("rb") as file:
        for line in file:
            head += line
            if line.startswith((b"$Nodes", b"$Entities", b"$PartitionedEntities", b"$Elements")):
                break
    return head if head.split()[1:2] and head.split()[1].startswith(b"4") and b"Entities" not in head else b""


def _read_meshio(path: Path) -> Mesh:
    meshio = meshio_package()
    if path.suffix not in meshio.extension_to_filetypes:
        raise InputError(f"{path}: expected the extension of a mesh file (as .msh, .vtu, .vtk, .xdmf), got {path.suffix!r}")
    return meshio.read(path)


def quietly[T](path: Path, expected: str, call: Callable[[], T]) -> T:
    """Call meshio, which prints what is wrong and leaves by SystemExit, and raise InputError instead."""
    said = io.StringIO()
    try:
        with contextlib.redirect_stderr(said), contextlib.redirect_stdout(said):
            return call()
    except (InputError, MissingDependency):
        raise
    except (Exception, SystemExit) as error:  # readers of many formats: what they raise on a broken file is anything
        message = " ".join(said.getvalue().split()) or f"{type(error).__name__}: {error}"
        raise InputError(f"{path}: expected {expected}, got: {message}") from None


def _chosen(path: Path, mesh: Mesh, array: str) -> str:
    """The name of the array that groups solid cells, "": the file's own groups do."""
    solid = [b for b, cells in enumerate(mesh.cells) if _solid(cells.type)]
    if not array or not solid:
        return ""
    whole = [
        key
        for key, data in mesh.cell_data.items()
        if key not in NO_GROUPS and not key.startswith(SURFACE) and all(_whole(np.asarray(data[b])) for b in solid)
    ]
    if array != ANY:
        if array not in whole:
            known = ", ".join(map(repr, whole)) or "none"
            raise InputError(f"{path}: expected an array of whole numbers, one a cell, among {known}, got {array!r}")
        return array
    tagged = any(np.any(mesh.cell_data[key][b]) for key in TAGS if key in mesh.cell_data for b in solid)
    if tagged or any(sets[b] is not None and len(sets[b]) for sets in mesh.cell_sets.values() for b in solid):
        return ""
    whole = [key for key in whole if key not in TAGS and all(np.asarray(mesh.cell_data[key][b]).dtype.kind in "iu" for b in solid)]
    if len(whole) > 1:
        known = ", ".join(map(repr, whole))
        raise InputError(f"{path}: expected the name of the array that says which part a cell is in, got {known}")
    return whole[0] if whole else ""


def _solid(kind: str) -> bool:
    kind = FROM_MESHIO.get(kind, kind)
    return kind in CELL_TYPES and CELL_TYPES[kind].dimension == 3


def _whole(values: np.ndarray) -> bool:
    """Whether these are whole numbers, one a cell."""
    values = values.reshape(len(values), -1)
    return values.shape[1:] == (1,) and values.dtype.kind in "iuf" and bool(np.all(values == np.round(values)))


def _blocks(mesh: Mesh, array: str) -> list[Block]:
    """The elements of a meshio mesh, once for each group that they are in, and those that are in none; array: see `_chosen`."""
    names = {int(values[0]): name for name, values in mesh.field_data.items() if np.size(values) == 2}
    blocks = []
    for b, cells in enumerate(mesh.cells):
        groups: dict[str, np.ndarray] = {}
        if array and _solid(cells.type):
            numbers = np.asarray(mesh.cell_data[array][b]).reshape(-1).astype(np.int64)
            blocks += [
                Block(FROM_MESHIO.get(cells.type, cells.type), np.asarray(cells.data)[numbers == k], str(k)) for k in np.unique(numbers)
            ]
            continue
        for key, data in mesh.cell_data.items():
            if key.startswith(SURFACE):
                groups[unquote(key.removeprefix(SURFACE))] = np.flatnonzero(data[b])
            elif key in TAGS:
                tags = np.asarray(data[b]).reshape(-1).astype(np.int64)
                groups |= {names.get(tag, str(tag)): np.flatnonzero(tags == tag) for tag in np.unique(tags).tolist() if tag != 0}
        groups |= {name: np.asarray(sets[b]) for name, sets in mesh.cell_sets.items() if sets[b] is not None}
        cell_type, elements = FROM_MESHIO.get(cells.type, cells.type), np.asarray(cells.data)
        alone = np.ones(len(elements), dtype=bool)
        for name, members in groups.items():
            alone[members] = False
            blocks.append(Block(cell_type, elements[members], name))
        blocks.append(Block(cell_type, elements[alone]))
    return blocks


def meshio_package() -> ModuleType:
    """meshio; MissingDependency where it is absent."""
    try:
        import meshio
    except ImportError as error:
        raise MissingDependency(f"meshio is needed for mesh files other than .msh ({error}): pip install 'fcsim[fem]'") from None
    return meshio
