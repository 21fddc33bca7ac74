"""Meshes of the published problems: mapped blocks, rings, sectors and wedges of bodies of revolution, made of arrays alone."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from fcsim.mesh.cell_type import CELL_TYPES
from fcsim.mesh.part import Part

Map = Callable[[np.ndarray], np.ndarray]


def spaced(a: float, b: float, n: int, ratio: float = 1.0) -> np.ndarray:
    """n cells from a to b, each `ratio` times as long as the last."""
    ends = np.concatenate([[0.0], np.cumsum(ratio ** np.arange(n))])
    return a + (b - a) * ends / ends[-1]


def block(
    name: str,
    axes: Sequence[Any],
    material: Any,
    elements: str = "Q1",
    at: Map | None = None,
    plane: str = "strain",
    thickness: float = 1.0,
    regions: dict[str, Callable[[np.ndarray], np.ndarray]] | None = None,
) -> Part:
    """The image under `at` of a grid with nodes at the coordinates `axes`, one array a direction; surfaces "x-", "x+", "y-", ... of the
    grid. Of second order the middle nodes lie on the image too. regions: masks of the cells' middles (nc, d) in the grid."""
    d = len(axes)
    sizes = [len(a) for a in axes]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, d).astype(float)
    number = np.arange(len(points)).reshape(sizes)
    low, high = slice(None, -1), slice(1, None)
    ring = [(0, 0), (1, 0), (1, 1), (0, 1)]
    corners: list[tuple[int, ...]] = [*ring] if d == 2 else [(*c, k) for k in (0, 1) for c in ring]
    cells = np.stack([number[tuple((low, high)[k] for k in corner)].ravel() for corner in corners], axis=1)
    cell_type = "quadrilateral" if d == 2 else "hexahedron"
    facets = cells[:, CELL_TYPES[cell_type].facets].reshape(-1, 2 ** (d - 1))
    surfaces = {}
    for k in range(d):
        for sign, value in (("-", axes[k][0]), ("+", axes[k][-1])):
            surfaces["xyz"[k] + sign] = facets[np.all(points[facets][..., k] == value, axis=1)]
    middles = points[cells].mean(axis=1)
    numbers = {label: np.flatnonzero(mask(middles)) for label, mask in (regions or {}).items()}
    part = Part(name, points, cells, cell_type, surfaces, material, plane, thickness, elements=elements, regions=numbers)
    if at is None:
        return part
    return replace(part, points=at(part.points), elements=elements)


def sector(a: float, b: float, first: float, last: float, centre: tuple[float, float] = (0.0, 0.0)) -> Map:
    """(r, angle) of the grid, r in [a, b] and the angle in [first, last] as shares of 0 ... 1, to the plane: "x-" is the inner arc."""

    def at(p: np.ndarray) -> np.ndarray:
        r, angle = a + (b - a) * p[:, 0], first + (last - first) * p[:, 1]
        around = np.stack([r * np.cos(angle), r * np.sin(angle)], axis=1) + centre
        return np.concatenate([around, p[:, 2:]], axis=1)

    return at


def wedge(angle: float) -> Map:
    """(r, z, share of the angle) of a 3D grid to space: a body of revolution about z between two meridian planes at -angle/2 and angle/2,
    which are its surfaces "z-" and "z+"."""

    def at(p: np.ndarray) -> np.ndarray:
        turn = angle * (0.5 - p[:, 2])
        return np.stack([p[:, 0] * np.cos(turn), p[:, 0] * np.sin(turn), p[:, 1]], axis=1)

    return at


def meridian(angle: float, side: int) -> np.ndarray:
    """The axes (3, 3) of a meridian plane at side * angle/2: radial, across, along the axis."""
    c, s = np.cos(0.5 * angle), np.sin(0.5 * angle) * side
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
