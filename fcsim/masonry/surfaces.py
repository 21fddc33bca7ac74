"""Masonry problems from files of surfaces: STL, OBJ, PLY, OFF, 3MF, GLB."""

from __future__ import annotations

import fnmatch
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from fcsim.errors import InputError
from fcsim.masonry.problem import Block, MasonryProblem
from fcsim.mesh.solids.closed_surface import ClosedSurface, closed_surface
from fcsim.mesh.solids.surface_file import read_surfaces

FLOOR = "floor"
_FACES = ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7))


def masonry_of_surfaces(
    path: str | Path, *, mu: float = 0.6, density: float = 2000.0, scale: float | None = None, supports: Sequence[str] = ()
) -> MasonryProblem:
    """Return the problem of a file's solids under their weight, z up; scale: see `read_surfaces`.

    supports: names, or patterns as "pier*", of solids that are held; none: a floor is laid under the lowest point. InputError for a pattern
    that no solid has.
    """
    path = Path(path)
    blocks = tuple(Block(surface, density) for surface in read_surfaces(path, scale=scale))
    return MasonryProblem(path.stem, 3, supported(blocks, supports, path), mu, title=path.stem)


def supported(blocks: Sequence[Block], supports: Sequence[str], path: Path) -> tuple[Block, ...]:
    """The blocks, those that `supports` names or matches held; on a floor where none is. InputError for a pattern that no block has."""
    names = [block.name for block in blocks]
    for pattern in supports:
        if not fnmatch.filter(names, pattern):
            raise InputError(f"{path}, supports: expected names or patterns of solids, {', '.join(names[:8])}, got {pattern!r}")
    held = tuple(
        replace(block, support=block.support or any(fnmatch.fnmatchcase(block.name, pattern) for pattern in supports)) for block in blocks
    )
    return held if any(block.support for block in held) else (*held, Block(_floor([block.surface for block in held], names), support=True))


def _floor(surfaces: Sequence[ClosedSurface], names: Sequence[str]) -> ClosedSurface:
    """A slab under the lowest point of all solids, wider than they are by half their extent, of a name that none of them has."""
    name = FLOOR
    while name in names:
        name = f"{name} below"
    points = np.concatenate([surface.points for surface in surfaces])
    low, high = points.min(axis=0), points.max(axis=0)
    extent = float((high - low).max())
    (x0, y0, _), (x1, y1, _) = low - 0.5 * extent, high + 0.5 * extent
    z0, z1 = low[2] - 0.1 * extent, low[2]
    corners = [(x0, y0, z0), (x1, y0, z0), (x1, y1, z0), (x0, y1, z0), (x0, y0, z1), (x1, y0, z1), (x1, y1, z1), (x0, y1, z1)]
    return closed_surface(name, corners, _FACES)
