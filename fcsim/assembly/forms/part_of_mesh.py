"""A part from a `dolfinx.mesh.Mesh`, with its tags as regions and surfaces."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Literal
from weakref import WeakKeyDictionary

import numpy as np

from fcsim import runtime
from fcsim.arrays import FloatArray, IntArray
from fcsim.errors import InputError
from fcsim.mesh.cell_type import CELL_TYPES, CellType
from fcsim.mesh.facets import orient_facets
from fcsim.mesh.material import AnyMaterial, ByRegion
from fcsim.mesh.part import Part

if TYPE_CHECKING:
    from dolfinx.mesh import Mesh, MeshTags

_MESHES: WeakKeyDictionary[Part, Mesh] = WeakKeyDictionary()


def part_from_dolfinx(
    name: str,
    mesh: Mesh,
    material: AnyMaterial | Mapping[int, AnyMaterial],
    *,
    cell_tags: MeshTags | None = None,
    facet_tags: MeshTags | None = None,
    surfaces: Mapping[str, int | tuple[int, ...]] | None = None,
    plane: Literal["strain", "stress"] = "strain",
    thickness: float = 1.0,
    elements: str | None = None,
) -> Part:
    """Return the part of a mesh of first or second order, its nodes numbered as `mesh.geometry.x`, its cells as the mesh's.

    material: one for all cells, or one for each tag of `cell_tags` (MeshTags of the cells): regions bonded where they share nodes, named
    by the tags. surfaces: name -> tag, or tags, of `facet_tags` (MeshTags of the facets); default: every tag, named by its number.
    The rest as `Part`. InputError for a mesh on several processes, cells of other kinds, tags that are not there or not on the boundary.
    """
    what = f"Part {name!r}"
    if not isinstance(mesh, runtime.dolfinx().mesh.Mesh):
        raise InputError(f"{what}: expected a dolfinx.mesh.Mesh, got {mesh!r:.80}")
    if mesh.geometry.x.dtype != np.float64:
        raise InputError(f"{what}: expected a mesh with coordinates of float64, got {mesh.geometry.x.dtype}")
    if mesh.comm.size != 1:
        raise InputError(f"{what}: expected a mesh on one process (COMM_SELF), got one on {mesh.comm.size}")
    cell = _cell(mesh, what)
    d = cell.dimension
    order = runtime.dolfinx().cpp.io.perm_vtk(mesh.topology.cell_type, cell.size)
    numbered = np.asarray(mesh.geometry.dofmaps[0], dtype=np.int64)
    cells = np.empty_like(numbered)
    cells[:, order] = numbered
    points = np.array(mesh.geometry.x[:, :d], dtype=np.float64)
    cells = _right_handed(points, cells, cell)
    regions: dict[str, IntArray] = {}
    given_material: AnyMaterial | ByRegion
    if not isinstance(material, Mapping):
        given_material = material
    else:
        if cell_tags is None or cell_tags.dim != d:
            raise InputError(f"{what}: expected cell_tags, MeshTags of the cells, with a material for each tag")
        regions = {str(tag): np.asarray(cell_tags.find(tag), dtype=np.int64) for tag in material}
        given = {int(tag) for tag in np.unique(cell_tags.values)}
        if given != set(material) or len(cell_tags.indices) != len(cells):
            raise InputError(
                f"{what}: expected a material for each tag and a tag for each cell, got materials for {sorted(material)}, tags "
                f"{sorted(given)} on {len(cell_tags.indices)} of {len(cells)} cells"
            )
        given_material = ByRegion({str(tag): own for tag, own in material.items()})
    named = _surfaces(mesh, facet_tags, surfaces, cells, cell.name, what)
    part = Part(
        *(name, points, cells, cell.name, named, given_material),
        plane=plane,
        thickness=thickness,
        elements=elements,
        regions=regions,
    )
    if part.cell_type == cell.name:
        _MESHES[part] = mesh
    return part


def own_mesh(part: Part) -> Mesh | None:
    """The mesh that a part was made of, as long as its cells are that mesh's; None of others."""
    return _MESHES.get(part)


def _cell(mesh: Mesh, what: str) -> CellType:
    name, degree = mesh.topology.cell_name(), mesh.geometry.cmaps[0].degree
    found = [c for c in CELL_TYPES.values() if c.basix == name and c.order == degree and c.dimension == mesh.geometry.dim]
    if not found or mesh.geometry.dofmaps[0].shape[1] != found[0].size:
        known = ", ".join(sorted({c.basix for c in CELL_TYPES.values()}))
        raise InputError(
            f"{what}: expected a mesh of {known} cells that fill their space, of degree 1 or 2, got {name} cells of degree {degree} in "
            f"{mesh.geometry.dim}D"
        )
    return found[0]


def _right_handed(points: FloatArray, cells: IntArray, cell: CellType) -> IntArray:
    """The cells with positive Jacobians: dolfinx numbers cells either way."""
    corners = points[cells]
    J = np.einsum("cai,aj->cij", corners, cell.gradient(cell.centre)[0])
    mirrored = np.linalg.det(J) < 0
    turned = cells.copy()
    turned[mirrored] = cells[mirrored][:, _mirror(cell)]
    return turned


def _mirror(cell: CellType) -> IntArray:
    """Places of the nodes of a cell in its mirror image: of simplices two corners exchanged, else the first axis turned round."""
    image = cell.nodes.copy()
    if cell.simplex:
        image[:, [0, 1]] = image[:, [1, 0]]
    else:
        image[:, 0] *= -1
    return np.argmin(np.linalg.norm(image[:, None] - cell.nodes[None], axis=2), axis=1)


def _surfaces(
    mesh: Mesh, tags: MeshTags | None, surfaces: Mapping[str, int | tuple[int, ...]] | None, cells: IntArray, cell_type: str, what: str
) -> dict[str, IntArray]:
    """The facets of tags by their names, outwards, in the nodes' order of `Part`."""
    if tags is None:
        if surfaces:
            raise InputError(f"{what}: expected facet_tags for the surfaces {', '.join(map(repr, surfaces))}")
        return {}
    d = mesh.topology.dim
    if tags.dim != d - 1:
        raise InputError(f"{what}: expected facet_tags of dimension {d - 1}, got {tags.dim}")
    wanted = surfaces if surfaces is not None else {str(tag): int(tag) for tag in np.unique(tags.values)}
    mesh.topology.create_connectivity(d - 1, d)
    known = {int(tag) for tag in np.unique(tags.values)}
    found = {}
    kind = CELL_TYPES[cell_type]
    for name, own in wanted.items():
        numbers = (own,) if isinstance(own, int | np.integer) else tuple(own)
        if missing := set(numbers) - known:
            raise InputError(f"{what}, surface {name!r}: expected tags among {sorted(known)}, got {sorted(missing)}")
        facets = np.concatenate([tags.find(number) for number in numbers]).astype(np.int32)
        nodes = np.sort(runtime.dolfinx().mesh.entities_to_geometry(mesh, d - 1, facets), axis=1)
        # by the cells' own facets: dolfinx orders the nodes of a quadrilateral as a tensor product
        every = cells[:, kind.facets].reshape(-1, kind.facet_size)
        both = np.concatenate([np.sort(every, axis=1), nodes])
        _, key = np.unique(both, axis=0, return_inverse=True)
        key = key.ravel()
        place = np.zeros(key.max() + 1, dtype=np.int64)
        place[key[: len(every)]] = np.arange(len(every))
        found[name] = orient_facets(cells, cell_type, every[place[key[len(every) :]]], f"{what}, surface {name!r}")
    return found
