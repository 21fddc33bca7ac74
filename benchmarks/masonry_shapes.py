"""Structures in space for `benchmarks.masonry_motion`, by rule: vaults, an arch bridge, a colonnade of drums, a wall with openings."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np

from benchmarks.masonry import HEIGHT, LENGTH, THICKNESS
from fcsim.masonry import Block
from fcsim.masonry.atlas.shapes import cuboid, prism
from fcsim.mesh.solids.closed_surface import ClosedSurface, closed_surface


def barrel(
    around: int, along: int, *, radius: float = 1.0, thickness: float = 0.2, width: float = 0.4, embrace: float = math.pi
) -> Iterator[Block]:
    """A barrel along y in running bond, joints radial, chords straight, springers held; width [m] of a block, embrace [rad]."""
    begin = (math.pi - embrace) / 2
    angles = np.linspace(begin, math.pi - begin, around + 1)
    low, high = radius - thickness / 2, radius + thickness / 2
    for k, (a, b) in enumerate(pairwise(angles)):
        ends = [0.0, *(j + (0.5 if k % 2 else 1.0) for j in range(along - (k + 1) % 2)), float(along)]
        corners = [(r * math.cos(t), r * math.sin(t)) for r, t in ((low, a), (high, a), (high, b), (low, b))]
        for j, (y0, y1) in enumerate(pairwise(ends)):
            block = prism(f"v{k}c{j}", corners, width * (y1 - y0), support=k in (0, around - 1))
            yield replace(block, surface=moved(block.surface, width * y0))


def moved(surface: ClosedSurface, y: float) -> ClosedSurface:
    """The surface moved along y [m]."""
    return replace(surface, points=surface.points + np.array([0.0, y, 0.0]))


def drum(name: str, centre: tuple[float, float], radius: float, low: float, high: float, sides: int = 12) -> Block:
    """An upright prism over a regular polygon."""
    turn = 2 * math.pi / sides
    ring = [(centre[0] + radius * math.cos(k * turn), centre[1] + radius * math.sin(k * turn)) for k in range(sides)]
    points = [(x, y, z) for z in (low, high) for x, y in ring]
    below, above = tuple(range(sides))[::-1], tuple(range(sides, 2 * sides))
    around = [(k, (k + 1) % sides, sides + (k + 1) % sides, sides + k) for k in range(sides)]
    return Block(closed_surface(name, points, [below, above, *around]), 2600.0)


def colonnade(columns: int, drums: int) -> Iterator[Block]:
    """Columns of drums with capitals, architraves in two courses from axis to axis on them: radius 0.5 m, drums of 1 m, axes 3 m apart."""
    apart, radius, top = 3.0, 0.5, float(drums)
    for c in range(columns):
        for k in range(drums):
            yield drum(f"c{c}d{k}", (c * apart, 0.0), radius, float(k), k + 1.0)
        yield cuboid(f"c{c}capital", (c * apart - 0.6, -0.6, top), (c * apart + 0.6, 0.6, top + 0.4))
    for c in range(columns - 1):
        for side, (y0, y1) in enumerate(((-0.5, 0.0), (0.0, 0.5))):
            yield cuboid(f"a{c}s{side}", (c * apart, y0, top + 0.4), ((c + 1) * apart, y1, top + 1.0))
    for c in range(columns):
        x0, x1 = max(c - 0.5, 0.0) * apart, min(c + 0.5, columns - 1.0) * apart
        yield cuboid(f"f{c}", (x0, -0.5, top + 1.0), (x1, 0.5, top + 1.5))


def opening(units: int, courses: int, void: tuple[int, int, int, int]) -> Iterator[Block]:
    """A wall of one leaf in running bond with an opening from unit a to b, course c to d, and a lintel of b - a + 1 units over it."""
    a, b, c, d = void
    for course in range(courses):
        ends = [0.0, *(k + (0.5 if course % 2 else 1.0) for k in range(units - (course + 1) % 2)), float(units)]
        for k, (x0, x1) in enumerate(pairwise(ends)):
            for j, (y0, y1) in enumerate(_outside((x0, x1), (a, b) if c <= course < d else (a - 0.5, b + 0.5) if course == d else None)):
                yield cuboid(f"c{course}b{k}.{j}", (y0 * LENGTH, 0, course * HEIGHT), (y1 * LENGTH, THICKNESS, (course + 1) * HEIGHT))
    yield cuboid("lintel", ((a - 0.5) * LENGTH, 0, d * HEIGHT), ((b + 0.5) * LENGTH, THICKNESS, (d + 1) * HEIGHT))


def _outside(part: tuple[float, float], void: tuple[float, float] | None) -> list[tuple[float, float]]:
    """What a void leaves of a part."""
    if void is None:
        return [part]
    left, right = (part[0], min(part[1], void[0])), (max(part[0], void[1]), part[1])
    return [(low, high) for low, high in (left, right) if high > low]
