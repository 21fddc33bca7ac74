"""Structures by rule: blocks on a floor, circular arches, domes, walls of courses."""

from __future__ import annotations

import math
from collections.abc import Sequence

from fcsim.masonry.json_file import HEXAHEDRON
from fcsim.masonry.problem import Block, MasonryProblem
from fcsim.mesh.solids.closed_surface import closed_surface

DENSITY = 2000.0
"""[kg/m^3] No multiplier depends on it."""
Point = tuple[float, float]


def hexahedron(name: str, corners: Sequence[Sequence[float]], *, support: bool = False, density: float = DENSITY) -> Block:
    """A block of eight corners in VTK's order."""
    return Block(closed_surface(name, corners, HEXAHEDRON), density, support=support)


def cuboid(name: str, low: Sequence[float], high: Sequence[float], *, support: bool = False, density: float = DENSITY) -> Block:
    """A block between two corners (3,) [m]."""
    (x0, y0, z0), (x1, y1, z1) = low, high
    ground = [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]
    return hexahedron(name, [(x, y, z) for z in (z0, z1) for x, y in ground], support=support, density=density)


def prism(name: str, corners: Sequence[Point], depth: float, *, support: bool = False) -> Block:
    """A prism along y from 0 to `depth` over four corners (x, z)."""
    a, b, c, d = corners
    return hexahedron(name, [(x, y, z) for y in (0.0, depth) for x, z in (a, b, c, d)], support=support)


def one_block(width: float, height: float, mu: float, *, depth: float = 0.3) -> MasonryProblem:
    """A block on a wide floor, in the plane."""
    floor = cuboid("floor", (-9 * height, 0.0, -height), (9 * height, depth, 0.0), support=True)
    return MasonryProblem("block", 2, (floor, cuboid("block", (0.0, 0.0, 0.0), (width, depth, height))), mu)


def stack(count: int, width: float, height: float, mu: float, *, depth: float = 0.3) -> MasonryProblem:
    """Equal blocks on each other, in the plane."""
    floor = cuboid("floor", (-9 * width, 0.0, -height), (9 * width, depth, 0.0), support=True)
    blocks = [cuboid(f"b{k}", (0.0, 0.0, k * height), (width, depth, (k + 1) * height)) for k in range(count)]
    return MasonryProblem("stack", 2, (floor, *blocks), mu)


def arch(voussoirs: int, thickness: float, mu: float, *, embrace: float = math.pi, radius: float = 1.0) -> MasonryProblem:
    """A circular arch of mean radius [m] between two supports, joints radial, chords straight; embrace [rad]."""
    low, high = radius - thickness / 2, radius + thickness / 2
    begin, turn = (math.pi - embrace) / 2, embrace / voussoirs

    def joint(k: int) -> tuple[Point, Point]:
        a = begin + k * turn
        return (low * math.cos(a), low * math.sin(a)), (high * math.cos(a), high * math.sin(a))

    blocks = []
    for k in range(-1, voussoirs + 1):
        (a, b), (d, c) = joint(k), joint(k + 1)
        blocks.append(prism(f"v{k}", (a, b, c, d), 0.5 * radius, support=k in (-1, voussoirs)))
    return MasonryProblem("arch", 2, tuple(blocks), mu)


def dome(ratio: float, *, rings: int = 8, sectors: int = 8, mu: float = 0.7) -> MasonryProblem:
    """A hemisphere of mean radius 1 m and thickness `ratio` on a floor, joints radial, the last of the rings one block."""
    low, high = 1 - ratio / 2, 1 + ratio / 2

    def corner(r: float, ring: int, sector: float) -> tuple[float, float, float]:
        up, around = ring * math.pi / 2 / rings, sector * 2 * math.pi / sectors
        return r * math.cos(up) * math.cos(around), r * math.cos(up) * math.sin(around), r * math.sin(up)

    blocks = [cuboid("floor", (-2.0, -2.0, -1.0), (2.0, 2.0, 0.0), support=True)]
    for ring in range(rings - 1):
        for sector in range(sectors):
            at = [(r, ring + k, sector + s) for k in (0, 1) for r, s in ((low, 0), (high, 0), (high, 1), (low, 1))]
            blocks.append(hexahedron(f"r{ring}s{sector}", [corner(*c) for c in at]))
    rim = [corner(r, rings - 1, s) for r in (low, high) for s in range(sectors)]
    sides = [(k, (k + 1) % sectors, sectors + (k + 1) % sectors, sectors + k) for k in range(sectors)]
    faces = [tuple(range(sectors)), tuple(range(sectors, 2 * sectors)), *sides]
    blocks.append(Block(closed_surface("cap", rim, faces), DENSITY))
    return MasonryProblem("dome", 3, tuple(blocks), mu)


def wall(courses: Sequence[Sequence[float]], unit: Point, mu: float, *, depth: float = 0.2) -> MasonryProblem:
    """Courses from below on a floor, in the plane: lengths in units of `unit[0]` [m], negative ones voids; `unit[1]` high."""
    length, height = unit
    wide = sum(abs(part) for part in courses[0]) * length
    blocks = [cuboid("floor", (-wide, 0.0, -height), (2 * wide, depth, 0.0), support=True)]
    for row, course in enumerate(courses):
        x = 0.0
        for k, part in enumerate(course):
            if part > 0:
                low, high = (x, 0.0, row * height), (x + part * length, depth, (row + 1) * height)
                blocks.append(cuboid(f"c{row}b{k}", low, high))
            x += abs(part) * length
    return MasonryProblem("wall", 2, tuple(blocks), mu)
