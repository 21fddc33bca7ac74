"""Solids and plates meshed by gmsh: parts within closed surfaces and polygons."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from types import ModuleType

import numpy as np
from numpy.typing import ArrayLike

from fcsim.arrays import is_number
from fcsim.brief import shown
from fcsim.errors import InputError
from fcsim.mesh.blocks import part_from_gmsh
from fcsim.mesh.material import Material
from fcsim.mesh.part import Part
from fcsim.mesh.solids.closed_surface import ClosedSurface
from fcsim.mesh.solids.outline import outline_of
from fcsim.runtime import gmsh_model


def meshed_solid(surface: ClosedSurface, material: Material, size: float) -> Part:
    """Return the part within a closed surface, with the surface "skin"; cells of about `size` [m].

    Six faces of four sides around eight corners: structured hexahedra; other shapes: tetrahedra.
    """
    _checked(surface.name, size)
    box = len(surface.points) == 8 and sorted(map(len, surface.polygons)) == [4] * 6
    with gmsh_model(surface.name) as gmsh:
        corner = [gmsh.model.geo.addPoint(*point, size) for point in surface.points.tolist()]
        lines: dict[tuple[int, int], int] = {}
        faces = [gmsh.model.geo.addPlaneSurface([_loop(gmsh, corner, lines, polygon)]) for polygon in surface.polygons]
        volume = gmsh.model.geo.addVolume([gmsh.model.geo.addSurfaceLoop(faces)])
        return _meshed(gmsh, surface.name, material, (3, [volume]), (2, faces), box)


def meshed_polygon(
    name: str, points: ArrayLike, material: Material, size: float, *, thickness: float = 1.0, holes: Sequence[ArrayLike] = ()
) -> Part:
    """Return the plane part within a polygon of corners (n, 2) [m] and around its holes, with the surface "skin".

    Cells of about `size` [m]; of four corners structured quadrilaterals, of others triangles. In plane strain; thickness [m]. InputError:
    see `outline_of`.
    """
    _checked(name, size)
    loops = outline_of(name, points, holes)
    with gmsh_model(name) as gmsh:
        corner = [gmsh.model.geo.addPoint(x, y, 0.0, size) for x, y in np.concatenate(loops).tolist()]
        first, lines = np.cumsum([0, *map(len, loops)]).tolist(), dict[tuple[int, int], int]()
        curves = [_loop(gmsh, corner, lines, tuple(range(a, b))) for a, b in pairwise(first)]
        face = gmsh.model.geo.addPlaneSurface(curves)
        return _meshed(gmsh, name, material, (2, [face]), (1, list(lines.values())), len(corner) == 4, thickness)


def _checked(name: str, size: float) -> None:
    if not (is_number(size) and size > 0):
        raise InputError(f"mesh of {name!r}: expected cells of a size > 0 in m, got {shown(size)}")


def _loop(gmsh: ModuleType, corner: list[int], lines: dict[tuple[int, int], int], polygon: tuple[int, ...]) -> int:
    """A loop of lines, each made once."""
    sides = []
    for a, b in zip(polygon, (*polygon[1:], polygon[0]), strict=True):
        if (b, a) in lines:
            sides.append(-lines[b, a])
        else:
            sides.append(lines.setdefault((a, b), 0) or gmsh.model.geo.addLine(corner[a], corner[b]))
            lines[a, b] = sides[-1]
    return int(gmsh.model.geo.addCurveLoop(sides))


def _meshed(
    gmsh: ModuleType,
    name: str,
    material: Material,
    inside: tuple[int, list[int]],
    skin: tuple[int, list[int]],
    structured: bool,
    thickness: float = 1.0,
) -> Part:
    gmsh.model.geo.synchronize()
    gmsh.model.addPhysicalGroup(*inside, name="body")
    gmsh.model.addPhysicalGroup(*skin, name="skin")
    if structured:
        gmsh.model.mesh.setTransfiniteAutomatic(recombine=True)
    gmsh.model.mesh.generate(inside[0])
    return part_from_gmsh(gmsh, name, material, thickness=thickness)
