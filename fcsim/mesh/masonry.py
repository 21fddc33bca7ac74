"""Masonry walls in running bond: bricks laid in courses, each course shifted by half a brick."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from fcsim.arrays import FloatArray, IntArray, is_number
from fcsim.brief import brief
from fcsim.errors import InputError
from fcsim.memory import refuse_beyond_memory
from fcsim.mesh.blocks import AXES, brick, rectangle
from fcsim.mesh.material.law import AnyMaterial
from fcsim.mesh.part import Body, Part

BYTES_PER_BLOCK = 2e4
"""Bodies, their layout and surfaces."""


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

    __repr__ = brief

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
    block_size: Sequence[float] | FloatArray = (0.2, 0.1, 0.1),
    divisions: Sequence[int] = (8, 4, 4),
    *,
    material: AnyMaterial,
    cell: str | None = None,
    gap: float = 0.0,
    plane: Literal["strain", "stress"] = "strain",
    thickness: float = 1.0,
    elements: str | None = None,
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
    elements    those of `Part`: "Q1" by default

    The half block is meshed like half of the full one, so nodes of neighbouring courses meet where gap = 0.
    """
    _check(courses, blocks, block_size, divisions, gap)
    count = float(courses) * float(blocks)
    refuse_beyond_memory(f"running_bond: a wall of {count:g} blocks", BYTES_PER_BLOCK * count)
    d = len(block_size)
    n, halves = divmod(round(2 * blocks), 2)

    def block(name: str, length: float, along: int) -> tuple[Part, float]:
        size, counts = (length, *block_size[1:]), (along, *divisions[1:])
        if d == 3:
            return brick(name, size, counts, material, cell or "hexahedron", elements=elements), length
        plane_part = rectangle(name, size, counts, material, cell or "quadrilateral", plane=plane, thickness=thickness, elements=elements)
        return plane_part, length

    full = [block("full block", block_size[0], divisions[0])]
    half = [block("half block", (block_size[0] - gap) / 2, divisions[0] // 2)] if halves or courses > 1 else []
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


def _check(courses: float, blocks: float, block_size: Sequence[float] | FloatArray, divisions: Sequence[int], gap: float) -> None:
    """InputError for what no wall can be laid from, see `running_bond`."""
    d = len(block_size)
    if d not in (2, 3):
        raise InputError(f"running_bond, block_size: expected (length, thickness, height) or in 2D (length, height), got {block_size!r}")
    if len(divisions) != d:
        raise InputError(f"running_bond, divisions: expected {d} whole numbers as for block_size, got {divisions!r}")
    if not (is_number(courses) and courses >= 1) or courses != int(courses):
        raise InputError(f"running_bond, courses: expected a whole number >= 1, got {courses!r}")
    if not (is_number(blocks) and blocks >= 1) or 2 * blocks != int(2 * blocks):
        raise InputError(f"running_bond, blocks: expected a multiple of 1/2, >= 1, as 3 or 3.5, got {blocks!r}")
    if not (is_number(gap) and 0 <= gap < block_size[0]):
        raise InputError(f"running_bond, gap: expected 0 <= gap < {block_size[0]} m, the length of a block, got {gap!r}")
    if (round(2 * blocks) % 2 or courses > 1) and divisions[0] % 2:
        raise InputError(
            f"running_bond, divisions: expected an even number along the length, of which a half block takes half, got {divisions[0]}"
        )
