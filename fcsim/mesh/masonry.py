"""Masonry: walls in running bond, whose courses are shifted by half a brick, and semicircular arches of equal voussoirs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from fcsim.errors import InputError
from fcsim.mesh.blocks import AXES, brick, rectangle
from fcsim.mesh.part import Body, FloatArray, IntArray, Material, Part


@dataclass(frozen=True, eq=False)
class RunningBond:
    """A wall of nb bodies, course by course from the bottom, each from left to right along x; the last axis points upwards.

    bodies    nb bodies of at most two parts, "full block" and "half block", named "course 1 block 2"
    course    (nb,) number of each body's course, from 1 at the bottom
    position  (nb,) place of each body in its course, from 1 on the left
    size      (d,) [m] length, thickness and height of the wall (2D: length and height); it stands on the origin

    Every block has the surfaces of `brick` or `rectangle`: "x-" and "x+" are its heads, `bottom` and `top` its beds.
    """

    bodies: tuple[Body, ...]
    course: IntArray
    position: IntArray
    size: FloatArray

    @property
    def courses(self) -> int:
        return int(self.course[-1])

    @property
    def bottom(self) -> str:
        """Name of the surface that a block stands on: "z-", in 2D "y-"."""
        return AXES[len(self.size) - 1] + "-"

    @property
    def top(self) -> str:
        return AXES[len(self.size) - 1] + "+"

    def bodies_of_course(self, course: int) -> IntArray:
        """Numbers in `bodies` of the blocks of a course (1 = bottom), from left to right."""
        if not 1 <= course <= self.courses:
            raise InputError(f"bodies_of_course: expected a course 1 ... {self.courses}, got {course}")
        return np.flatnonzero(self.course == course)

    def head_joints(self) -> IntArray:
        """Pairs (left, right) (nj, 2) of body numbers that face each other over a head joint: "x+" of the left, "x-" of the right."""
        left = np.flatnonzero(self.course[1:] == self.course[:-1])
        return np.stack((left, left + 1), axis=1)

    def bed_joints(self) -> IntArray:
        """Pairs (lower, upper) (nj, 2) of body numbers that lie on each other: `top` of the lower, `bottom` of the upper."""
        start = np.array([body.translation[0] for body in self.bodies])
        end = start + np.array([np.ptp(body.part.points[:, 0]) for body in self.bodies])
        tolerance = 1e-9 * self.size[0]
        pairs = []
        for course in range(1, self.courses):
            lower, upper = self.bodies_of_course(course), self.bodies_of_course(course + 1)
            # Ends are sorted, so those of the lower course that overlap an upper block are a range.
            first = np.searchsorted(end[lower], start[upper] + tolerance, side="right")
            count = np.searchsorted(start[lower], end[upper] - tolerance, side="left") - first
            within = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
            pairs.append(np.stack((lower[np.repeat(first, count) + within], np.repeat(upper, count)), axis=1))
        return np.concatenate(pairs) if pairs else np.empty((0, 2), dtype=np.int64)


def running_bond(
    courses: int = 3,
    blocks: float = 3.5,
    block_size: Sequence[float] = (0.2, 0.1, 0.1),
    divisions: Sequence[int] = (8, 4, 4),
    *,
    material: Material,
    cell: str | None = None,
    gap: float = 0.0,
    plane: Literal["strain", "stress"] = "strain",
    thickness: float = 1.0,
) -> RunningBond:
    """Return a wall of `courses` courses, each `blocks` blocks long, alternate courses shifted by half a block.

    blocks      a multiple of 1/2. n + 1/2: n full blocks and a half block in every course, the half block first in courses 1, 3, ...
                and last in courses 2, 4, ... A whole number n: n full blocks in courses 1, 3, ... and a half block at each end of
                n - 1 full ones in courses 2, 4, ...
    block_size  (length, thickness, height) [m] of a full block along x, y, z; in 2D (length, height) along x, y
    divisions   elements of a full block along the same axes; a half block takes half of those along its length
    cell        "hexahedron" (default) or "tetrahedron"; in 2D "quadrilateral" (default) or "triangle"
    gap         width [m] >= 0 of the empty joints, bed and head; a half block is (length - gap) / 2 long, so that the ends are flush
    plane, thickness   2D only, those of `Part`

    The half block is meshed like half of the full one, so nodes of neighbouring courses meet where gap = 0.
    """
    d = len(block_size)
    if d not in (2, 3):
        raise InputError(f"running_bond, block_size: expected (length, thickness, height) or in 2D (length, height), got {block_size!r}")
    if len(divisions) != d:
        raise InputError(f"running_bond, divisions: expected {d} whole numbers as for block_size, got {divisions!r}")
    if courses < 1 or courses != int(courses):
        raise InputError(f"running_bond, courses: expected a whole number >= 1, got {courses!r}")
    if not blocks >= 1 or 2 * blocks != int(2 * blocks):
        raise InputError(f"running_bond, blocks: expected a multiple of 1/2, >= 1, as 3 or 3.5, got {blocks!r}")
    if not 0 <= gap < block_size[0]:
        raise InputError(f"running_bond, gap: expected 0 <= gap < {block_size[0]} m, the length of a block, got {gap!r}")
    n, halves = divmod(round(2 * blocks), 2)
    needs_half = bool(halves) or courses > 1
    if needs_half and divisions[0] % 2:
        raise InputError(
            f"running_bond, divisions: expected an even number along the length, of which a half block takes half, got {divisions[0]}"
        )

    def block(name: str, length: float, along: int) -> tuple[Part, float]:
        size, counts = (length, *block_size[1:]), (along, *divisions[1:])
        if d == 3:
            return brick(name, size, counts, material, cell or "hexahedron"), length
        return rectangle(name, size, counts, material, cell or "quadrilateral", plane=plane, thickness=thickness), length

    full = [block("full block", block_size[0], divisions[0])]
    half = [block("half block", (block_size[0] - gap) / 2, divisions[0] // 2)] if needs_half else []
    rows = (half + full * n, full * n + half) if halves else (full * n, half + full * (n - 1) + half)

    bodies, course, position = [], [], []
    for c in range(int(courses)):
        start, height = 0.0, c * (block_size[-1] + gap)
        for place, (part, length) in enumerate(rows[c % 2], start=1):
            translation = (start, height) if d == 2 else (start, 0.0, height)
            bodies.append(Body(f"course {c + 1} block {place}", part, translation=np.array(translation)))
            course.append(c + 1)
            position.append(place)
            start += length + gap
    size = np.array([n * block_size[0] + (n - 1) * gap, *block_size[1:]], dtype=float)
    size[0] += halves * ((block_size[0] - gap) / 2 + gap)
    size[-1] = courses * block_size[-1] + (courses - 1) * gap
    return RunningBond(tuple(bodies), np.array(course), np.array(position), size)


@dataclass(frozen=True, eq=False)
class SemicircularArch:
    """An arch of n equal voussoirs with radial joints over the origin, in the plane of x and z (2D: x and y), springing from height 0.

    bodies     "voussoir 1" ... "voussoir n" from the left springing to the right one, all of one part
    radius     [m] of the middle line; thickness [m]; depth [m] along y (2D: None)

    A voussoir has the surfaces "x-" and "x+", its joints to the left and to the right, and the lowest and highest of the axes,
    `intrados` and `extrados`. Its cells are straight: between the joints the surfaces are chords of the circles.
    """

    bodies: tuple[Body, ...]
    radius: float
    thickness: float
    depth: float | None

    @property
    def intrados(self) -> str:
        """Name of the surface towards the centre: "z-", in 2D "y-"."""
        return AXES[1 if self.depth is None else 2] + "-"

    @property
    def extrados(self) -> str:
        return AXES[1 if self.depth is None else 2] + "+"

    def joints(self) -> IntArray:
        """Pairs (left, right) (n - 1, 2) of body numbers: "x+" of the left faces "x-" of the right."""
        left = np.arange(len(self.bodies) - 1)
        return np.stack((left, left + 1), axis=1)


def semicircular_arch(
    voussoirs: int = 20,
    radius: float = 1.0,
    thickness: float = 0.12,
    depth: float | None = 0.3,
    divisions: Sequence[int] = (1, 1, 1),
    *,
    material: Material,
) -> SemicircularArch:
    """Return a semicircular arch of `voussoirs` equal blocks of hexahedra (depth=None: a plane one of quadrilaterals).

    radius      [m] of the middle line, thickness [m] < 2 radius, depth [m] along y
    divisions   elements of a voussoir along the arch, the depth and the thickness (2D: along the arch and the thickness)
    """
    d = 2 if depth is None else 3
    if voussoirs < 2 or voussoirs != int(voussoirs):
        raise InputError(f"semicircular_arch, voussoirs: expected a whole number >= 2, got {voussoirs!r}")
    if not (np.isfinite(radius) and 0 < thickness < 2 * radius):
        raise InputError(f"semicircular_arch: expected a thickness > 0 and < 2 radius, got {thickness!r} and the radius {radius!r}")
    if len(divisions) != d:
        raise InputError(f"semicircular_arch, divisions: expected {d} whole numbers, got {divisions!r}")
    angle = np.pi / voussoirs
    if depth is None:
        straight = rectangle("voussoir", (angle, thickness), divisions, material, origin=(-angle / 2, radius - thickness / 2))
    else:
        size, origin = (angle, depth, thickness), (-angle / 2, -depth / 2, radius - thickness / 2)
        straight = brick("voussoir", size, divisions, material, origin=origin)
    points = straight.points.copy()
    around, r = points[:, 0].copy(), points[:, -1].copy()
    points[:, 0], points[:, -1] = r * np.sin(around), r * np.cos(around)
    part = replace(straight, points=points)
    bodies = []
    for k in range(int(voussoirs)):
        a = (k + 0.5) * angle - np.pi / 2  # from the vertical, clockwise
        rotation = np.eye(d)
        rotation[0, 0] = rotation[-1, -1] = np.cos(a)
        rotation[0, -1], rotation[-1, 0] = np.sin(a), -np.sin(a)
        bodies.append(Body(f"voussoir {k + 1}", part, rotation))
    return SemicircularArch(tuple(bodies), float(radius), float(thickness), depth)
