"""A mesh with named volumes and surfaces, as gmsh models and mesh files hold it, and the parts it is made of."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import ModuleType
from typing import Literal

import numpy as np

from fcsim.arrays import FloatArray, IntArray
from fcsim.brief import brief
from fcsim.errors import InputError
from fcsim.mesh.cell_type import CELL_TYPES, ELEMENTS, GMSH_TYPES
from fcsim.mesh.facets import match_facets, refuse_repeated
from fcsim.mesh.material.by_region import ByRegion
from fcsim.mesh.material.law import AnyMaterial
from fcsim.mesh.part import Part
from fcsim.mesh.quality import check_quality

LOWER = {2: ("vertex",), 3: ("vertex", "line", "line3")}
"""By dimension of the mesh: elements of which neither volumes nor surfaces are made."""

UNGROUPED = ""  # also the name of the only volume of a mesh whose cells are in no group


@dataclass(frozen=True)
class Block:
    """Elements of one type (n, k) in the group of this name; an element of several groups comes in a block of each."""

    cell_type: str
    elements: IntArray
    group: str = UNGROUPED


@dataclass(frozen=True, eq=False)
class NamedMesh:
    """points (n, d) [m]; volumes and surfaces: name -> node numbers (ncells, k), (nf, kf); nodes: name -> (k,) of points or (k, 2), (k, 3)
    of lines that are no surfaces; `source` is what messages call the mesh."""

    source: str
    points: FloatArray
    cell_type: str
    volumes: Mapping[str, IntArray]
    surfaces: Mapping[str, IntArray]
    ungrouped: int = 0  # cells in no volume although there are volumes
    plane: Literal["strain", "stress"] = field(default="strain", kw_only=True)
    thickness: float = field(default=1.0, kw_only=True)
    nodes: Mapping[str, IntArray] = field(default_factory=dict, kw_only=True)

    __repr__ = brief

    def part(
        self, material: AnyMaterial | ByRegion, *, name: str | None = None, volume: str | None = None, elements: str | None = None
    ) -> Part:
        """Return the part of `volume`, which can be left out where the mesh has only one, or where a `ByRegion` names a material for
        each: then
        all volumes are one part, bonded where they share nodes. `name`: default that of the volume; elements: those of `Part`."""
        if isinstance(material, ByRegion) and volume is None:
            return self._bonded(material, name or self.source, elements)
        if volume is None:
            if len(self.volumes) > 1 or self.ungrouped:
                others = f" and {self.ungrouped} cells in no volume" if self.ungrouped else ""
                raise InputError(
                    f"{self.source}: expected one volume or an argument volume=, got the volumes {_names(self.volumes)}{others}"
                )
            volume = next(iter(self.volumes))
        if volume not in self.volumes:
            raise InputError(f"{self.source}: expected a volume among {_names(self.volumes)}, got {volume!r}")
        return self._part(volume, material, name or volume or self.source, self._surfaces_by_volume()[volume], elements)

    def parts(self, materials: Mapping[str, AnyMaterial], elements: str | None = None) -> list[Part]:
        """Return one part for each volume, in the order of the mesh; `materials` holds the material of each by name."""
        if self.ungrouped:
            raise InputError(f"{self.source}: expected every cell in a volume, got {self.ungrouped} cells that are in none")
        if set(materials) != set(self.volumes):
            raise InputError(f"{self.source}: expected materials for the volumes {_names(self.volumes)}, got them for {_names(materials)}")
        refuse_repeated(np.concatenate(list(self.volumes.values())), f"{self.source}, volumes {_names(self.volumes)}")
        surfaces = self._surfaces_by_volume()
        return [self._part(volume, materials[volume], volume or self.source, surfaces[volume], elements) for volume in self.volumes]

    def _bonded(self, material: ByRegion, name: str, elements: str | None) -> Part:
        """All volumes as one part; surfaces are what bounds them together, interfaces are left out."""
        if self.ungrouped or set(material.materials) != set(self.volumes):
            others = f" and {self.ungrouped} cells in no volume" if self.ungrouped else ""
            wanted = f"{_names(self.volumes)}{others}"
            raise InputError(f"{self.source}: expected materials for the volumes {wanted}, got them for {_names(material.materials)}")
        sizes = np.cumsum([0, *map(len, self.volumes.values())])
        regions = {volume: np.arange(a, b) for volume, a, b in zip(self.volumes, sizes[:-1], sizes[1:], strict=True)}
        joined = np.concatenate(list(self.volumes.values()))
        refuse_repeated(joined, f"{self.source}, volumes {_names(self.volumes)}")
        surfaces = {}
        for surface, facets in self.surfaces.items():
            count, oriented = match_facets(joined, self.cell_type, facets)
            if np.any(count == 0):
                raise InputError(
                    f"{self.source}, surface {surface!r}: expected facets of the volumes, got {np.count_nonzero(count == 0)} others"
                )
            if np.any(count == 1):
                surfaces[surface] = oriented[count == 1]
        whole = replace(self, volumes={name: joined})
        return whole._part(name, material, name, surfaces, elements, regions)

    def _surfaces_by_volume(self) -> dict[str, dict[str, IntArray]]:
        """The outward facets of every surface that bound each volume; a facet between two volumes bounds both."""
        sorted_out: dict[str, dict[str, IntArray]] = {volume: {} for volume in self.volumes}
        for name, facets in self.surfaces.items():
            what = f"{self.source}, surface {name!r}"
            refuse_repeated(facets, what)
            lost = np.ones(len(facets), dtype=bool)
            for volume, cells in self.volumes.items():
                count, oriented = match_facets(cells, self.cell_type, facets)
                bounds = count == 1
                lost &= ~bounds
                if bounds.any():
                    sorted_out[volume][name] = oriented[bounds]
            if lost.any():
                raise InputError(
                    f"{what}: expected facets on the boundary of a volume, got {np.count_nonzero(lost)} of {len(facets)} that are not, "
                    f"the first with nodes at {self.points[facets[np.argmax(lost)]].tolist()}"
                )
        return sorted_out

    def _part(
        self,
        volume: str,
        material: AnyMaterial | ByRegion,
        name: str,
        surfaces: Mapping[str, IntArray],
        elements: str | None,
        regions: Mapping[str, IntArray] | None = None,
    ) -> Part:
        used, cells = np.unique(self.volumes[volume], return_inverse=True)
        number = np.full(len(self.points), -1)
        number[used] = np.arange(len(used))
        part = Part(
            name=name,
            points=self.points[used],
            cells=cells.reshape(self.volumes[volume].shape),
            cell_type=self.cell_type,
            surfaces={surface: number[facets] for surface, facets in surfaces.items()},
            material=material,
            plane=self.plane,
            thickness=self.thickness,
            elements=ELEMENTS[self.cell_type][0] if elements is None else elements,
            regions=regions or {},
            nodes=_nodes_of(self.nodes, number),
        )
        check_quality(part)
        return part


def _names(names: Iterable[str]) -> str:
    return ", ".join(repr(name) for name in names) or "none"


def _type_of_cells(source: str, points: FloatArray, blocks: Sequence[Block]) -> str:
    """The one type of the cells of the highest dimension; InputError for other kinds than `CELL_TYPES`, several, none, or a surface in
    space."""
    types = list(dict.fromkeys(block.cell_type for block in blocks))
    if unknown := [t for t in types if t not in CELL_TYPES and t not in ("line", "line3", "vertex")]:
        raise InputError(
            f"{source}: expected cells of first or full second order ({', '.join(CELL_TYPES)}), got {', '.join(unknown)}: prisms, pyramids "
            "and cells without middle nodes of their faces (gmsh: Mesh.SecondOrderIncomplete = 0) are not supported"
        )
    known = [t for t in types if t in CELL_TYPES]
    dimension = max((CELL_TYPES[t].dimension for t in known), default=0)
    cell_types = [t for t in known if CELL_TYPES[t].dimension == dimension]
    _check_numbers(source, points, blocks)
    planar = dimension == 2 and (points.shape[1] == 2 or np.ptp(points[:, 2]) <= 1e-12 * np.ptp(points[:, :2], axis=0).max())
    if dimension == 0 or (dimension == 2 and not planar):
        got = "a surface mesh in space" if dimension else "none" + (f" but {', '.join(types)}" if types else "")
        raise InputError(f"{source}: expected volume cells (or, in 2D, cells in a plane z = const), got {got}")
    if len(cell_types) > 1:
        raise InputError(f"{source}: expected cells of one type, got a mixture of {' and '.join(cell_types)}")
    return cell_types[0]


def named_mesh(
    source: str, points: FloatArray, blocks: Sequence[Block], *, plane: Literal["strain", "stress"] = "strain", thickness: float = 1.0
) -> NamedMesh:
    """Sort blocks of elements into volumes (the highest dimension), surfaces (one below) and nodes (points, in space lines) by group.

    points (n, 3) or (n, 2) [m]; a 2D mesh lies in a plane z = const. InputError for elements of other kinds than `CELL_TYPES` or not of
    one type, and where there are no volume cells.
    """
    blocks = [block for block in blocks if len(block.elements)]
    points = np.asarray(points, dtype=float)
    cell_type = _type_of_cells(source, points, blocks)
    dimension, facet_type = CELL_TYPES[cell_type].dimension, CELL_TYPES[cell_type].facet_type
    volumes = _by_group([block for block in blocks if block.cell_type == cell_type])
    named = [block for block in blocks if block.group != UNGROUPED]
    facets = [b for b in named if b.cell_type == facet_type]
    for block in named:
        if block.cell_type in CELL_TYPES and CELL_TYPES[block.cell_type].dimension == dimension - 1 and block.cell_type != facet_type:
            what = f"{source}, surface {block.group!r}"
            raise InputError(f"{what}: expected {facet_type} facets on {cell_type} cells, got {block.cell_type}")
    ungrouped = len(volumes.pop(UNGROUPED, ())) if len(volumes) > 1 else 0
    return NamedMesh(
        source,
        points[:, :dimension],
        cell_type,
        volumes,
        _by_group(facets),
        ungrouped=ungrouped,
        plane=plane,
        thickness=thickness,
        nodes=_points_and_lines([block for block in named if block.cell_type in LOWER[dimension]]),
    )


def _points_and_lines(blocks: Sequence[Block]) -> dict[str, IntArray]:
    """Nodes by their groups: points (k,), lines (k, 2) or (k, 3); points where a group has both."""
    nodes = {}
    for group in dict.fromkeys(block.group for block in blocks):
        own = [block.elements for block in blocks if block.group == group]
        one_kind = len({elements.shape[1] for elements in own}) == 1
        nodes[group] = np.concatenate(own if one_kind else [e.ravel() for e in own]).astype(np.int64)
        if not one_kind or nodes[group].shape[1] == 1:
            nodes[group] = np.unique(nodes[group])
    return nodes


def _nodes_of(groups: Mapping[str, IntArray], number: IntArray) -> dict[str, IntArray]:
    """The groups by the numbers of a part's nodes, -1 for those that it has not: without these, and without groups that it has none of."""
    own = {}
    for name, nodes in groups.items():
        there = number[nodes]
        there = there[there >= 0] if there.ndim == 1 else there[(there >= 0).all(axis=1)]
        if len(there):
            own[name] = there
    return own


def _check_numbers(source: str, points: FloatArray, blocks: Sequence[Block]) -> None:
    """InputError for coordinates that are none, and for elements of nodes that are not there."""
    if points.ndim != 2 or points.shape[1] not in (2, 3):
        raise InputError(f"{source}: expected points of two or three coordinates, got an array of shape {points.shape}")
    if not np.all(np.isfinite(points)):
        raise InputError(f"{source}: expected finite coordinates, got {points[~np.isfinite(points).all(axis=1)][0].tolist()}")
    for block in blocks:
        low, high = block.elements.min(), block.elements.max()
        if low < 0 or high >= len(points):
            what = f"{block.cell_type} elements" + (f" of group {block.group!r}" if block.group else "")
            raise InputError(f"{source}: expected {what} of the nodes 0 to {len(points) - 1}, got {low} to {high}")


def _by_group(blocks: Sequence[Block]) -> dict[str, IntArray]:
    collected: dict[str, list[IntArray]] = {}
    for block in blocks:
        collected.setdefault(block.group, []).append(block.elements)
    return {group: np.concatenate(elements).astype(np.int64) for group, elements in collected.items()}


def from_gmsh(gmsh: ModuleType, source: str, *, plane: Literal["strain", "stress"] = "strain", thickness: float = 1.0) -> NamedMesh:
    """Read the current gmsh model, meshed: its physical groups are the volumes and surfaces (a group without a name: its number)."""
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    order = np.argsort(tags)
    tags, points = tags[order], coordinates.reshape(-1, 3)[order]
    blocks: list[Block] = []
    grouped = set()

    def add(entity: tuple[int, int], group: str) -> None:
        for number, _, nodes in zip(*gmsh.model.mesh.getElements(*entity), strict=True):
            described, _, _, size, *_ = gmsh.model.mesh.getElementProperties(number)
            places = np.searchsorted(tags, nodes)
            if np.any(places >= len(tags)) or np.any(tags[places] != nodes):
                raise InputError(f"{source}: expected elements of nodes that are there, got some of others in {group or 'no group'}")
            kind, places = GMSH_TYPES.get(number, described), places.reshape(-1, size)
            blocks.append(Block(kind, places[:, CELL_TYPES[kind].from_gmsh] if kind in CELL_TYPES else places, group))

    for dimension, tag in sorted(gmsh.model.getPhysicalGroups(), key=lambda group: group[1]):
        for entity in gmsh.model.getEntitiesForPhysicalGroup(dimension, tag):
            add((dimension, abs(int(entity))), gmsh.model.getPhysicalName(dimension, tag) or str(tag))
            grouped.add((dimension, abs(int(entity))))
    for rest in sorted(set(gmsh.model.getEntities()) - grouped):
        add(rest, UNGROUPED)
    return named_mesh(source, points, blocks, plane=plane, thickness=thickness)
