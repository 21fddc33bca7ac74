"""Structures of stones in space: built of convex pieces, so that a reference needs nothing of fcsim, and written as files."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

G = 9.81
Vector = tuple[float, float, float]
Outline = Sequence[tuple[float, float]]
Faces = tuple[tuple[int, ...], ...]
HEXAHEDRON: Faces = ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7))


@dataclass(frozen=True, eq=False)
class Solid:
    """Corners (n, 3) [m] and faces, lists of corners."""

    corners: np.ndarray
    faces: Faces


@dataclass(frozen=True, eq=False)
class Stone:
    """A surface, the convex pieces that it is made of, and its density [kg/m^3]; 0: a support."""

    surface: Solid
    pieces: tuple[Solid, ...]
    density: float


@dataclass(frozen=True, eq=False)
class Structure:
    stones: tuple[Stone, ...]
    mu: float


def prism(outline: Outline, low: float, high: float, along: str = "z") -> Solid:
    """A polygon, counter-clockwise, from low to high: (x, y) along z, or (x, z) along y."""
    n = len(outline)
    points = np.array([(a, b, c) for c in (low, high) for a, b in outline], dtype=float)
    if along == "y":
        points = points[:, [0, 2, 1]]
    sides = [(k, (k + 1) % n, n + (k + 1) % n, n + k) for k in range(n)]
    faces = (tuple(range(n))[::-1], tuple(range(n, 2 * n)), *sides)
    return Solid(points, faces if along == "z" else tuple(face[::-1] for face in faces))


def box(low: Sequence[float], high: Sequence[float]) -> Solid:
    (x0, y0, z0), (x1, y1, z1) = low, high
    return prism([(x0, y0), (x1, y0), (x1, y1), (x0, y1)], z0, z1)


def stone(solid: Solid, density: float = 2000.0) -> Stone:
    return Stone(solid, (solid,), density)


def floor(half: float = 20.0) -> Stone:
    return stone(box((-half, -half, -1.0), (half, half, 0.0)), 0.0)


def write(path: Path, structure: Structure, *, scale: float = 1.0, turn: Rotation | None = None, slip: float = 0.0) -> Path:
    """The file: lengths times scale (masses kept), all turned in space, each free stone moved by up to `slip` along each axis."""
    turned = turn or Rotation.identity()
    dice = np.random.default_rng(3)
    blocks: list[dict[str, object]] = []
    for k, one in enumerate(structure.stones):
        corners = one.surface.corners + (slip * dice.uniform(-1, 1, 3) if one.density else 0.0)
        block: dict[str, object] = {"id": f"b{k}", "vertices": (scale * turned.apply(corners)).tolist(), "faces": one.surface.faces}
        blocks.append(block | ({"density": one.density / scale**3} if one.density else {"support": True}))
    loads = [{"kind": "acceleration", "value": (scale * turned.apply([0.0, 0.0, -G])).tolist()}]
    data = {"schema": "masonry-problem/1", "name": path.stem, "dimension": 3, "contact": {"mu": structure.mu}, "loads": loads}
    path.write_text(json.dumps(data | {"blocks": blocks}))
    return path


def wall(length: int, courses: int, thickness: float, *, step: float = 0.0, mu: float = 0.6) -> Structure:
    """Running bond along x of stones 0.4 x 0.2 m; every course `step` further in y than the one below (corbelled)."""
    stones = [floor()]
    for course in range(courses):
        ends = [0.0, *(k + (0.5 if course % 2 else 1.0) for k in range(length - (course + 1) % 2)), float(length)]
        for a, b in pairwise(ends):
            y = course * step
            stones.append(stone(box((0.4 * a, y, 0.2 * course), (0.4 * b, y + thickness, 0.2 * (course + 1)))))
    return Structure(tuple(stones), mu)


def corner(courses: int, *, tee: bool = False, mu: float = 0.6) -> Structure:
    """Two walls of stones 0.4 x 0.2 x 0.2 m at a right angle, bonded: courses pass through in turn; tee: the first goes on beyond."""
    w, length, h = 0.2, 0.4, 0.2
    stones = [floor()]
    for course in range(courses):
        z = (course * h, (course + 1) * h)
        if course % 2 == 0:  # the wall along x passes through
            first = [-length, 0.0, length, 2 * length] if tee else [0.0, length, 2 * length]
            along_x = list(pairwise(first))
            along_y = [(w, w + length), (w + length, w + 2 * length)]
        else:
            first = [-length, -0.5 * length, 0.0] if tee else []
            along_x = [*pairwise(first), (w, w + length), (w + length, 2 * length)]
            along_y = [(0.0, length), (length, w + 2 * length)]
        stones += [stone(box((a, 0.0, z[0]), (b, w, z[1]))) for a, b in along_x]
        stones += [stone(box((0.0, a, z[0]), (w, b, z[1]))) for a, b in along_y]
    return Structure(tuple(stones), mu)


def pyramid(layers: int, mu: float = 0.5) -> Structure:
    """Cubes in squares, each layer half a cube inwards, densities unlike."""
    dice = np.random.default_rng(layers)
    stones = [floor()]
    for layer in range(layers):
        for i in range(layers - layer):
            for j in range(layers - layer):
                low = np.array([i + 0.5 * layer, j + 0.5 * layer, layer])
                stones.append(stone(box(0.5 * low, 0.5 * (low + 1)), float(dice.uniform(1000, 2500))))
    return Structure(tuple(stones), mu)


def between_spheres(radii: tuple[float, float], down: tuple[float, float], around: tuple[float, float]) -> Solid:
    """A voussoir of a dome: angles from the crown and about the axis."""

    def at(r: float, theta: float, phi: float) -> Vector:
        return r * math.sin(theta) * math.cos(phi), r * math.sin(theta) * math.sin(phi), r * math.cos(theta)

    order = [(0, 0), (1, 0), (1, 1), (0, 1)]
    points = [at(radii[i], down[1 - k], around[j]) for k in (0, 1) for i, j in order]
    return Solid(np.array(points), HEXAHEDRON)


def dome(rings: int, sectors: int, thickness: float, *, lunes: bool = False, mu: float = 0.7) -> Structure:
    """A hemisphere of radius 1 with an eye, on a floor; lunes: two opposite sectors alone, which meet in a stone at the crown."""
    radii = (1 - 0.5 * thickness, 1 + 0.5 * thickness)
    eye = 0.12
    angles = np.linspace(math.pi / 2, eye, rings + 1)
    stones = [floor()]
    for k in range(rings):
        for j in range(sectors):
            if lunes and j not in (0, sectors // 2):
                continue
            width = math.pi / sectors
            around = (2 * width * j - width, 2 * width * j + width)
            stones.append(stone(between_spheres(radii, (angles[k + 1], angles[k]), around)))
    if lunes:  # the keystone: a wedge whose flanks are the planes of the last joints
        x = math.sin(eye) * math.cos(math.pi / sectors)
        half = [0.5 * r * math.sin(eye) * math.sin(math.pi / sectors) for r in radii]
        z = [r * math.cos(eye) for r in radii]
        corners = [(s * radii[i] * x, t * 2 * half[i], z[i]) for i in (0, 1) for s, t in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        stones.append(stone(Solid(np.array(corners), HEXAHEDRON)))
    return Structure(tuple(stones), mu)


def voussoir(radii: tuple[float, float], angles: tuple[float, float], y: tuple[float, float], centre: Vector = (0, 0, 0)) -> Solid:
    """Between two radii and angles from x towards z, straight chords, prism along y."""
    (r0, r1), (a0, a1) = radii, angles
    outline = [(r * math.cos(a), r * math.sin(a)) for r, a in ((r0, a0), (r1, a0), (r1, a1), (r0, a1))]
    solid = prism(outline, *y, along="y")
    return Solid(solid.corners + np.array(centre), solid.faces)


def vault(
    around: int, along: int, *, missing: bool = False, half: float = math.pi / 2, thickness: float = 0.2, mu: float = 0.7
) -> Structure:
    """A barrel of radius 1 in running bond, springers held; missing: without one stone at the crown."""
    radii = (1 - 0.5 * thickness, 1 + 0.5 * thickness)
    angles = np.linspace(math.pi / 2 - half, math.pi / 2 + half, around + 1)
    stones = []
    for k in range(around):
        ends = [0.0, *(j + (0.5 if k % 2 else 1.0) for j in range(along - (k + 1) % 2)), float(along)]
        for place, (a, b) in enumerate(pairwise(ends)):
            if missing and k == around // 2 and place == len(ends) // 2 - 1:
                continue
            solid = voussoir(radii, (angles[k], angles[k + 1]), (0.4 * a, 0.4 * b))
            stones.append(stone(solid, 0.0 if k in (0, around - 1) else 2200.0))
    return Structure(tuple(stones), mu)


def flying_buttress(mu: float = 0.7) -> Structure:
    """Half an arch from a pier of three stones, which stands on a floor, to a wall that is held."""
    stones = [floor()]
    radii, top = (1.0, 1.25), 1.5
    angles = np.linspace(0, math.pi / 2 - 0.3, 6)
    for a, b in pairwise(angles):
        stones.append(stone(voussoir(radii, (a, b), (0.0, 0.3), (0, 0, top)), 2000.0))
    stones += [stone(box((0.9, -0.05, 0.5 * k), (1.6, 0.35, 0.5 * (k + 1))), 2300.0) for k in range(3)]
    last = [(r * math.cos(angles[-1]), top + r * math.sin(angles[-1])) for r in (0.9, 1.4)]
    stones.append(stone(prism([last[0], last[1], (-1.0, last[1][1]), (-1.0, last[0][1])], -0.1, 0.4, along="y"), 0.0))
    return Structure(tuple(stones), mu)


def joggled(mu: float = 0.0, clearance: float = 0.0) -> Structure:
    """A tongue in a notch: an upside-up U, 1.2 x 0.6 x 0.5 m, upon which a T stands with its stem in the notch."""
    below = [(-0.6, 0.0), (0.6, 0.0), (0.6, 0.5), (0.2, 0.5), (0.2, 0.3), (-0.2, 0.3), (-0.2, 0.5), (-0.6, 0.5)]
    u = Stone(
        prism(below, 0.0, 0.6, along="y"),
        (box((-0.6, 0, 0), (-0.2, 0.6, 0.5)), box((-0.2, 0, 0), (0.2, 0.6, 0.3)), box((0.2, 0, 0), (0.6, 0.6, 0.5))),
        0.0,
    )
    t = 0.2 - clearance
    above = [(-t, 0.3), (t, 0.3), (t, 0.5), (0.6, 0.5), (0.6, 1.1), (-0.6, 1.1), (-0.6, 0.5), (-t, 0.5)]
    pieces = (box((-t, 0, 0.3), (t, 0.6, 0.5)), box((-0.6, 0, 0.5), (0.6, 0.6, 1.1)))
    return Structure((u, Stone(prism(above, 0.0, 0.6, along="y"), pieces, 2000.0)), mu)


def twisted(count: int, mu: float = 0.6) -> Structure:
    """A tower of boxes and drums of three to seven sides, each turned about the axis: joints with many corners."""
    dice = np.random.default_rng(count)
    stones, z = [floor()], 0.0
    for _ in range(count):
        sides, radius, phase, h = (
            3 + int(dice.integers(5)),
            float(dice.uniform(0.35, 0.5)),
            float(dice.uniform(0, 2)),
            float(dice.uniform(0.2, 0.4)),
        )
        outline = [
            (radius * math.cos(phase + 2 * math.pi * j / sides), radius * math.sin(phase + 2 * math.pi * j / sides)) for j in range(sides)
        ]
        stones.append(stone(prism(outline, z, z + h), float(dice.uniform(800, 2800))))
        z += h
    return Structure(tuple(stones), mu)


def hooked(mu: float = 0.5) -> Structure:
    """L-shaped stones upon each other, turned by quarter turns, and a slab upon them."""
    ell = [(0.0, 0.0), (0.6, 0.0), (0.6, 0.3), (0.3, 0.3), (0.3, 0.6), (0.0, 0.6)]
    parts = [[(0.0, 0.0), (0.6, 0.0), (0.6, 0.3), (0.0, 0.3)], [(0.0, 0.3), (0.3, 0.3), (0.3, 0.6), (0.0, 0.6)]]
    stones, middle = [floor()], np.array([0.3, 0.3, 0.0])
    for k in range(3):
        quarter = Rotation.from_euler("z", 90 * k, degrees=True)

        def placed(solid: Solid, turn: Rotation = quarter) -> Solid:
            return Solid(np.round(turn.apply(solid.corners - middle) + middle, 12), solid.faces)

        z = 0.25 * k, 0.25 * (k + 1)
        pieces = tuple(placed(prism(part, *z)) for part in parts)
        stones.append(Stone(placed(prism(ell, *z)), pieces, (2000.0, 2300.0, 1500.0)[k]))
    stones.append(stone(box((0.05, 0.05, 0.75), (0.6, 0.55, 0.9))))
    return Structure(tuple(stones), mu)
