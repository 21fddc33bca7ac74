"""Masonry problems from files of meshes: gmsh's .msh, VTK's and those of other programs, whose groups of cells are blocks."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from fcsim.errors import InputError
from fcsim.masonry.problem import Block, MasonryProblem
from fcsim.masonry.surfaces import supported
from fcsim.mesh.cell_type import CELL_TYPES
from fcsim.mesh.facets import refuse_repeated
from fcsim.mesh.foreign import ANY, read_foreign
from fcsim.mesh.named_mesh import UNGROUPED
from fcsim.mesh.solids.mesh_skin import Cells, pieces_of, skin_of
from fcsim.mesh.solids.surface_file import LARGEST

FORMATS = (".msh", ".vtu", ".vtk", ".xdmf", ".inp", ".mesh", ".med")


def masonry_of_mesh(
    path: str | Path,
    *,
    mu: float = 0.6,
    density: float = 2000.0,
    scale: float | None = None,
    supports: Sequence[str] = (),
    array: str | None = None,
) -> MasonryProblem:
    """Return the problem of a mesh's blocks under their weight, z up; supports: see `masonry_of_surfaces`.

    A block is what cells of one group, connected by facets, are: of a physical group (.msh), of a number of the array `array` (by default
    the file's groups, or its only array of whole numbers), of the whole mesh where there are neither; several pieces of a group are
    NAME.1, NAME.2, ... Blocks that share nodes are apart. Deformable blocks are computed with these cells.
    scale: metres to the file's unit of length. InputError: no solid cells, cells of several types, in no group or in two, inverted or
    collapsed ones, skins that touch themselves; without `scale`, blocks of more than 100 m.
    """
    path = Path(path)
    if path.suffix.lower() not in FORMATS:
        raise InputError(f"{path}: expected a mesh file ({', '.join(FORMATS)}), got {path.suffix!r}")
    if not path.is_file():
        raise InputError(f"{path}: expected a mesh file, found none")
    if scale is not None and not (np.isfinite(scale) and scale > 0):
        raise InputError(f"{path}, scale: expected a factor > 0, got {scale}")
    mesh = read_foreign(path, "strain", 1.0, ANY if array is None else array)
    if CELL_TYPES[mesh.cell_type].dimension != 3:
        raise InputError(f"{path}: expected solid cells, got {mesh.cell_type} ones; a plane wall is a problem in JSON")
    if mesh.ungrouped:
        raise InputError(f"{path}: expected every cell in a group, of which blocks are made, got {mesh.ungrouped} cells that are in none")
    refuse_repeated(np.concatenate(list(mesh.volumes.values())), f"{path}, groups {', '.join(map(repr, mesh.volumes))}")
    points = mesh.points * (scale or 1.0)
    groups = {path.stem if name == UNGROUPED else name: cells for name, cells in mesh.volumes.items()}
    pieces = [piece for name, cells in groups.items() for piece in pieces_of(name, points, cells, mesh.cell_type)]
    size = max(float(np.ptp(piece.points, axis=0).max()) for piece in pieces)
    if scale is None and size > LARGEST:
        raise InputError(f"{path}: expected blocks in m, got one of {size:.4g} m; scale=1e-3 if it is in mm, scale=1 if it is so large")
    blocks = [_block(path, piece, density) for piece in pieces]
    return MasonryProblem(path.stem, 3, supported(blocks, supports, path), mu, title=path.stem)


def _block(path: Path, piece: Cells, density: float) -> Block:
    try:
        return Block(skin_of(piece), density, cells=piece)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
